"""What a group survives: rows of the table of faults, at default settings."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from std_srvs.srv import SetBool

import grasp_opt.node
from push_model.jobs import JobError
from push_msgs.msg import JobState, Poses, Velocities
from push_msgs.srv import Reset
from push_ros.qos import COMMAND, STREAM
from tests.system.test_group import VALUES, error, running

FAR = np.array([1.0, 0.4, -1.0])


def commands(run):
    """Every message to the robots: time [s] and greatest speed."""
    told = []

    def take(message):
        when = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        told.append((when, max(abs(v) for v in (*message.vx, *message.omega))))

    run.observer.create_subscription(Velocities, "/cmd_vels", take, COMMAND)
    return told


def pushing(run):
    assert run.spin_until(
        lambda: (
            run.observer.state.state == JobState.PUSHING
            and run.supervisor.method.job.last is not None
            and run.supervisor.method.job.last.time > 2.0
        ),
        120.0,
    )


@pytest.mark.long
def test_when_the_object_is_not_seen_all_stand_and_go_on_when_it_is():
    """Row 7. The trajectory waits, nobody is taken for dead, nothing is planned anew."""
    events = [{"kind": "drop_poses", "at": 24.0, "bodies": ["plate"], "duration": 4.0}]
    with running(events=events) as run:
        told = commands(run)
        run.start()
        state = run.reach(FAR, 500.0)
        assert state is not None and state.error_code == 0, state and state.reason
        assert error(run, FAR)[0] < 5e-3
        blind = [speed for when, speed in told if 24.4 < when < 27.9]
        assert len(blind) > 300 and max(blind) == 0.0
        assert run.supervisor.method.job.dead == () and run.supervisor.method.job.replans == 0


@pytest.mark.parametrize("at", [0.0, pytest.param(24.0, marks=pytest.mark.long)])
def test_when_a_robot_is_never_seen_again_the_job_ends(at):
    """Its place is not known, so nobody may move; before the first push and in mid-push."""
    who = next(iter(VALUES["robots"]))
    events = [{"kind": "drop_poses", "at": at, "bodies": [who], "duration": 100.0}]
    with running(events=events) as run:
        told = commands(run)
        run.start()
        state = run.reach(FAR, 500.0)
        assert state is not None and state.error_code == JobError.POSES_STALE
        assert f"no poses of '{who}'" in state.reason
        blind = [speed for when, speed in told if when > at + 0.5]
        assert len(blind) > 500 and max(blind) == 0.0
        assert run.bridge.time < at + 12.0


@pytest.mark.long
def test_an_object_that_somebody_moves_is_noticed_and_brought_all_the_same():
    """Row 16."""
    events = [{"kind": "displace", "at": 24.0, "body": "plate", "by": [0.12, 0.1, 0.4]}]
    with running(events=events) as run:
        run.start()
        state = run.reach(FAR, 500.0)
        assert state is not None and state.error_code == 0, state and state.reason
        assert error(run, FAR)[0] < 5e-3 and run.supervisor.method.job.replans >= 1


@pytest.fixture
def run():
    with running() as started:
        started.start()
        yield started


@pytest.mark.long
def test_a_reset_of_the_world_ends_the_job_and_the_next_goal_is_reached(run):
    """Row 12."""
    run.teams[""].send_goal(FAR)
    pushing(run)
    client = run.observer.create_client(Reset, "/bridge/reset")
    assert run.spinner.until(client.service_is_ready, 5.0)
    answer = client.call_async(Reset.Request())
    assert run.spinner.until(answer.done, 5.0)
    assert run.spin_until(lambda: run.observer.state.state == JobState.IDLE, 5.0)
    assert run.observer.state.error_code == JobError.CLOCK_RESET
    run.observer.trace.object.clear()
    state = run.reach(np.array(VALUES["goal"]), 300.0)
    assert state is not None and state.error_code == 0


@pytest.mark.long
def test_poses_that_are_none_are_refused_and_change_nothing(run):
    """Rows 1 and 23: another source of poses that lies."""
    liar = run.observer.create_publisher(Poses, "/poses", STREAM)
    run.teams[""].send_goal(np.array(VALUES["goal"]))
    pushing(run)
    before = run.supervisor._diagnostics.refused.get("/poses", 0)
    for x in (math.nan, math.inf, 1e9):
        message = Poses(names=["plate"], x=[x], y=[0.0], theta=[0.0])
        message.header.frame_id = "map"
        message.header.stamp = run.supervisor._stamp
        liar.publish(message)
    run.spin_until(lambda: run.supervisor._diagnostics.refused.get("/poses", 0) > before, 2.0)
    assert run.supervisor._diagnostics.refused.get("/poses", 0) > before
    assert run.spin_until(lambda: run.observer.state.state == JobState.IDLE, 300.0)
    assert run.observer.state.error_code == 0
    assert error(run, np.array(VALUES["goal"]))[0] < 5e-3


def test_the_optimizer_that_is_gone_ends_the_job_after_a_while(run, monkeypatch):
    """Row 11. Robots stand while they wait."""
    monkeypatch.setattr(grasp_opt.node, "PATIENCE", 1.0)
    told = commands(run)
    run.planner._server._server.destroy()
    assert run.spinner.until(lambda: not run.supervisor.partners.ready, 10.0)
    run.teams[""].send_goal(FAR)
    assert run.spin_until(lambda: run.observer.state.error_code != 0, 4000.0, 20.0)
    assert run.observer.state.error_code == JobError.NODE_LOST
    assert told and max(speed for _, speed in told) == 0.0


@pytest.mark.long
def test_the_world_stands_still_for_a_while_and_the_job_goes_on(run):
    """Row 24."""
    client = run.observer.create_client(SetBool, "/bridge/pause")
    assert run.spinner.until(client.service_is_ready, 5.0)
    run.teams[""].send_goal(np.array(VALUES["goal"]))
    pushing(run)
    for data in (True, False):
        answer = client.call_async(SetBool.Request(data=data))
        assert run.spinner.until(answer.done, 5.0)
        run.spinner.until(lambda: False, 1.5)
    assert run.spin_until(lambda: run.observer.state.state == JobState.IDLE, 300.0)
    assert run.observer.state.error_code == 0


@pytest.mark.long
def test_a_flood_of_goals_ends_with_the_last_one(run):
    """Row 28: the one that is pursued restarts nothing."""
    goals = [np.array([0.02 * k, 0.3, -1.2]) for k in range(20)]
    for goal in (*goals, goals[-1], goals[-1]):
        run.observer.send_goal(goal)
    pushing(run)
    jobs, job = run.observer.state.job, run.supervisor.method.job
    pushes, replans = job.pushes, job.replans
    for _ in range(5):
        run.observer.send_goal(goals[-1])
    assert run.spin_until(lambda: run.observer.state.state == JobState.IDLE, 300.0)
    assert run.observer.state.job == jobs <= 20 and run.observer.state.error_code == 0
    assert job.replans == replans and job.pushes >= pushes
    assert error(run, goals[-1])[0] < 5e-3


@pytest.mark.long
def test_wild_goals_crash_nothing(run):
    """Row 21, of the goal's topic."""
    random = np.random.default_rng(1)
    publisher = run.observer.create_publisher(PoseStamped, "/goal_pose", COMMAND)
    assert run.spinner.until(lambda: publisher.get_subscription_count() > 0, 5.0)
    wild = [math.nan, math.inf, -math.inf, 1e300, -1e9, 0.0, 1e-300]
    for _ in range(200):
        message = PoseStamped()
        message.header.frame_id = str(random.choice(["map", "", "odom"]))
        p, q = message.pose.position, message.pose.orientation
        p.x, p.y, q.x, q.y, q.z, q.w = (float(random.choice(wild)) for _ in range(6))
        publisher.publish(message)
    run.spin_until(lambda: run.observer.state.refusals > 150, 20.0)
    state = run.reach(np.array(VALUES["goal"]), 300.0)
    assert state is not None and state.error_code == 0
