"""Objects that are not convex, or long, pushed through the whole graph in lockstep."""

import numpy as np
import pytest

from push_model.pushable_sides import pushable_sides
from push_scenario.scenario import scenario_from_mapping
from push_study.graph_run import LockstepRun
from push_study.observer import final_errors
from tests.outlines import SLIM, L, T, U, item_of, values_of


def scenario(outline, start, goal):
    values = {
        "environment": {"size": [3.0, 2.4]},
        "robots": {"epuck1": {"type": "epuck", "start": [-1.2, 0.0, 0.0]}},
        "objects": {"thing": {"type": values_of(outline), "start": start}},
        "goal": goal,
    }
    return scenario_from_mapping(values, "concave", "test")


def drawn(seed):
    """Start and goal."""
    random = np.random.default_rng(seed)
    start = random.uniform([-0.5, -0.5, -3.1], [-0.1, 0.5, 3.1]).tolist()
    return start, [start[0] + random.uniform(0.2, 0.7), *random.uniform([-0.5, -3.1], [0.5, 3.1])]


@pytest.mark.long
@pytest.mark.parametrize(("outline", "seed"), [(L, 9), (T, 2), (SLIM, 4)], ids=["L", "T", "slim"])
def test_they_reach_their_goals(outline, seed):
    assert len(set(reach(outline, *drawn(seed)))) >= 2  # the robot went round it to another side


@pytest.mark.long
def test_pushes_on_the_floor_of_a_recess_and_out_of_it_in_between(robot):
    (recess,) = (s.index for s in pushable_sides(item_of(U).geometry, robot) if s.depth > 0.0)
    sides = reach(U, *drawn(2))
    assert recess in sides[:-1] and set(sides) != {recess}


def reach(outline, start, goal):
    """Bring it there, without an accident; the sides that were pushed."""
    with LockstepRun(scenario(outline, start, goal), quiet=True) as run:
        run.start()
        (result,) = run.reach_all().values()
        trace = run.observer.trace
    assert result.success, result
    position, orientation = final_errors(trace, np.array(goal))
    assert position < 3e-3 and orientation < 0.01
    assert trace.collisions == 0 and trace.contact_losses == 0
    assert trace.pushes == len(trace.sides)
    return trace.sides
