"""What a swarm survives: rows of the table of faults, at default settings."""

import math

import numpy as np
import pytest
from std_srvs.srv import SetBool

from push_model.jobs import JobError
from push_msgs.msg import JobState, Poses
from push_msgs.srv import Reset
from push_ros.qos import STREAM
from tests.system.test_group_faults import commands
from tests.system.test_swarm import VALUES, running

GOAL = np.array(VALUES["goal"])


def error(run):
    off = run.observer.trace.object[-1] - GOAL
    return float(np.hypot(*off[:2])), abs(math.remainder(float(off[2]), 2.0 * math.pi))


def pushing(run):
    assert run.spin_until(lambda: run.observer.state.state == JobState.PUSHING, 120.0)
    run.spin_until(lambda: False, 1.0)


@pytest.fixture
def run():
    with running() as started:
        started.start()
        yield started


@pytest.mark.long
def test_when_the_object_is_not_seen_all_stand_and_go_on_when_it_is():
    """Row 7. Nobody is taken for dead."""
    events = [{"kind": "drop_poses", "at": 12.0, "bodies": ["box"], "duration": 4.0}]
    with running(events=events) as run:
        told = commands(run)
        run.start()
        state = run.reach(GOAL, 300.0)
        assert state is not None and state.error_code == 0, state and state.reason
        blind = [speed for when, speed in told if 12.4 < when < 15.9]
        before = [speed for when, speed in told if 11.0 < when < 12.0]
        assert len(blind) > 300 and max(blind) == 0.0 and min(before) > 0.0
        assert not run.supervisor.method.job.dead


@pytest.mark.long
def test_a_robot_that_is_not_seen_stands_and_the_others_go_on():
    """Rows 7 and 14."""
    events = [{"kind": "drop_poses", "at": 8.0, "bodies": ["e1", "e2"], "duration": 200.0}]
    with running(events=events) as run:
        run.start()
        state = run.reach(GOAL, 300.0)
        assert state is not None and state.error_code == 0, state and state.reason
        assert not {"e1", "e2"} & set(run.supervisor.method.job.taking_part)


@pytest.mark.long
def test_an_object_that_somebody_moves_is_brought_all_the_same():
    """Row 16."""
    events = [{"kind": "displace", "at": 12.0, "body": "box", "by": [0.1, 0.3, 0.4]}]
    with running(events=events) as run:
        run.start()
        state = run.reach(GOAL, 300.0)
        assert state is not None and state.error_code == 0, state and state.reason
        assert error(run)[0] < 0.03


@pytest.mark.long
def test_a_reset_of_the_world_ends_the_job_and_the_next_goal_is_reached(run):
    """Row 12."""
    run.teams[""].send_goal(GOAL)
    pushing(run)
    client = run.observer.create_client(Reset, "/bridge/reset")
    assert run.spinner.until(client.service_is_ready, 5.0)
    answer = client.call_async(Reset.Request())
    assert run.spinner.until(answer.done, 5.0)
    assert run.spin_until(lambda: run.observer.state.state == JobState.IDLE, 5.0)
    assert run.observer.state.error_code == JobError.CLOCK_RESET
    run.observer.trace.object.clear()
    state = run.reach(GOAL, 300.0)
    assert state is not None and state.error_code == 0


@pytest.mark.long
def test_poses_that_are_none_are_refused_and_change_nothing(run):
    """Rows 1 and 23: another source of poses that lies."""
    liar = run.observer.create_publisher(Poses, "/poses", STREAM)
    run.teams[""].send_goal(GOAL)
    pushing(run)
    before = run.supervisor._diagnostics.refused.get("/poses", 0)
    for name in ("box", "e1"):
        for x in (math.nan, math.inf, 1e9):
            message = Poses(names=[name], x=[x], y=[0.0], theta=[0.0])
            message.header.frame_id = "map"
            message.header.stamp = run.supervisor._stamp
            liar.publish(message)
            run.spin_until(
                lambda: False, 0.1
            )  # a burst would displace the frame that is waited for
    run.spin_until(lambda: run.supervisor._diagnostics.refused.get("/poses", 0) > before, 2.0)
    assert run.supervisor._diagnostics.refused.get("/poses", 0) > before
    assert run.spin_until(lambda: run.observer.state.state == JobState.IDLE, 300.0)
    assert run.observer.state.error_code == 0 and error(run)[0] < 0.03


@pytest.mark.long
def test_the_world_stands_still_for_a_while_and_the_job_goes_on(run):
    """Row 24."""
    client = run.observer.create_client(SetBool, "/bridge/pause")
    assert run.spinner.until(client.service_is_ready, 5.0)
    run.teams[""].send_goal(GOAL)
    pushing(run)
    for data in (True, False):
        answer = client.call_async(SetBool.Request(data=data))
        assert run.spinner.until(answer.done, 5.0)
        run.spinner.until(lambda: False, 1.5)
    assert run.spin_until(lambda: run.observer.state.state == JobState.IDLE, 300.0)
    assert run.observer.state.error_code == 0


def test_a_flood_of_goals_ends_with_the_last_one_and_a_cancel_ends_it(run):
    """Row 28: the one that is pursued restarts nothing."""
    told = commands(run)
    goals = [np.array([0.02 * k, 0.3, -1.2]) for k in range(20)]
    for goal in (*goals, goals[-1], goals[-1]):
        run.observer.send_goal(goal)
    pushing(run)
    job, target = run.observer.state.job, run.supervisor.method.job.target
    assert target == pytest.approx(goals[-1])
    run.observer.send_goal(goals[-1])
    run.spin_until(lambda: False, 0.5)
    assert run.observer.state.job == job and run.supervisor.busy
    run.supervisor.end_job(JobError.CANCELED, "canceled")
    run.spin_until(lambda: False, 0.3)
    assert max(speed for _, speed in told[-5:]) == 0.0
