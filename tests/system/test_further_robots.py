"""Robots that the scenario of a swarm does not name: obstacles until the swarm is told of them."""

import numpy as np
import pytest
from rclpy.parameter import Parameter

from push_msgs.msg import JobState, Velocities
from push_ros.qos import COMMAND
from push_scenario.scenario import scenario_from_mapping
from push_study.graph_run import LockstepRun
from tests.system import test_group
from tests.system.test_swarm import VALUES

GOAL = np.array(VALUES["goal"])
NEW = {
    "x1": {"type": "epuck_ring", "start": [-0.6, -1.2, 0.0]},
    "x2": {"type": "epuck_ring", "start": [-0.9, -1.2, 0.0]},
    "pillar": {"type": "epuck_ring", "start": [1.6, 1.2, 0.0]},
}


def running(values=VALUES, system="swarm", count=None, **swarm):
    """A world with three robots more than the nodes know of."""
    robots = dict(values["robots"])
    if count is not None:
        robots = {"e": {**robots["e"], "count": count}}
    parameters = {**values["parameters"], system: swarm}
    own = scenario_from_mapping({**values, "robots": robots, "parameters": parameters}, "a", "a")
    world = scenario_from_mapping(
        {**values, "robots": {**robots, **NEW}, "parameters": parameters}, "b", "b"
    )
    return LockstepRun(own, world=world, system=system, quiet=True)


def named(run):
    """Names in the last message to the robots, and all that were told to move."""
    told, moved = [()], set()

    def take(message):
        told.append(tuple(message.names))
        speeds = zip(message.names, message.vx, message.omega, strict=True)
        moved.update(n for n, v, w in speeds if v or w)

    run.observer.create_subscription(Velocities, "/cmd_vels", take, COMMAND)
    return told, moved


def tell(run, *patterns):
    (result,) = run.supervisor.set_parameters([Parameter("roster.further", value=list(patterns))])
    return result


def start(run):
    run.start()
    assert run.spin_until(lambda: run.supervisor.seen is not None, 5.0)
    run.spin_until(lambda: False, 0.2)


@pytest.mark.long
def test_bodies_that_nobody_named_are_obstacles_and_are_not_commanded():
    with running() as run:
        start(run)
        told, moved = named(run)
        places = {tuple(np.round(o[:2], 1)) for o in run.supervisor.seen.obstacles}
        assert places == {(-0.6, -1.2), (-0.9, -1.2), (1.6, 1.2)}
        state = run.reach(GOAL)
        assert state is not None and state.error_code == 0, state and state.reason
        assert not set(NEW) & {*moved, *told[-1], *state.robots}


@pytest.mark.long
def test_robots_join_when_they_are_told_of_take_part_and_are_released():
    """One robot of the scenario cannot turn the object to a heading: that takes two."""
    with running(count=1) as run:
        start(run)
        told, moved = named(run)
        run.teams[""].send_goal(GOAL)
        assert run.spin_until(lambda: run.teams[""].refused, 5.0)
        assert "at least 2 robots" in run.observer.state.refusal
        assert tell(run, "x*").successful
        run.spin_until(lambda: False, 0.2)
        assert set(told[-1]) == {"e1", "x1", "x2"} and len(run.supervisor.seen.obstacles) == 1
        run.teams[""].send_goal(GOAL)
        assert run.spin_until(lambda: run.observer.state.state == JobState.PUSHING, 200.0)
        assert set(run.observer.state.robots) == {"e1", "x1", "x2"}
        assert {"x1", "x2"} <= moved and "pillar" not in moved
        assert tell(run, "x1").successful  # x2 is released, in the middle of the push
        run.spin_until(lambda: False, 0.5)
        assert set(told[-1]) == {"e1", "x1"} and not run.bridge.driving("x2")
        assert len(run.supervisor.seen.obstacles) == 2
        before = run.bridge.world.poses()["x1"]
        run.spin_until(lambda: False, 3.0)
        assert np.hypot(*(run.bridge.world.poses()["x1"] - before)[:2]) > 1e-3
        assert tell(run, "x*").successful
        assert run.spin_until(lambda: run.observer.state.state == JobState.IDLE, 400.0)
        assert run.observer.state.error_code == 0, run.observer.state.reason
        off = run.observer.trace.object[-1] - GOAL
        assert np.hypot(*off[:2]) < 0.03


def test_the_scenario_may_tell_so_from_the_beginning():
    with running(roster={"further": ["x*"]}) as run:
        start(run)
        told, _ = named(run)
        run.spin_until(lambda: False, 0.2)
        assert {"x1", "x2"} <= set(told[-1]) and "pillar" not in told[-1]


def test_a_group_takes_nobody_in_and_says_so():
    values = {**test_group.VALUES}
    with running(values, "group") as run:
        start(run)
        result = tell(run, "x*")
        assert not result.successful and "takes no further robots" in result.reason
        assert len(run.supervisor.seen.obstacles) == 3
