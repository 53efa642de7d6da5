"""An object that stands nearer to a wall than pushes come is pushed away from it."""

import numpy as np
import pytest

from push_model import se2
from push_model.occupancy import rasterise
from push_model.specs import BoxSpec, EnvironmentSpec
from push_planner import (
    DistanceField,
    PlanError,
    PlannerSettings,
    PlanningFailed,
    PushPlanner,
)
from push_planner.preemptive import preemptive_pushes
from tests.push_planner.exact_geometry import body_distance, placed

WORLD = EnvironmentSpec(size=(3.0, 2.0), boxes=(BoxSpec((0.0, 0.0), (0.9, 0.2), 0.3),))
GOAL = np.array([1.1, 0.6, 0.5])
FEW = {"rrt_iterations": 300, "improvement_rounds": 2, "improvement_expansions": 200}


def starts(planner, count, seed):
    """Poses with 0.5 to 10 mm to the nearest obstacle, anywhere."""
    random = np.random.default_rng(seed)
    while count:
        pose = random.uniform([-1.45, -0.95, -np.pi], [1.45, 0.95, np.pi])
        if 5e-4 < planner.scene.object_clearance(planner.scene.item.mass_pose(pose)) < 0.01:
            count -= 1
            yield pose


def exact(planner, segment):
    """Way [m] and exact clearance [m] of object and robot along a push."""
    robots = segment.trajectory.pose
    items = np.array([se2.compose(p, segment.grasp) for p in robots])
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(robots[:, :2], axis=0).T))])
    item = body_distance(WORLD, placed(items, planner.scene.shape.outline))
    return way, item, body_distance(WORLD, placed(robots, planner.scene.robot.outline))


@pytest.mark.long
def test_it_keeps_what_it_has_and_then_the_safety_distance(robot, box):
    """60 starts: every push that a plan begins with, and every pre-emptive one."""
    settings = PlannerSettings(**FEW)
    planner = PushPlanner(settings, DistanceField(rasterise(WORLD)), robot, box)
    pushes, reasons = [], []
    for number, start in enumerate(starts(planner, 60, 3)):
        had = body_distance(WORLD, placed(start[None], planner.scene.shape.outline))[0]
        found = preemptive_pushes(planner, start, GOAL, number + 1)
        if number < 25:
            try:
                plan = planner.solve(start, GOAL)
                found = [*found, plan.segments[0]]
                assert plan.clearance > 0.0
                for later in plan.segments[1:]:
                    assert min(map(np.min, exact(planner, later)[1:])) > 0.012 - 1e-3
            except PlanningFailed as error:
                reasons.append(error.code)
        pushes += [(had, push) for push in found]
    assert len(pushes) > 40 and 0 < len(reasons) < 25, (len(pushes), len(reasons))
    assert set(reasons) == {PlanError.NO_PUSH_SEQUENCE}
    closest = np.inf
    for had, push in pushes:
        way, item, body = exact(planner, push)
        assert item.min() > max(0.0, had - 2.5e-3)
        assert body.min() > 0.003 - 1e-3  # the robot keeps 3 mm, whatever the object has
        late = way > 0.16
        if late.any():
            assert min(item[late].min(), body[late].min()) > 0.012 - 1e-3
        closest = min(closest, item.min())
    assert closest < 0.008  # the rule was pressed on


def test_the_goal_keeps_the_safety_distance_all_the_same(robot, box):
    planner = PushPlanner(PlannerSettings(**FEW), rasterise(WORLD), robot, box)
    with pytest.raises(PlanningFailed, match=r"pushed into the goal .* pushes keep 12.0 mm"):
        planner.solve(GOAL, np.array([1.5 - 0.05, 0.6, 0.0]))
