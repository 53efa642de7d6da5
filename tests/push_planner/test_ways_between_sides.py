"""Plans are such that the robot can go from side to side between the pushes."""

import numpy as np
import pytest

from push_model import se2
from push_model.occupancy import rasterise
from push_model.specs import BoxSpec, EnvironmentSpec
from push_planner import PlanError, PlannerSettings, PlanningFailed, PushPlanner
from push_planner.bodies import with_bodies
from push_planner.robot_path import has_way
from push_scenario.scenario import load_scenario
from tests.samples import mostly_long

SETTINGS = PlannerSettings(arc_nodes=2000)
CORRIDOR = EnvironmentSpec((3.0, 0.22))
WIDE = EnvironmentSpec((3.0, 1.0))


def solved(planner, start, goal, robot):
    best = None
    for progress in planner.plan(start, goal, robot=robot):
        best = progress.best
    return best


def refused_changes(planner, plan, robot):
    """Side changes of a plan for which the robot has no way; its first side included."""
    scene, refused = planner.scene, 0
    for segment in plan.segments:
        outline = se2.transform(segment.object_start, scene.item.outline)
        if robot is not None:
            refused += not has_way(
                scene.field, scene.robot, SETTINGS, robot, segment.standoff, outline
            )
        back = np.array([-SETTINGS.standoff, 0.0, 0.0])
        robot = se2.compose(segment.robot_end, back)
    return refused


def refused_where_pushes_end_elsewhere(planner, plan, random):
    """Of 20 ends of each push, 1 mm and 4 mrad (rms) beside the planned one: without a way on."""
    field, robot, item = planner.scene.field, planner.scene.robot, planner.scene.item
    back, refused = np.array([-SETTINGS.standoff, 0.0, 0.0]), 0
    for before, after in zip(plan.segments[:-1], plan.segments[1:], strict=True):
        for stray in random.normal(0.0, [1e-3, 1e-3, 4e-3], (20, 3)):
            pose = se2.compose(after.object_start, stray)
            start, goal = (
                se2.compose(se2.compose(pose, se2.inverse(push.grasp)), back)
                for push in (before, after)
            )
            outline = se2.transform(pose, item.outline)
            refused += not has_way(field, robot, SETTINGS, start, goal, outline)
    return refused


def beside_a_body(scenario, angle, apart):
    """The planner, the start and the robot's pose, with a body in front of the box of an e-puck."""
    robot, box = scenario.robot()[1], scenario.object()[1]
    start = np.array([0.026, 0.065, 0.715])
    body = start[:2] + apart * np.array([np.cos(angle), np.sin(angle)])
    circles = np.array([[*body, 0.04]])
    grid = with_bodies(scenario.grid, circles, box.outline, start, SETTINGS.safety_distance)
    here = se2.compose(start, np.array([-0.19, 0.0, 0.0]))
    return PushPlanner(SETTINGS, grid, robot, box), start, here


@pytest.mark.parametrize("goal", [[0.6, 0.0, 0.0], [-0.6, 0.0, 0.0]])
def test_a_robot_that_cannot_pass_the_object_does_not_plan_to_push_it_back(robot, box, goal):
    """The robot is to the left of the box, in a corridor in which it cannot pass it."""
    here, start = np.array([-0.4, 0.0, 0.0]), np.zeros(3)
    planner = PushPlanner(SETTINGS, rasterise(CORRIDOR), robot, box)
    assert len(solved(planner, start, np.array(goal), None).segments) >= 1, "wherever it may be"
    if goal[0] > 0.0:
        assert len(solved(planner, start, np.array(goal), here).segments) == 1
    else:
        with pytest.raises(PlanningFailed) as refusal:
            solved(planner, start, np.array(goal), here)
        assert refusal.value.code is PlanError.NO_PUSH_SEQUENCE
        assert "the robot has no way to " in str(refusal.value)
    wide = PushPlanner(SETTINGS, rasterise(WIDE), robot, box)
    plan = solved(wide, start, np.array(goal), here)
    assert refused_changes(wide, plan, here) == 0


@pytest.mark.long
def test_plans_beside_a_body_never_ask_for_a_way_that_the_robot_does_not_have(monkeypatch):
    """A body stands in front of the box; unchecked, some plans need a way that is blocked."""
    scenario = load_scenario("env1-target1")
    random = np.random.default_rng(3)
    blind = solvable = 0
    for number in range(8):
        planner, start, here = beside_a_body(
            scenario, random.uniform(-3.1, -2.2), random.uniform(0.15, 0.21)
        )
        with monkeypatch.context() as patch:
            for module in ("push_graph", "drive_risk"):
                patch.setattr(f"push_planner.{module}.has_way", lambda *_, **__: True)
            plan = solved(planner, start, np.array(scenario.goal), here)
        blind += refused_changes(planner, plan, here) > 0
        try:
            plan = solved(planner, start, np.array(scenario.goal), here)
        except PlanningFailed:
            continue
        solvable += 1
        assert refused_changes(planner, plan, here) == 0, number
    print(f"{blind} of 8 without a way where nobody looks; {solvable} with plans where one does")
    assert blind >= 3 and solvable >= 6


@pytest.mark.parametrize(("angle", "apart"), mostly_long([(-2.895, 0.2037), (-2.491, 0.1537)], 1))
def test_a_way_is_still_free_if_a_push_ends_a_little_elsewhere(angle, apart):
    """The cheapest plans lead through passages that are wide enough to the millimetre."""
    scenario = load_scenario("env1-target1")
    planner, start, here = beside_a_body(scenario, angle, apart)
    plan = solved(planner, start, np.array(scenario.goal), here)
    assert len(plan.segments) > 1
    assert refused_where_pushes_end_elsewhere(planner, plan, np.random.default_rng(6)) == 0


def test_a_robot_that_is_shut_off_is_told_so_at_once(robot, box):
    """A wall stands between the robot and the box."""
    room = EnvironmentSpec((3.0, 1.0), boxes=(BoxSpec((-0.3, 0.0), (0.05, 1.0)),))
    planner = PushPlanner(SETTINGS, rasterise(room), robot, box)
    here, start, goal = np.array([-0.8, 0.0, 0.0]), np.array([0.5, 0, 0]), np.array([1.0, 0, 0])
    with pytest.raises(PlanningFailed, match="has no way to any side of the object"):
        next(planner.plan(start, goal, robot=here))
    assert len(solved(planner, start, goal, np.array([0.2, 0.3, 0.0])).segments) == 1
