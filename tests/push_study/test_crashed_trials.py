"""Trials that die count as failures where they belong, and cost no summary."""

import json
import math

import pytest

from push_study.pool import crashed
from push_study.study import StudyOptions, experiment, experiment_names, run_study, statistics_of
from push_study.summary import aggregate
from tests.samples import mostly_long

NAMES = experiment_names()


def tasks_of(name, out):
    what = experiment(name)
    world = what.OPTIONS.get("world", "")
    options = StudyOptions(what.SCENARIOS, 2, 1, out, world=world)
    return what, options, what.tasks(options)


def counted(found):
    """How many trials the cells of some statistics count; None where there are no such counts."""
    flat = [v for k, v in found.items() if k.startswith("trials_")]
    cells = [c for c in (found, *found.values()) if isinstance(c, dict)]
    flat = flat or [c[k] for c in cells for k in ("trials", "tasks", "of") if k in c]
    return sum(flat) if flat else None


@pytest.mark.parametrize("name", mostly_long(NAMES, 8))
def test_a_study_of_which_every_trial_died_is_concluded_all_the_same(name, tmp_path):
    what, options, tasks = tasks_of(name, tmp_path)
    rows = [crashed(task, "died") for task in tasks]
    found = statistics_of(what, rows)
    total = aggregate(rows, found)
    assert total["trials"] == len(tasks) and total["success"] == 0.0
    assert not {"limit", "robots", "latency_s"} & set(total)  # no measures
    what.conclude(options, tasks, rows)


COUNTED = ["changing-world", "three-push", "rival-papers", "swarm-maps", "group-latency"]


@pytest.mark.parametrize("name", [*COUNTED, "grasp-optimisation", "rearrange", "leaderboard"])
def test_cells_count_the_trials_that_died(name, tmp_path):
    what, _, tasks = tasks_of(name, tmp_path)
    found = statistics_of(what, [crashed(task, "died") for task in tasks])
    assert counted(found) == len(tasks)


ENDED = {"position_error_m": 2e-3, "orientation_error_rad": 0.01, "replans": 0, "collisions": 0}
PUSHED = {"slip_rms_m_s": 0.1, "error_rms_m": 0.2, "solve_p99_ms": 1.0}
MEASURED = {
    "calibration": {
        f"{q}_{k}": v
        for q in ("contact_friction", "com_x", "com_y", "latency")
        for k, v in (("holds", True), ("ratio", 0.2))
    },
    "rival-papers": {
        "duration_s": 300.0,
        "first_motion_s": 40.0,
        "pace_m_s": 0.01,
        "fastest_m_s": 0.05,
    },
    "changing-world": {**ENDED, "changed_at_s": 3.0},
    "three-push": {**ENDED, "pushes": 3, "slid_m": 1e-3},
    "line-tracking": {"final_error_m": 1e-3, "solve_time_ms": 1.0, "solve_time_p99_ms": 2.0},
    "wheel-slip": PUSHED,
    "swarm-outline": {"targets": 6, "lambda": 3.0, "charged_s": 80.0},
}
"""What a trial that came to its end measures."""


@pytest.mark.parametrize("name", MEASURED)
def test_measures_are_of_the_trials_that_did_not_die(name, tmp_path):
    """Means are as without the dead, and they make every count greater."""
    what, options, tasks = tasks_of(name, tmp_path)
    dead = [crashed(task, "died") for task in tasks]
    good = [{**r, **MEASURED[name], "success": True, "reason": ""} for r in dead]
    for row in good:
        del row["crashed"]
    alone, mixed = (statistics_of(what, rows) for rows in (good, [*dead, *good]))

    def measures(found):
        counts = ("trials", "of", "wilson", "targets")
        return {
            (cell, key): value
            for cell, values in found.items()
            for key, value in (values if isinstance(values, dict) else {"": values}).items()
            if key not in counts and not cell.startswith("trials_")
        }

    assert measures(alone) == pytest.approx(measures(mixed))
    if counted(alone) is not None:
        assert counted(mixed) == 2 * counted(alone)
    what.conclude(options, tasks, [*dead, *good])


def test_a_row_of_a_trial_that_died_says_what_was_tried(tmp_path):
    task = experiment("swarm-decentralised").tasks(
        StudyOptions(("transport_corner",), 1, 7, tmp_path, world="planar")
    )[0]
    row = crashed(task, "died")
    assert (row["scenario"], row["seed"], row["object"]) == ("transport_corner", 7, task.object)
    assert row["turned"] is True and row["robots"] == 20 and row["lost"] == 0.1
    assert "out" not in row and row["crashed"] and not row["success"]
    options = StudyOptions(("line",), 1, 1, tmp_path, world="planar")
    assert "digest" not in crashed(experiment("calibration").tasks(options)[0], "died")


def test_a_summary_is_written_also_where_the_statistics_fail(tmp_path, monkeypatch):
    what = experiment("pusht")
    row = {"scenario": "pusht", "seed": 1, "success": True, "steps": 40, "nowhere": math.nan}
    monkeypatch.setattr(what, "ready", lambda: None)
    monkeypatch.setattr("push_study.study.run_trials", lambda *args: [row])
    monkeypatch.setattr(what, "statistics", lambda rows: 1 / 0)
    options = StudyOptions(("pusht",), 1, 1, tmp_path / "out")
    with pytest.raises(ZeroDivisionError):
        run_study("pusht", options)
    written = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert written["trials"] == [{**row, "nowhere": None}]
    assert written["aggregate"]["steps"]["mean"] == 40.0
    assert (tmp_path / "out" / "trials.csv").is_file()
