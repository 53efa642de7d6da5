"""Plans for a robot that pushes already: to go on on its side takes no change of the side."""

import numpy as np
import pytest

from benchmarks.plan import problems
from push_model.occupancy import rasterise
from push_model.specs import BoxSpec, EnvironmentSpec
from push_planner import PlannerSettings, PlanningFailed, PushPlanner

COUNT = 8


@pytest.fixture(scope="module")
def planner(robot, box):
    return PushPlanner(PlannerSettings(), rasterise(EnvironmentSpec((3.0, 2.0))), robot, box)


def last(progress):
    best = None
    for step in progress:
        best = step.best
    return best


@pytest.fixture(scope="module")
def plans(planner):
    """Of random problems: the side, the plan that knows of it, and the one that does not."""
    random, found = np.random.default_rng(3), []
    for start, goal in problems(planner, COUNT, 12):
        side = int(random.integers(4))
        try:
            known = last(planner.plan(start, goal, on_side=side))
            found.append((side, known, planner.solve(start, goal)))
        except PlanningFailed:
            pass
    assert len(found) >= COUNT - 2
    return found


@pytest.mark.long
def test_costs_count_the_first_change_of_the_side(planner, plans):
    time = planner.scene.time
    for side, known, _ in plans:
        first = known.segments[0].side
        expected = 0.0 if first == side else time.changes[side, first] + time.begin
        assert time.first_change(side, first) == pytest.approx(expected)
        assert known.cost == pytest.approx(time.of_plan(known.segments) + expected)
        assert 0.0 < known.cost_bound <= known.cost
    assert time.first_change(None, 0) == time.first_change(99, 0) == 0.0


@pytest.mark.long
def test_plans_that_know_of_the_side_go_on_on_it_more_often_and_cost_less(planner, plans):
    time = planner.scene.time
    costs = np.array([(k.cost, time.of_plan(p.segments, on_side=s)) for s, k, p in plans])
    assert costs[:, 0].mean() < 0.98 * costs[:, 1].mean()
    assert (costs[:, 0] > 1.1 * costs[:, 1]).sum() <= 1
    on_it = [(k.segments[0].side == s, p.segments[0].side == s) for s, k, p in plans]
    assert np.sum(on_it, axis=0)[0] > np.sum(on_it, axis=0)[1]


def test_the_side_that_the_robot_is_on_needs_no_way_to_it(robot, box):
    """The pose from which the robot would have to come is walled in."""
    pocket = BoxSpec((-0.9, -0.7), (0.04, 0.64)), BoxSpec((-1.2, -0.4), (0.64, 0.04))
    room = rasterise(EnvironmentSpec((3.0, 2.0), boxes=pocket))
    planner = PushPlanner(PlannerSettings(), room, robot, box)
    start, goal = np.array([-0.6, 0.3, 0.0]), np.array([0.6, 0.3, 0.0])
    inside = np.array([-1.2, -0.7, 0.0])
    with pytest.raises(PlanningFailed):
        last(planner.plan(start, goal, robot=inside))
    plan = last(planner.plan(start, goal, robot=inside, on_side=0))
    assert plan.segments[0].side == 0
