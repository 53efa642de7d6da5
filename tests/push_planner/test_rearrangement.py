"""The order in which one robot pushes several objects: every move has a plan among the others."""

import math

import numpy as np
import pytest

from push_model.distance_field import DistanceField
from push_model.occupancy import rasterise
from push_model.settings import SettingsError
from push_model.specs import BoxSpec, EnvironmentSpec
from push_planner import PlannerSettings
from push_planner.among_bodies import planner_among
from push_planner.push_plan import PlanError, PlanningFailed
from push_planner.rearrangement import Rearrangement, RearrangementSettings
from push_scenario.scenario import load_scenario
from push_study.relopush.scenes import SCENES, scenario_of
from tests.samples import slice_and_study


def rearrangement(scenario, **values):
    return Rearrangement(
        RearrangementSettings(**values),
        PlannerSettings(),
        DistanceField(scenario.grid),
        scenario.robot()[1],
        {n: spec for n, (spec, _) in scenario.objects.items()},
    )


def solve(scenario, **values):
    search = rearrangement(scenario, **values)
    poses = {n: start for n, (_, start) in scenario.objects.items()}
    robot = scenario.robots[scenario.robot()[0]][1]
    return search, search.solve(poses, scenario.arrangement, robot)


def check(scenario, moves):
    """The moves, one after another, from the starts to the goals; each is free of the others."""
    poses = {n: start for n, (_, start) in scenario.objects.items()}
    radii = {n: spec.geometry.circumradius for n, (spec, _) in scenario.objects.items()}
    for move in moves:
        np.testing.assert_array_equal(move.start, poses[move.object])
        poses[move.object] = move.goal
        for name, pose in poses.items():
            if name != move.object:
                apart = np.hypot(*(pose - move.goal)[:2])
                assert apart >= radii[name] + radii[move.object] - 1e-12
        assert move.aside == (not np.array_equal(move.goal, scenario.arrangement[move.object]))
    for name, goal in scenario.arrangement.items():
        np.testing.assert_array_equal(poses[name], goal)


@pytest.mark.parametrize("name", SCENES)
def test_the_scenes_of_relopush_are_solved(name):
    scenario = scenario_of(name, 1)
    _, moves = solve(scenario)
    check(scenario, moves)
    aside = sum(move.aside for move in moves)
    assert len(moves) == len(scenario.arrangement) + aside
    assert (aside > 0) == (name == "relopush-6")  # the one in which two boxes change places


@pytest.mark.parametrize("count", slice_and_study([8, 30], 1))
@pytest.mark.parametrize("name", [*SCENES, "random-4", "random-8", "shuffle-2", "shuffle-4"])
def test_hundreds_of_scenes_are_solved(name, count):
    solved = 0
    for seed in range(200, 200 + count):
        scenario = scenario_of(name, seed)
        try:
            _, moves = solve(scenario)
        except PlanningFailed:
            continue
        check(scenario, moves)
        solved += 1
    assert solved == count


@pytest.mark.long
def test_every_move_has_a_plan_of_its_own():
    """Planned anew with the others as obstacles, each move has one."""
    scenario = load_scenario("rearrange")
    search, moves = solve(scenario)
    check(scenario, moves)
    assert [m.aside for m in moves].count(True) == 1
    poses = {n: start for n, (_, start) in scenario.objects.items()}
    for move in moves:
        others = [[*p[:2], search._reach[n]] for n, p in poses.items() if n != move.object]
        planner = planner_among(search._planner(move.object), move.start, np.array(others))
        assert planner.solve(move.start, move.goal).segments
        poses[move.object] = move.goal


def test_objects_at_their_goals_stay():
    scenario = load_scenario("rearrange")
    poses = {n: start for n, (_, start) in scenario.objects.items()}
    near = {n: p + [0.005, 0.0, 0.02] for n, p in poses.items()}
    search = rearrangement(scenario)
    assert search.solve(poses, near) == [] and search.plans == 0
    (move,) = search.solve(poses, {**near, "c": poses["c"] + [0.1, 0.0, 0.0]})
    assert move.object == "c"


def test_equal_questions_have_equal_answers():
    scenario = scenario_of("relopush-3", 3)
    first, second = solve(scenario)[1], solve(scenario)[1]
    assert [(m.object, m.goal.tolist(), m.plan.cost) for m in first] == [
        (m.object, m.goal.tolist(), m.plan.cost) for m in second
    ]


def test_an_object_without_a_goal_is_moved_out_of_the_way():
    """It stands in a door of 0.3 m, and the other one has to go through."""
    example = load_scenario("rearrange")
    robot, item = example.robot()[1], example.object()[1]
    walls = tuple(BoxSpec((0.0, y), (0.1, 0.65)) for y in (0.475, -0.475))
    grid = rasterise(EnvironmentSpec((2.4, 1.6), boxes=walls))
    settings = RearrangementSettings(), PlannerSettings(), DistanceField(grid)
    search = Rearrangement(*settings, robot, {"a": item, "b": item})
    poses = {"a": np.array([-0.6, 0.0, 0.0]), "b": np.zeros(3)}
    moves = search.solve(poses, {"a": np.array([0.6, 0.0, 0.0])}, np.array([-1.0, 0.3, 0.0]))
    assert [(m.object, m.aside) for m in moves] == [("b", True), ("a", False)]


@pytest.mark.parametrize(
    ("goals", "code", "words"),
    [
        ({"a": [0.3, 0.3, 0.0], "b": [0.4, 0.3, 0.0]}, PlanError.GOAL_OCCUPIED, "100 mm apart"),
        ({"a": [9.0, 0.0, 0.0]}, PlanError.OUTSIDE_MAP, "goal of 'a'"),
        ({"a": [1.49, 0.0, 0.0]}, PlanError.GOAL_OCCUPIED, "overlap an obstacle"),
        ({"a": [math.nan, 0.0, 0.0]}, PlanError.INVALID_GOAL, "not finite"),
    ],
)
def test_goals_that_cannot_be_are_refused(goals, code, words):
    search = rearrangement(load_scenario("rearrange"))
    with pytest.raises(PlanningFailed, match=words) as refused:
        search.check({n: np.array(p) for n, p in goals.items()})
    assert refused.value.code == code


def test_it_gives_up_and_says_which_objects_are_left():
    scenario = load_scenario("rearrange")
    with pytest.raises(PlanningFailed, match=r"'a', 'b'.*3 planned moves \(max_plans\)"):
        solve(scenario, max_plans=3)
    corner = np.array([-1.46, -0.96, 0.0])  # no robot gets behind a box there
    poses = {n: start for n, (_, start) in scenario.objects.items()} | {"a": corner}
    with pytest.raises(PlanningFailed, match="no order of pushes for 'a': in every order there is"):
        rearrangement(scenario).solve(poses, {"a": np.array([0.0, 0.0, 0.0])})


def test_settings_that_make_no_sense_are_refused():
    with pytest.raises(SettingsError, match="aside"):
        RearrangementSettings(aside=())
    with pytest.raises(SettingsError, match="aside"):
        RearrangementSettings(aside=(0.2, -0.1))
