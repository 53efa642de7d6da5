"""What a summary says was applied, and nothing else: FAULTS row 29."""

import dataclasses
import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binomtest, fisher_exact, ranksums

from planar_push.main import main
from push_model.jobs import JobError
from push_model.settings import SettingsError
from push_study.experiments import grasp_selection, grasp_study, group_goals
from push_study.study import StudyOptions, experiment, experiment_names, run_study, statistics_of
from push_study.summary import aggregate, by_cell, known
from push_study.team_run import Outcome, TeamTrace
from push_study.trials import identity
from push_study.uncertainty import UNCERTAINTIES
from sim_bridge.worlds import world_kind

NAMES = experiment_names()
SCENARIOS = Path(__file__).parents[2] / "config" / "scenarios"


def tasks(name, tmp_path, **changes):
    """The fields of the tasks of a small study."""
    what = experiment(name)
    options = StudyOptions(what.SCENARIOS[:1], 1, 1, tmp_path, **changes)
    return [dataclasses.asdict(task) for task in what.tasks(options)]


@pytest.mark.parametrize("name", NAMES)
def test_every_experiment_declares_exactly_the_options_that_reach_its_trials(name, tmp_path):
    declared = experiment(name).OPTIONS
    assert set(declared) <= {"uncertainty", "world"}
    assert declared.get("uncertainty", "mild") in UNCERTAINTIES
    if "world" in declared:
        world_kind(declared["world"])
    for option, values in (("uncertainty", ("none", "hard")), ("world", ("planar", "pybullet"))):
        first, second = (tasks(name, tmp_path, **{option: value}) for value in values)
        assert (first != second) == (option in declared), option


@pytest.mark.parametrize("name", [n for n in NAMES if "world" in experiment(n).OPTIONS])
def test_the_world_that_is_declared_is_the_one_that_is_taken(name, tmp_path):
    world = experiment(name).OPTIONS["world"]
    assert tasks(name, tmp_path) == tasks(name, tmp_path, world=world)


@pytest.mark.parametrize("name", NAMES)
def test_commands_take_the_uncertainty_that_is_declared(name, tmp_path, monkeypatch):
    taken = []

    def spy(name, options):
        taken.append(options.uncertainty)
        return {"trials": [], "requested": 0}

    monkeypatch.setattr("push_study.study.run_study", spy)
    out = ["--out", str(tmp_path / "out")]
    for command in [["experiment", name], *([[name]] if name == "leaderboard" else [])]:
        main([*command, *out])
    assert set(taken) == {experiment(name).OPTIONS.get("uncertainty", "mild")}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("option", ["uncertainty", "world"])
def test_an_option_that_is_not_used_is_refused_by_name(name, option, tmp_path, capsys):
    if option in experiment(name).OPTIONS:
        return
    value = {"uncertainty": "mild", "world": "planar"}[option]  # its default is refused, too
    out = tmp_path / "out"
    assert main(["experiment", name, f"--{option}", value, "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert f"{option}: '{name}' does not use it" in error and not out.exists()
    changed = {"uncertainty": "hard", "world": "planar"}[option]
    options = StudyOptions(experiment(name).SCENARIOS, 1, 1, out, **{option: changed})
    with pytest.raises(SettingsError, match=f"{option}: '{name}' does not use it"):
        run_study(name, options)


class Toy:
    """An experiment without a simulation."""

    SCENARIOS = ("a",)

    def __init__(self, options):
        self.OPTIONS = options

    @staticmethod
    def tasks(options):
        return [ToyTask(s, options.seed + k) for s in options.scenarios for k in range(3)]

    trial = staticmethod(lambda task: toy_row(task))

    @staticmethod
    def statistics(rows):
        return {"seeds": len({r["seed"] for r in rows}), "nothing": math.nan}

    @staticmethod
    def conclude(options, tasks, rows):
        pass


@dataclasses.dataclass(frozen=True)
class ToyTask:
    scenario: str
    seed: int


def toy_row(task):
    return {
        "scenario": task.scenario,
        "seed": task.seed,
        "success": True,
        "reason": "",
        "error_m": [0.1, math.nan, 0.3][task.seed % 3],
    }


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({}, set()),
        ({"uncertainty": "mild"}, {"uncertainty"}),
        ({"uncertainty": "mild", "world": "planar"}, {"uncertainty", "world"}),
    ],
)
def test_a_summary_names_what_was_applied_and_the_statistics(options, said, tmp_path, monkeypatch):
    toy = Toy(options)
    monkeypatch.setattr("push_study.study.experiment", lambda name: toy)
    monkeypatch.setattr(
        "push_study.study.run_trials", lambda trial, tasks, *rest: [trial(t) for t in tasks]
    )
    summary = run_study("toy", StudyOptions(("a",), 1, 3, tmp_path / "out"))
    assert {"uncertainty", "world"} & set(summary) == said
    assert all(summary[key] == options[key] for key in said)
    written = json.loads(
        (tmp_path / "out" / "summary.json").read_text(), parse_constant=pytest.fail
    )
    assert written == summary
    total = written["aggregate"]
    assert total["seeds"] == 3 and total["nothing"] is None
    assert total["error_m"]["mean"] == pytest.approx(0.2)  # of those that are known
    assert [r["error_m"] for r in written["trials"]] == [0.1, None, 0.3]


