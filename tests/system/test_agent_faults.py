"""What robots survive that decide for themselves: rows of the table of faults."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import TwistStamped
from std_msgs.msg import Header

from push_model.jobs import JobError
from push_msgs.msg import JobState, SwarmAgentState, SwarmTarget
from push_ros.qos import CHATTER, COMMAND
from tests.system.test_swarm import VALUES, decentralised, running

GOAL = np.array(VALUES["goal"])


def commands(run):
    """Every command to a robot: time [s] and greatest speed."""
    told = []

    def take(message):
        when = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        told.append((when, max(abs(message.twist.linear.x), abs(message.twist.angular.z))))

    for name in run.scenario.robots:
        run.observer.create_subscription(TwistStamped, f"/{name}/cmd_vel", take, COMMAND)
    return told


def pushing(run):
    assert run.spin_until(lambda: run.observer.state.state == JobState.PUSHING, 60.0)
    run.spin_until(lambda: False, 0.5)


def agents(run):
    return [n for n in run.spinner.nodes if n.get_name().startswith("agent_")]


@pytest.mark.long
def test_they_stand_when_nobody_tells_them_a_target_any_more_and_go_on_when_somebody_does():
    """Row 11: the swarm's own node is gone."""
    with running(**decentralised()) as run:
        told = commands(run)
        run.start()
        run.teams[""].send_goal(GOAL)
        pushing(run)
        gone = told[-1][0]
        run.spinner.executor.remove_node(run.supervisor)
        run.spin_until(lambda: False, 3.0)
        since = [speed for when, speed in told if gone + 1.1 < when < gone + 2.9]
        assert len(since) > 5 * 50 and max(since) == 0.0
        run.spinner.executor.add_node(run.supervisor)
        run.spin_until(lambda: False, 2.0)
        assert max(speed for when, speed in told if when > gone + 3.2) > 0.0


@pytest.mark.long
def test_words_and_targets_that_are_none_are_refused():
    """Rows 1 and 21."""
    with running(**decentralised()) as run:
        told = commands(run)
        run.start()
        run.teams[""].send_goal(GOAL)
        words = run.observer.create_publisher(SwarmAgentState, "/swarm_agent_states", CHATTER)
        targets = run.observer.create_publisher(SwarmTarget, "/swarm_target", COMMAND)
        pushing(run)
        for value in (math.nan, math.inf, -1e12):
            header = Header(frame_id="map", stamp=run.supervisor._stamp)
            words.publish(SwarmAgentState(header=header, robot="e1", x=value))
            targets.publish(SwarmTarget(header=header, active=True, x=value))
            run.spin_until(lambda: False, 0.2)
        words.publish(b"\x00\x01\x00\x00" + b"\xff" * 40)  # no message of its type
        run.spin_until(lambda: False, 0.2)
        for agent in agents(run):
            refused = agent._diagnostics.refused
            assert refused["swarm_agent_states"] >= 3 and refused["swarm_target"] >= 2
            assert np.array_equal(agent.agent.job.target, GOAL)
        assert all(math.isfinite(speed) for _, speed in told) and told[-1][1] > 0.0
        run.supervisor.end_job(JobError.CANCELED, "enough")


@pytest.mark.long
def test_a_pose_is_reached_although_words_get_lost_the_object_is_not_seen_and_a_robot_dies():
    """Rows 7 and 14."""
    events = [
        {"kind": "drop_poses", "at": 8.0, "bodies": ["box"], "duration": 3.0},
        {"kind": "kill", "at": 12.0, "robot": "e1"},
    ]
    with running(events=events, **decentralised(lost=0.1)) as run:
        told = commands(run)
        run.start()
        goal = np.array([0.6, 0.2, 0.4])
        state = run.reach(goal, 400.0)
        assert state is not None and state.error_code == 0, state and state.reason
        off = run.observer.trace.object[-1] - goal
        assert np.hypot(*off[:2]) < 0.03 and abs(math.remainder(off[2], 2.0 * math.pi)) < 0.06
        blind = [speed for when, speed in told if 8.4 < when < 10.9]
        assert len(blind) > 5 * 50 and max(blind) == 0.0
