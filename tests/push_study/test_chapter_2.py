"""Slices of chapter 2's studies, whole graphs in lockstep."""

import json
from dataclasses import replace

import numpy as np
import pytest

from push_model import se2
from push_scenario.scenario import load_scenario
from push_study.experiments import displaced, goals_in_a_row, line_tracking, three_push
from push_study.study import StudyOptions, run_study


@pytest.mark.parametrize(
    ("uncertainty", "variants"),
    [("mild", ("with (2.53)", "with (2.57)", "without")), ("hard", ("with (2.53)", "without"))],
)
def test_the_line_is_tracked_with_the_constraint_and_the_object_lost_without(
    tmp_path, uncertainty, variants
):
    for variant in variants:
        task = line_tracking.LineTask("line", 3, str(tmp_path), 0.1, variant, uncertainty)
        task = replace(task, length=2.0)
        row = line_tracking.trial(task)
        assert task.trace_file.is_file()
        if variant == "without":
            assert row["final_error_m"] > 0.05
        else:
            assert row["final_error_m"] < 0.01 and row["success"], row


def test_every_offset_has_every_variant_and_a_plot(tmp_path, capsys):
    options = StudyOptions(("line",), 1, 1, tmp_path)
    tasks = line_tracking.tasks(options)
    assert len(tasks) == len(line_tracking.OFFSETS) * len(line_tracking.VARIANTS)
    rows = [
        {
            "offset_m": t.offset,
            "variant": t.variant,
            "final_error_m": 0.001,
            "solve_time_ms": 0.1,
            "solve_time_p99_ms": 0.2,
        }
        for t in tasks
    ]
    for task in tasks[:3]:
        way = np.linspace(0.0, 1.0, 20)
        pose = np.column_stack([way, 0 * way, 0 * way])
        np.savez(task.trace_file, time=way, robot=pose, object=pose, aside=0 * way)
    line_tracking.conclude(options, tasks, rows)
    assert (tmp_path / "line-tracking.png").stat().st_size > 5000
    out = capsys.readouterr().out
    assert "> 50" in out and out.count("1.00 (1.00)") == len(tasks)


def test_the_complete_manipulation_ends_where_it_should(tmp_path, capsys):
    task = three_push.ThreePushTask("three-push", 2, str(tmp_path), "with (2.53)")
    row = three_push.trial(task)
    assert row["success"] and row["collisions"] == row["contact_losses"] == 0
    assert row["position_error_m"] < 0.02 and row["orientation_error_rad"] < np.deg2rad(1.0)
    three_push.conclude(StudyOptions(("three-push",), 1, 2, tmp_path), [task], [row])
    assert (tmp_path / "three-push.png").stat().st_size > 5000
    assert "1/1" in capsys.readouterr().out


def test_a_scenario_without_a_goal_is_refused(tmp_path, capsys):
    from planar_push.main import main

    words = ["experiment", "three-push", "--scenarios", "line", "--out", str(tmp_path / "o")]
    assert main(words) == 2
    assert "'line' has no goal" in capsys.readouterr().err
    assert not (tmp_path / "o").exists()


def test_uncertainty_is_part_of_what_a_study_is(tmp_path):
    mark = {"experiment": "three-push", "seed": 1, "uncertainty": "hard"}
    (tmp_path / "study.json").write_text(json.dumps(mark))
    with pytest.raises(FileExistsError, match="uncertainty is 'hard', this one's is 'mild'"):
        run_study("three-push", StudyOptions(("three-push",), 1, 1, tmp_path))


def test_a_box_that_is_moved_in_mid_push_comes_to_its_goal_all_the_same(tmp_path, capsys):
    options = StudyOptions(("env3-target1",), 1, 4, tmp_path)
    (task,) = displaced.tasks(options)
    row = displaced.trial(task)
    assert row["success"] and row["collisions"] == 0, row
    assert row["displaced_m"] > 0.005 and row["position_error_m"] < 0.01
    displaced.conclude(options, [task], [row])
    assert "1 of 1 within 10 mm" in capsys.readouterr().out


def test_disturbances_fill_their_ranges_and_differ_between_scenarios():
    events = [displaced.disturbance(load_scenario("env1-target1"), s) for s in range(300)]
    far = np.array([np.hypot(*e.by[:2]) for e in events])
    turn = np.array([e.by[2] for e in events])
    assert far.max() <= displaced.FAR and far.max() > 0.039 and np.abs(turn).max() > 0.115
    assert {e.body for e in events} == {"box"} and min(e.at for e in events) >= 12.0
    other = displaced.disturbance(load_scenario("env1-target2"), 0)
    assert other.by != events[0].by


def test_goals_in_a_row_are_reached_without_a_reset(tmp_path, capsys):
    (task,) = goals_in_a_row.tasks(StudyOptions(("env3-target1",), 1, 2, tmp_path))
    assert task.goals == 56
    row = goals_in_a_row.trial(replace(task, goals=2))
    assert row["success"] and row["missed"] == 0, row["reason"]
    goals_in_a_row.conclude(StudyOptions(("env3-target1",), 1, 2, tmp_path), [task], [row])
    assert "0 of 56 goals missed" in capsys.readouterr().out
    scenario = load_scenario("env3-target1")
    for goal in goals_in_a_row.draw_goals(scenario, 100, 3):
        outline = se2.transform(goal, scenario.object()[1].outline)
        assert np.abs(outline[:, 0]).max() < 1.43 and np.abs(outline[:, 1]).max() < 0.93