def test_statistics_of_the_grasp_study_are_those_of_independent_tests():
    random = np.random.default_rng(4)
    rows = []
    for k in range(200):
        test, done = bool(random.random() < 0.5), False
        done = bool(random.random() < (0.9 if test else 0.3))
        row = {
            c: float(random.normal()) for c in {**grasp_study.PRINTED, **grasp_study.OURS}.values()
        }
        row |= {"test": test, "success": done, "scenario": "a", "seed": k}
        row |= {"displacement": float(random.exponential(1.0 + test)), "energy_n": float(k % 7)}
        rows.append(row)
    found = aggregate(rows, statistics_of(grasp_study, rows))
    counts = [[0, 0], [0, 0]]
    for r in rows:
        counts[r["success"]][r["test"]] += 1
    assert found["failed_where_test_passes"] == counts[0][1]
    assert found["fisher_p"] == pytest.approx(fisher_exact(counts)[1])
    slid = [[r["displacement"] for r in rows if r["test"] is t] for t in (True, False)]
    assert found["ranksum_p"] == pytest.approx(ranksums(*slid).pvalue)
    done = [r for r in rows if r["success"]]
    for index, column in {**grasp_study.PRINTED, **grasp_study.OURS}.items():
        r = np.corrcoef([d[column] for d in done], [d["energy_n"] for d in done])[0, 1]
        assert found[f"correlation_{index}"]["r"] == pytest.approx(r)
        assert f"cross_validated_{index}" in found


def test_statistics_of_grasp_selection_are_sign_tests_of_its_pairs():
    random, rows = np.random.default_rng(1), []
    for seed in range(9):
        for law in grasp_selection.LAWS:
            for grasp in grasp_selection.GRASPS:
                error = float(random.uniform(1.0, 2.0)) - 0.6 * (grasp == "selected")
                row = {"scenario": "a", "seed": seed, "trajectory": "t", "grasp": grasp}
                rows.append(row | {"law": law, "success": True, "position_error_m": error})
    found = grasp_selection.statistics(rows)
    for law in grasp_selection.LAWS:
        of = {(r["seed"], r["grasp"]): r["position_error_m"] for r in rows if r["law"] == law}
        nearer = sum(of[s, "selected"] < of[s, "random"] for s in range(9))
        assert found[f"selected_nearer_{law}"] == nearer
        expected = binomtest(nearer, 9).pvalue
        assert found[f"sign_p_grasp_{law}"] == pytest.approx(expected)
    assert found["pairs_of_laws"] == 18


@pytest.mark.parametrize("name", NAMES)
def test_every_study_writes_what_its_rows_amount_to(name):
    """Also where no trial came far enough to have measures."""
    what = experiment(name)
    assert hasattr(what, "statistics"), f"{name} prints what its summary does not have"
    aggregate([], statistics_of(what, []))


def test_statistics_of_wheel_slip_pair_its_seeds():
    rows = [
        {"case": 2, "constraint": held, "seed": seed, "slip_rms_m_s": slip, "error_rms_m": error}
        for held, cells in (
            (True, ((1, 0.01, 0.02), (2, 0.02, 0.03), (3, 0.03, 0.4))),
            (False, ((1, 0.2, 0.01), (2, 0.2, 0.03), (3, 0.2, 0.5), (4, 9.0, 9.0))),
        )
        for seed, slip, error in cells
    ]
    (cell,) = experiment("wheel-slip").statistics(rows).values()
    assert cell["pairs"] == 3 and cell["slip_removed"] == pytest.approx(0.9)
    assert cell["error_ratio"] == pytest.approx(0.45 / 0.54)
    assert cell["error_ratio_median"] == pytest.approx(1.0)  # of 2, 1 and 0.8


def test_statistics_of_changed_worlds_count_what_ended_before_the_change():
    row = {"kind": "goal", "success": True, "changed_at_s": 3.0, "replans": 2, "collisions": 0}
    rows = [
        row | {"position_error_m": 1e-3},
        row | {"position_error_m": 3e-3, "collisions": 4, "success": False},
        {"kind": "goal", "success": False},
    ]
    assert experiment("changing-world").statistics(rows) == {
        "goal": {
            "trials": 3,
            "successes": 1,
            "position_median_m": pytest.approx(2e-3),
            "position_worst_m": pytest.approx(3e-3),
            "new_plans": 4,
            "collision_ticks": 4,
        }
    }


def test_statistics_of_goals_in_a_row_count_the_goals_that_were_sent():
    rows = [{"sent": 56, "missed": 1}, {"sent": 3, "missed": 0}, {"success": False}]
    found = experiment("goals-in-a-row").statistics(rows)
    assert found == {"goals_sent": 59, "goals_missed": 1}


