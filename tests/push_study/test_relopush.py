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


@needs_program
def test_only_published_instances_are_planned(tmp_path):
    tasks = relopush.tasks(StudyOptions(("8-relopush",), 100, 0, tmp_path))
    assert len(tasks) == 100
    with pytest.raises(SettingsError, match="trial 100 is none of them"):
        relopush.tasks(StudyOptions(("8-relopush",), 1, 100, tmp_path))


@needs_program
def test_instances_are_the_scenes_with_noise():
    for boxes in FILES:
        nominal = SCENES[f"relopush-{boxes}"]
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
@pytest.mark.parametrize("count", slice_and_study([40, 300], 1))
def test_the_reconstruction_plans_for_one_box_as_the_program_does(count):
    """Other plans are shorter: the program drops those whose box its car cannot drive to."""
    equal, ours, theirs = 0, [], []
    for index in range(count):
        line = instance("1", index)
        told, plans = plan(line), plan_alone(line)
        assert bool(told.parts) == bool(plans)
        ours.append(plans[0].length)
        theirs.append(sum(part.way for part in told.parts))
        assert ours[-1] <= theirs[-1] + 1e-3
        equal += theirs[-1] - ours[-1] <= 1e-3
    assert equal >= 0.9 * count


@needs_program
def test_trials_of_all_methods(tmp_path):
    names = (*relopush.SCENARIOS, "2-dubinsonly", "2-mponly")
    rows = [relopush.trial(Episode(name, 4)) for name in names]
    assert all(row["success"] or "finds no plan" in row["reason"] for row in rows)
    found = relopush.statistics(rows)
    assert found["wilson_1-dubins"][1] == 1.0 and "way_less_than_relopush_1" in found
    mine = next(row for row in rows if row["scenario"] == "3-rearrange")
    cpu = {row["scenario"]: row["cpu_s"] for row in rows}
    assert cpu["2-dubinsonly"] > 3.0 * cpu["2-relopush"]  # 25 times, as measured
    assert mine["pushes"] >= 3 and mine["way_m"] > 5.0 and mine["cpu_s"] > 0.0
