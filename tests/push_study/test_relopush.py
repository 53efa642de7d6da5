"""The program of the authors of ReloPush, where it is compiled (make relopush), beside ours."""

import math

import numpy as np
import pytest

from planar_push.main import main
from push_model.settings import SettingsError
from push_planner.push_plan import PlanningFailed
from push_study.by_scenario import Episode
from push_study.experiments import relopush
from push_study.relopush.authors import (
    COUNT,
    FILES,
    PROGRAM,
    RADIUS,
    Part,
    instance,
    parsed,
    plan,
    plan_alone,
    program,
)
from push_study.relopush.scenes import SCALE, SCENES, scaled
from push_study.study import StudyOptions
from tests.push_study.test_bench_push import installed
from tests.samples import slice_and_study

needs_program = pytest.mark.skipif(not installed(program), reason="make relopush")
LINE = (
    "mo:b1,1.0,1.5,0,4;b2,1.4,2.3,0,4!robot:2.0,2.5,1.5708"
    "!goal:d1,3.8,2.3,3.0,4;d2,3.4,3.1,0,4!assign:b2,d1;b1,d2"
)


def test_without_the_program_the_study_says_what_to_do(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv(PROGRAM, str(tmp_path / "nowhere"))
    out = tmp_path / "out"
    assert main(["experiment", "relopush", "--trials", "1", "--out", str(out)]) == 2
    assert "make relopush" in " ".join(capsys.readouterr().err.split()) and not out.exists()


def test_an_unknown_scenario_is_refused(tmp_path):
    with pytest.raises(SettingsError, match="no scenario called '7-relopush'"):
        relopush.tasks(StudyOptions(("7-relopush",), 1, 1, tmp_path))


def test_an_instance_becomes_a_scenario_with_each_goal_at_its_box():
    scene = parsed(LINE)
    assert scene.boxes == ((1.0, 1.5), (1.4, 2.3)) and scene.robot == (2.0, 2.5, 1.5708)
    assert scene.goals == ((3.4, 3.1), (3.8, 2.3))
    scenario = scaled(scene, "instance")
    start, goal = (scenario.objects["box2"][1], scenario.arrangement["box2"])
    np.testing.assert_allclose(goal - start, [SCALE * 2.4, 0.0, 0.0], atol=1e-12)


def test_a_failing_search_is_a_row_with_its_reason():
    """The two goals are so near each other that the boxes would overlap."""
    row = relopush._ours(LINE.replace("3.4,3.1", "3.62,2.3"))
    assert not row["success"] and "goals of 'box1' and 'box2'" in row["reason"]
    with pytest.raises(PlanningFailed):
        relopush._searched(*_made(LINE.replace("3.4,3.1", "3.62,2.3")))


def _made(line):
    scenario = scaled(parsed(line), "instance")
    return scenario, relopush.DistanceField(scenario.grid)


def test_ways_of_our_moves_are_at_least_from_start_to_goal():
    for move in relopush._searched(*_made(LINE)):
        assert relopush._way(move) >= np.hypot(*(move.goal - move.start)[:2]) - 1e-6


def test_ways_of_parts():
    """A straight push, in which the car comes nearer, and a half circle."""
    straight = Part("pre", np.array([0.0, 0.0, 0.0]), np.array([0.34, 0.0, 0.0]))
    half = Part("final", np.zeros(3), np.array([0.0, 2.0 * RADIUS, math.pi]))
    drive = Part("app", np.zeros(3), np.ones(3))
    assert straight.way == pytest.approx(0.2) and drive.way == 0.0
    assert half.way == pytest.approx(math.pi * RADIUS)


def test_only_published_instances_are_planned(tmp_path):
    tasks = relopush.tasks(StudyOptions(("8-relopush",), 100, 0, tmp_path))
    assert len(tasks) == 100
    with pytest.raises(SettingsError, match="trial 100 is none of them"):
        relopush.tasks(StudyOptions(("8-relopush",), 1, 100, tmp_path))


@needs_program
def test_instances_are_the_scenes_with_noise():
    for boxes in FILES:
        nominal = SCENES[f"relopush-{boxes}"]
        with pytest.raises(IndexError):
            instance(boxes, COUNT)
        for index in range(0, 100, 9):
            scene = parsed(instance(boxes, index))
            drawn = np.array(scene.boxes + scene.goals)
            assert np.abs(drawn - np.array(nominal.boxes + nominal.goals)).max() <= 0.0506


@needs_program
def test_plans_of_the_program_bring_every_box_to_its_goal():
    """Each kind of push in some of ten instances; equal questions have equal answers."""
    kinds = set()
    for index in range(10):
        line = instance("6", index)
        told, scene = plan(line), parsed(line)
        assert [p.kind for p in plan(line).parts] == [p.kind for p in told.parts]
        if not told.parts:
            continue
        kinds |= {part.kind for part in told.parts}
        ends = np.array([part.end[:2] for part in told.parts if part.kind == "final"])
        for goal in scene.goals:
            assert np.hypot(*(ends - goal).T).min() < 1e-3
    assert kinds == {"app", "pre", "temp", "final"}


@needs_program
@pytest.mark.parametrize("count", slice_and_study([40, 400], 1))
def test_the_reconstruction_plans_for_one_box_as_the_program_does(count):
    """But where two places are equally near: there, the program may take the other one."""
    equal = 0
    for index in range(count):
        line = instance("1", index)
        told, plans = plan(line), plan_alone(line)
        assert bool(told.parts) == bool(plans)
        if abs(plans[0].length - sum(part.way for part in told.parts)) <= 1e-3:
            equal += 1
            continue
        first = next(part for part in told.parts if part.kind == "pre")
        assert first.way == pytest.approx(np.hypot(*np.ptp(plans[0].path[:, :2], axis=0)), abs=1e-3)
    assert equal >= 0.9 * count


@needs_program
def test_a_push_to_a_goal_begins_where_the_relocation_has_left_the_box():
    found = 0
    for index in range(30):
        pushes = [p for p in plan(instance("1", index)).parts if p.kind != "app"]
        if [p.kind for p in pushes] == ["pre", "final"]:
            found += 1
            first, last = pushes
            along = np.array([math.cos(first.start[2]), math.sin(first.start[2])])
            (box,) = parsed(instance("1", index)).boxes
            assert last.start[:2] == pytest.approx(box + first.way * along, abs=1e-3)
    assert found >= 5


@pytest.mark.parametrize(
    ("script", "words"), [("exit 3", "ended with 3"), ("echo no plan", "Expecting value")]
)
def test_a_program_that_crashes_or_tells_nothing_is_an_error(tmp_path, monkeypatch, script, words):
    file = tmp_path / "plan"
    file.write_text(f"#!/bin/sh\n{script}\n")
    file.chmod(0o755)
    monkeypatch.setenv(PROGRAM, str(file))
    with pytest.raises((RuntimeError, ValueError), match=words):
        plan(LINE)


def test_statistics_compare_the_instances_that_both_plan():
    def row(method, seed, way, success=True):
        found = {"scenario": f"5-{method}", "seed": seed, "success": success, "cpu_s": 1.0}
        return found | {"pushes": 5, "aside": 0, "way_m": way}

    rows = [row("relopush", k, 10.0) for k in range(3)] + [row("relopush", 3, 0.0, False)]
    rows += [row("rearrange", k, 9.0 + 0.1 * k) for k in range(3)] + [row("rearrange", 3, 50.0)]
    rows += [row("rearrange", 4, 0.0, False) | {"crashed": True}]
    found = relopush.statistics(rows)
    low, high = found["way_less_than_relopush_5-rearrange"]
    assert low < -0.9 < high and low + high == pytest.approx(-1.8)
    assert found["way_equal_to_relopush_5-rearrange"] == 0
    assert found["wilson_5-relopush"][1] < 1.0


@needs_program
def test_trials_of_all_methods(tmp_path):
    names = (*relopush.SCENARIOS, "2-dubinsonly", "2-mponly")
    rows = [relopush.trial(Episode(name, 4)) for name in names]
    assert all(row["success"] or "finds no plan" in row["reason"] for row in rows)
    found = relopush.statistics(rows)
    assert found["wilson_1-dubins"][1] == 1.0 and found["way_equal_to_relopush_1-dubins"] == 1
    assert "way_m_2-mponly" not in found and found["cpu_s_2-mponly"] is not None
    mine = next(row for row in rows if row["scenario"] == "3-rearrange")
    cpu = {row["scenario"]: row["cpu_s"] for row in rows}
    assert cpu["2-dubinsonly"] > 3.0 * cpu["2-relopush"]  # 25 times, as measured
    assert mine["pushes"] >= 3 and mine["way_m"] > 5.0 and mine["cpu_s"] > 0.0