def test_statistics_of_three_pushes_tell_planned_ends_from_others():
    row = {"variant": "(2.57)", "success": True, "orientation_error_rad": 0.01, "pushes": 3}
    rows = [
        row | {"position_error_m": 1e-3, "replans": 0, "slid_m": 1e-3},
        row | {"position_error_m": 5e-3, "replans": 1, "slid_m": 2e-2, "pushes": 5},
    ]
    cell = experiment("three-push").statistics(rows)["(2.57)"]
    assert (cell["trials"], cell["successes"], cell["as_planned"]) == (2, 2, 1)
    assert cell["slid_worst_m"] == 2e-2 and cell["pushes_mean"] == 4.0


def test_means_by_cell_are_over_the_successes():
    rows = [
        {"law": "a", "robots": n, "success": ok, "lambda": value}
        for n, ok, value in [(8, True, 1.0), (8, True, 2.0), (8, False, 90.0), (20, False, 7.0)]
    ]
    assert by_cell([*rows, {"success": False}], ("law", "robots"), ("lambda",)) == {
        "trials_a_8": 3,
        "successes_a_8": 2,
        "lambda_a_8": 1.5,
        "trials_a_20": 1,
        "successes_a_20": 0,
    }


@pytest.mark.parametrize("name", [n for n in NAMES if n.startswith("swarm")])
def test_lambda_of_every_swarm_study_is_in_its_aggregate(name):
    what, rows = experiment(name), []
    for k in range(4):
        ratios = dict.fromkeys(("dead_over_alive", "moved_over_direct", "with_the_arc"), 1.0 + k)
        row = {"scenario": "s", "robots": 8, "law": "crescent", "method": "m", "seed": k}
        row |= {"item": "i", "turned": True, "believed": "exact", "arm": "told"}
        row |= {"lambda": 1.0 + k, "success": k < 3}
        rows.append(row | {"charged_s": 10.0, "delta_s": 1.0} | ratios)
    found = aggregate(rows, statistics_of(what, rows))
    if name == "swarm-upsets":
        assert found["dead_over_alive_median"] == 2.0
    elif name not in ("swarm-maps", "swarm-decentralised"):  # which have no Lambda
        (key,) = [k for k in found if k.startswith("lambda_")]
        assert found[key] == pytest.approx(2.0)


READ = ["single-robot", "displaced", "changing-world", "goals-in-a-row", "beside-walls"]
READ += ["line-tracking", "three-push", "wheel-slip", "calibration", "certificate"]
"""Experiments whose scenarios are files."""


@pytest.mark.parametrize("name", READ)
def test_a_scenario_that_was_edited_makes_other_tasks(name, tmp_path):
    what, file = experiment(name), tmp_path / "mine.yaml"
    text = (SCENARIOS / f"{what.SCENARIOS[0]}.yaml").read_text()
    options = StudyOptions((str(file),), 1, 1, tmp_path, world=what.OPTIONS.get("world", ""))

    def identities():
        return {identity(task) for task in what.tasks(options)}

    file.write_text(text)
    first = identities()
    assert identities() == first
    file.write_text(text.replace("0.0]}", "0.001]}", 1))  # a robot's heading
    assert not identities() & first


def test_without_git_a_study_is_continued_by_the_same_version_only(tmp_path, monkeypatch):
    monkeypatch.setattr("push_study.study.experiment", lambda name: Toy({}))
    monkeypatch.setattr("push_study.study.run_trials", lambda trial, tasks, *rest: [])
    monkeypatch.setattr("push_study.study.revision", lambda: "")
    options = StudyOptions(("a",), 1, 3, tmp_path / "out")
    assert run_study("toy", options)["revision"].startswith("planar-push ")
    run_study("toy", options)
    monkeypatch.setattr("push_study.study.versions", lambda: {"planar-push": "99.0"})
    with pytest.raises(FileExistsError, match=r"this one's is 'planar-push 99\.0'"):
        run_study("toy", options)


def test_a_statistic_does_not_hide_a_measure():
    with pytest.raises(ValueError, match="error_m"):
        aggregate([toy_row(ToyTask("a", 0))], {"error_m": 1.0})
    assert known({"a": (np.float64(1.0), math.inf, np.int64(2))}) == {"a": [1.0, None, 2]}


@pytest.mark.long
@pytest.mark.parametrize(("ticks", "success"), [(0, True), (1, False), (200, False)])
def test_a_goal_that_is_reached_with_a_collision_is_no_success(
    ticks, success, tmp_path, monkeypatch
):
    trace = TeamTrace(collision_ticks=ticks)
    ended = Outcome(1, JobError.NONE, "done", 60.0, 1.0, 1.0, (1e-3, 0.01), trace, {})
    monkeypatch.setattr(group_goals, "run_team", lambda *args: ended)
    row = group_goals.trial(group_goals.GoalTask("open", 23, str(tmp_path), 3, 0, "planar", "none"))
    assert row["success"] is success and row["collision_ticks"] == ticks
    assert row["reason"] == ("" if success else f"collisions in {ticks} ticks")


def test_what_is_not_installed_is_said_before_anything_is_started(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "gym_pusht", None)
    out = tmp_path / "out"
    assert main(["experiment", "pusht", "--trials", "1", "--out", str(out)]) == 2
    assert "gym-pusht is needed" in capsys.readouterr().err and not out.exists()
