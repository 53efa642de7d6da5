"""Where a new plan can begin while the robot pushes, and which answers count."""

from dataclasses import replace

import numpy as np
import pytest

from push_model import se2
from push_model.occupancy import rasterise
from push_model.specs import BoxSpec, EnvironmentSpec
from push_planner import PlannerSettings, PushPlanner
from push_scenario.scenario import load_scenario
from push_supervisor import SupervisorSettings, Surroundings, repair
from push_supervisor.events import PlanFailed, PlanFound, RepairLate

NONE = np.zeros((0, 3))


@pytest.fixture(scope="module")
def pushes():
    """Of a plan, with the room in which it is made."""
    scenario = load_scenario("short")
    robot, item = scenario.robot()[1], scenario.object()[1]
    ((_, start),) = scenario.objects.values()
    planner = PushPlanner(PlannerSettings(), scenario.grid, robot, item)
    return planner.solve(start, np.array([0.5, 0.1, 0.2])).segments


@pytest.fixture
def near():
    scenario = load_scenario("short")
    around = Surroundings(scenario.robot()[1], scenario.object()[1], {}, SupervisorSettings())
    around.take_map(scenario.grid)
    return around


def at(push, share):
    """Pose of the object when a share of the push's time is over."""
    pose, _ = push.trajectory.sample(np.array([share * push.trajectory.duration]))
    return se2.compose(pose[0], push.grasp)


def walled(near, place):
    grid = rasterise(EnvironmentSpec((3.0, 2.0), boxes=(BoxSpec(tuple(place[:2]), (0.06, 0.06)),)))
    near.take_map(grid)


@pytest.mark.parametrize("share", np.linspace(0.05, 0.95, 19))
def test_a_plan_begins_a_second_ahead_or_at_the_end(pushes, near, share):
    push = pushes[0]
    item, whole = at(push, share), push.trajectory.duration
    assert repair.reached(push, item) == pytest.approx(share * whole, abs=0.06)
    begun = repair.beginning(near, push, item, NONE)
    left = (1.0 - share) * whole
    if left < 0.6:
        assert begun is None
    elif left > 0.8:
        assert begun.trajectory.duration == pytest.approx(min(whole, share * whole + 1.0), abs=0.06)
        assert begun.grasp == pytest.approx(push.grasp)
        assert repair.late(begun, item) is None
        assert repair.late(begun, begun.object_end) == RepairLate()


def test_walls_and_bodies_count_on_the_part_that_is_gone_on_with_and_only_there(pushes, near):
    push = pushes[0]
    item, soon, later, before = (at(push, s) for s in (0.3, 0.5, 1.0, 0.02))
    assert repair.beginning(near, push, item, np.array([[*soon[:2], 0.03]])) is None
    assert repair.beginning(near, push, item, np.array([[*later[:2], 0.03]])) is not None
    assert repair.beginning(near, push, item, NONE, goal=before) is None
    assert repair.beginning(near, push, item, NONE, goal=later) is not None
    for place, free in ((soon, False), (later, True), (before, True)):
        walled(near, place)
        assert (repair.beginning(near, push, item, NONE) is not None) is free
    near.settings = replace(near.settings, repair_time=0.0)
    assert repair.beginning(near, push, item, NONE) is None


def test_a_plan_of_the_map_before_is_not_taken(pushes, near):
    """Also where only a later part is blocked; what lies behind the object does not matter."""
    push = pushes[0]
    item, later, before = (at(push, s) for s in (0.4, 0.9, 0.05))
    found, better = PlanFound(tuple(pushes)), PlanFound(tuple(pushes), improving=True)
    failed = PlanFailed(0, "no plan")
    assert repair.checked(found, near, item) is found
    walled(near, later)
    assert isinstance(repair.checked(found, near, item), PlanFailed)
    assert repair.checked(better, near, item) is None
    assert repair.checked(failed, near, item) is failed
    walled(near, before)
    assert repair.checked(better, near, item) is better
