"""Why there is no plan: the reason names the end from which no push leads on."""

import numpy as np
import pytest

from push_model.occupancy import rasterise
from push_model.specs import EnvironmentSpec
from push_planner import PlannerSettings, PlanningFailed, PushPlanner
from push_planner.preemptive import plan_after_preemptive_push
from push_scenario.bodies import load_object, load_robot
from tests.samples import mostly_long

BOX = load_object("box9")
ROOM = EnvironmentSpec(size=(3.0, 2.0))


def empty_room():
    return PushPlanner(
        PlannerSettings(total_expansions=3000), rasterise(ROOM), load_robot("epuck"), BOX
    )


def pose(planner, random, beside):
    """Beside a wall, or away from all of them."""
    while True:
        drawn = random.uniform([-1.5, -1.0, -np.pi], [1.5, 1.0, np.pi])
        clearance = planner.scene.object_clearance(BOX.mass_pose(drawn))
        if clearance > 0.013 and (clearance < 0.06) == beside:
            return drawn


@pytest.mark.parametrize("seed", mostly_long(range(5), 1))
def test_in_an_empty_room_it_is_an_end_beside_a_wall_and_the_reason_names_it(seed):
    """Goals and starts beside walls in turn. The way between them is wide."""
    planner, random, reasons = empty_room(), np.random.default_rng([seed, 5]), []
    for number in range(12):
        ends = [pose(planner, random, beside) for beside in (True, False)]
        at_start = number % 2 == 0
        start, goal = ends if at_start else ends[::-1]
        try:
            next(p for p in planner.plan(start, goal) if p.best is not None)
        except PlanningFailed as error:
            reasons.append((str(error), "the start" if at_start else "the goal", ends[0]))
    assert reasons
    for reason, end, (x, y, theta) in reasons:
        assert end in reason
        assert f"({x:.3f}, {y:.3f}, {theta:.3f})" in reason
        assert "widest way" not in reason


def test_an_object_in_a_corner_is_stuck_and_nothing_is_said_of_a_way():
    planner = empty_room()
    corner = np.array([1.5 - 0.06, 1.0 - 0.06, 0.0])
    with pytest.raises(PlanningFailed, match="no side of the object can be pushed away from"):
        planner.solve(corner, np.zeros(3))
    with pytest.raises(PlanningFailed, match=r"stuck at the start: .* corner turns it; clear"):
        for _ in plan_after_preemptive_push(planner, corner, np.zeros(3), 1):
            pass
