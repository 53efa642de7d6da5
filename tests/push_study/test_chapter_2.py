"""Slices of chapter 2's studies, whole graphs in lockstep."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from push_bringup.node_settings import resolved
from push_model import se2
from push_model.settings import SettingsError
from push_mpc import ContactForceSettings
from push_mpc.contact_force_mpc import PRINTED_GAINS
from push_planner import DistanceField, PlannerSettings, PushPlanner, PushScene, push_sides
from push_scenario.scenario import load_scenario
from push_study.experiments import (
    beside_walls,
    changing_world,
    displaced,
    goals_in_a_row,
    line_tracking,
    three_push,
)
from push_study.study import StudyOptions, experiment, run_study

SCENARIOS = Path(__file__).parents[2] / "config" / "scenarios"


def tracked(tmp_path, offset, variant, uncertainty="mild", length=1.5):
    task = line_tracking.LineTask("line", 3, str(tmp_path), offset, variant, uncertainty)
    row = line_tracking.trial(replace(task, length=length))
    assert task.trace_file.is_file()
    return row


@pytest.mark.long
def test_the_line_is_tracked_with_the_constraint_and_the_object_lost_without(tmp_path):
    held = tracked(tmp_path, 0.1, "(2.53), our gains")
    lost = tracked(tmp_path, 0.1, "none, our gains")
    assert held["final_error_m"] < 0.01 and held["success"], held
    assert lost["final_error_m"] > 0.05


@pytest.mark.study
@pytest.mark.parametrize(
    ("variant", "uncertainty"),
    [("(2.57)", "mild"), ("(2.53), our gains", "hard"), ("none, our gains", "hard")],
)
def test_other_constraints_and_greater_uncertainty_on_the_line(tmp_path, variant, uncertainty):
    row = tracked(tmp_path, 0.1, variant, uncertainty)
    assert (row["final_error_m"] > 0.05) == variant.startswith("none"), row


def test_the_printed_gains_are_those_of_the_thesis_and_reach_the_controller(tmp_path):
    """Section 2.4.6: Q = diag(15, 20, 5, 1, 1), P = 50 Q, R_u and R_du; whatever ours are."""
    settings = replace(ContactForceSettings(), **PRINTED_GAINS)
    assert settings.state_weight == (15.0, 20.0, 5.0, 1.0, 1.0)
    assert settings.terminal_factor == 50.0 and settings.force_weight == 0.001
    assert settings.input_weight == settings.input_rate_weight == (0.1, 0.1)
    assert settings.state_weight != ContactForceSettings().state_weight
    for study in (line_tracking, three_push):
        names = [v for v in study.VARIANTS if "printed gains" in v]
        assert len(names) == 2  # with the constraint and without
        assert {v.replace("printed", "our") for v in names} < set(study.VARIANTS)
    believed, *_ = line_tracking.world_of(
        line_tracking.LineTask("line", 1, str(tmp_path), 0.2, "none, printed gains")
    )
    mpc = resolved(believed).parameters["controller"]["mpc"]
    assert tuple(mpc["state_weight"]) == (15.0, 20.0, 5.0, 1.0, 1.0)
    assert mpc["terminal_factor"] == 50.0 and mpc["constraint"] is False


def test_every_offset_has_every_variant_and_a_plot(tmp_path, capsys):
    options = StudyOptions(("line",), 1, 1, tmp_path)
    tasks = line_tracking.tasks(options)
    assert len(tasks) == len(line_tracking.OFFSETS) * len(line_tracking.VARIANTS)
    rows = [
        {
            "offset_m": t.offset_m,
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


@pytest.mark.long
def test_the_half_turn_takes_three_pushes_in_a_low_room():
    """The planner, which may make fewer, makes three; on 1.4 m two and on 3 m one are enough."""
    scenario = load_scenario("three-push")
    _, robot = scenario.robot()
    _, box = scenario.object()
    start, goal = scenario.objects["box"][1], scenario.goal
    assert goal == pytest.approx([1.65, 0.15, np.pi], abs=1e-6)
    pushes = {}
    for height in (1.2, 3.0):
        room = replace(scenario.environment, size=(5.0, height))
        grid = replace(scenario, environment=room).grid
        plan = PushPlanner(PlannerSettings(), grid, robot, box).solve(start, goal)
        pushes[height] = [s.side for s in plan.segments]
    assert scenario.environment.size == (5.0, 1.2)
    assert len(pushes[1.2]) == 3 and len(pushes[3.0]) == 1
    assert all(a != b for a, b in zip(pushes[1.2], pushes[1.2][1:], strict=False))
    # in one push the object's centre goes along a curve no tighter than is stable, and a half turn
    # of that sweeps at least its radius: more than there is between the box and the wall
    limit = PlannerSettings().friction_trust * push_sides(robot, box, 1.0)[0].nominal.maximum
    assert 1.0 / limit > 0.6 - 0.045


def test_a_scenario_without_a_goal_is_refused(tmp_path, capsys):
    from planar_push.main import main

    words = ["experiment", "three-push", "--scenarios", "line", "--out", str(tmp_path / "o")]
    assert main(words) == 2
    assert "'line' has no goal" in capsys.readouterr().err
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize("name", ["single-robot", "displaced", "three-push", "changing-world"])
def test_a_scenario_with_several_goals_is_refused(tmp_path, name):
    """A trial is one job; the further goals would not be used."""
    text = (SCENARIOS / "short.yaml").read_text()
    file = tmp_path / "two.yaml"
    file.write_text(text.replace("goal: [0.1, 0.04, 0.1]", "goals: [[0.1, 0, 0], [0.3, 0, 0]]"))
    with pytest.raises(SettingsError, match="2 goals; this study takes one"):
        experiment(name).tasks(StudyOptions((str(file),), 1, 1, tmp_path))


def test_uncertainty_is_part_of_what_a_study_is(tmp_path):
    mark = {"experiment": "three-push", "seed": 1, "uncertainty": "hard"}
    (tmp_path / "study.json").write_text(json.dumps(mark))
    with pytest.raises(FileExistsError, match="uncertainty is 'hard', this one's is 'mild'"):
        run_study("three-push", StudyOptions(("three-push",), 1, 1, tmp_path))


@pytest.mark.long
def test_a_box_that_is_moved_in_mid_push_comes_to_its_goal_all_the_same(tmp_path, capsys):
    options = StudyOptions(("env3-target1",), 1, 4, tmp_path)
    (task,) = displaced.tasks(options)
    row = displaced.trial(task)
    assert row["success"] and row["collisions"] == 0, row
    assert row["displaced_m"] > 0.005 and row["position_error_m"] < 0.01
    displaced.conclude(options, [task], [row])
    assert "1 of 1 within 10 mm" in capsys.readouterr().out


@pytest.mark.long
@pytest.mark.parametrize("kind", changing_world.KINDS)
def test_a_world_that_changes_in_mid_push_costs_a_new_plan_and_no_collision(tmp_path, capsys, kind):
    options = StudyOptions(("env1-target1",), 1, 1, tmp_path)
    (task,) = (t for t in changing_world.tasks(options) if t.kind == kind)
    row = changing_world.trial(task)
    assert row["success"] and row["collisions"] == 0, row
    assert row["replans"] == (kind == "body") and row["position_error_m"] < 0.005
    changing_world.conclude(options, [task], [row])
    assert f"{kind}: 1 of 1 at the goal" in capsys.readouterr().out


def test_disturbances_fill_their_ranges_where_the_robot_lets_them():
    """300 draws for a box at the bumper: none of them leads into the robot."""
    scenario = load_scenario("env1-target1")
    robot, box = scenario.robots["epuck1"][0], scenario.objects["box"][0]
    poses = {"epuck1": np.zeros(3), "box": np.array([robot.push_distance + 0.045, 0.0, 0.0])}
    hand = displaced.Hand(scenario, 1)
    by = np.array([hand.draw(poses) for _ in range(300)])
    far, front = np.hypot(*by[:, :2].T), robot.push_distance
    assert far.max() <= displaced.FAR and far.max() > 0.039
    assert by[:, 2].max() > 0.115 and by[:, 2].min() < -0.115
    for dx, dy, turn in by:
        outline = se2.transform(poses["box"] + [dx, dy, turn], box.outline)
        beside = np.abs(outline[:, 1]) > robot.flat_bumper.width / 2
        assert (beside | (outline[:, 0] > front - 2e-3)).all()
    other = displaced.Hand(load_scenario("env1-target2"), 1)
    assert other.draw(poses) != tuple(by[0])


@pytest.mark.long
def test_goals_in_a_row_are_reached_without_a_reset(tmp_path, capsys):
    (task,) = goals_in_a_row.tasks(StudyOptions(("env3-target1",), 1, 2, tmp_path))
    assert task.goals == 56
    row = goals_in_a_row.trial(replace(task, goals=2))
    assert row["success"] and row["missed"] == 0, row["reason"]
    goals_in_a_row.conclude(StudyOptions(("env3-target1",), 1, 2, tmp_path), [task], [row])
    assert "0 of 2 goals missed" in capsys.readouterr().out
    scenario = load_scenario("env3-target1")
    goals = np.array(goals_in_a_row.draw_goals(scenario, 100, 3))
    # A robot and its stand-off fit behind the box, wherever its side looks to.
    assert np.abs(goals[:, 0]).max() < 1.5 - 0.14 and np.abs(goals[:, 1]).max() < 1.0 - 0.14
    assert np.ptp(goals[:, 0]) > 2.3 and np.ptp(goals[:, 1]) > 1.3


@pytest.mark.study
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_constraint_decides_whether_three_pushes_are_enough(tmp_path, capsys, seed):
    """With our gains. With (2.53) the object stays where it is at the bumper; without it slides."""
    rows, tasks = {}, []
    for variant in ("(2.53), our gains", "none, our gains"):
        task = three_push.ThreePushTask("three-push", seed, str(tmp_path), variant)
        rows[variant] = three_push.trial(task)
        tasks.append(task)
    held, lost = rows.values()
    assert held["success"]
    assert (held["offset_m"], lost["offset_m"]) == pytest.approx((0.06, 0.06))
    assert held["pushes"] == 3 and held["replans"] == held["contact_losses"] == 0, held
    assert held["position_error_m"] < 0.04 and held["orientation_error_rad"] < np.deg2rad(1.8)
    assert held["slid_m"] < 0.005, held
    assert lost["slid_m"] > 0.015 and lost["pushes"] > 3 and lost["replans"] > 0, lost
    three_push.conclude(StudyOptions(("three-push",), 1, seed, tmp_path), tasks, [held, lost])
    assert (tmp_path / "three-push.png").stat().st_size > 5000
    assert "1/1" in capsys.readouterr().out


def test_what_slides_along_the_bumper_is_measured_in_pushes_only():
    """An object that is driven round slides nowhere; one that moves aside while it moves does."""
    along = np.linspace(0.0, 0.5, 60)
    robot = np.column_stack([along, 0 * along, 0 * along])
    pushed = robot + [0.1, 0.0, 0.0]
    assert three_push.slid(robot, pushed) < 1e-12
    sliding = pushed + np.column_stack([0 * along, 0.04 * along, 0 * along])
    assert three_push.slid(robot, sliding) == pytest.approx(0.02, abs=1e-3)
    standing = np.repeat(pushed[:1], 60, axis=0)  # the robot drives, the object does not
    assert three_push.slid(robot, standing) == 0.0


@pytest.mark.long
def test_an_object_beside_a_wall_is_turned_and_brought_to_its_goal(tmp_path):
    options = StudyOptions(beside_walls.SCENARIOS, 1, 1, tmp_path)
    (task,) = beside_walls.tasks(options)
    scenario, drawn = beside_walls.drawn_scenario(task)
    again, _ = beside_walls.drawn_scenario(task)
    assert scenario.text == again.text and drawn >= 1
    scene = PushScene(
        DistanceField(scenario.grid),
        scenario.robot()[1],
        scenario.object()[1],
        PlannerSettings(),
    )
    assert scene.object_clearance(next(iter(scenario.objects.values()))[1]) < beside_walls.CLOSE
    row = beside_walls.trial(task)
    assert row["success"], row
    assert row["collisions"] == 0 and row["replans"] >= 1
    total = beside_walls.statistics([row])
    assert total == {"starts_beside_walls": drawn, "without_direct_plan": 1, "reached": 1}
