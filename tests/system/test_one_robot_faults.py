"""Faults of poses, world and commands while one robot pushes; the whole graph, in lockstep."""

import numpy as np
import pytest
from geometry_msgs.msg import TwistStamped

from push_msgs.action import MoveObject
from push_msgs.msg import JobState
from push_ros.conversions import pose_stamped_to_ros
from push_ros.qos import COMMAND
from push_scenario.scenario import load_scenario
from push_study.graph_run import LockstepRun
from push_study.observer import final_errors
from tests.system.motion import drift, moved


@pytest.fixture
def short(monkeypatch):
    """A started run of the short scenario, driven by each test."""
    scenario = load_scenario("short")
    with LockstepRun(scenario, quiet=True) as run:
        run.start()
        yield run


def pushing(run):
    """Run until the box has been pushed a little."""
    run.observer.send_goal(run.scenario.goal)
    assert run.spin_until(
        lambda: (
            run.observer.state.state == JobState.PUSHING
            and run.observer.trace.object[-1][0] > -0.40
        ),
        60.0,
    )


def ends(run, limit=120.0):
    """Run until the job has ended; its state."""
    assert run.spin_until(lambda: run.observer.state.state == JobState.IDLE, limit)
    return run.observer.state


class Tampered:
    """A publisher whose messages pass through somebody's hands."""

    def __init__(self, publisher, change):
        self.publisher, self.change = publisher, change

    def publish(self, message):
        for m in self.change(message):
            self.publisher.publish(m)


def tamper(run, change):
    outputs = run.bridge.outputs
    outputs.poses = Tampered(outputs.poses, change)


def test_nan_poses_stop_the_robot_and_good_ones_let_it_go_on(short):
    """FAULTS 1 and 7."""
    pushing(short)
    until = short.bridge.time + 1.0

    def change(message):
        if short.bridge.time < until:
            message.x = [float("nan")] * len(message.names)
        return [message]

    tamper(short, change)
    moved(short, 0.3)
    assert moved(short, 0.5) < 1e-3
    assert short.controller.poses.gate.refused > 20
    assert ends(short).error_code == 0
    assert final_errors(short.observer.trace, short.scenario.goal)[0] < 0.02


def test_stopped_stream_stops_the_robot_and_its_return_lets_it_go_on(short, monkeypatch):
    """FAULTS 7: no frames at all for half a second of sim time. Nobody answers what is not sent."""
    pushing(short)
    until, capture = short.bridge.time + 0.5, short.bridge._capture
    observe, sent = capture.observe, []

    def blind(tick, poses):
        frame = observe(tick, poses)
        sent.append(short.bridge.time > until + 1e-6)
        return frame if sent[-1] else None

    monkeypatch.setattr(capture, "observe", blind)
    start = short.bridge.tick
    short.spin_until(lambda: any(sent), 5.0)
    assert sent.count(False) == 50 and short.bridge.tick >= start + 50
    assert not short.bridge.driving("epuck1")  # since 0.2 s after the last frame
    assert short.bridge.unanswered == 0
    assert ends(short).error_code == 0
    assert final_errors(short.observer.trace, short.scenario.goal)[0] < 0.02


@pytest.mark.long
def test_jumped_pose_is_not_chased(short):
    """FAULTS 9: zeros, as a tracking system reports a lost body."""
    pushing(short)
    count = [0]

    def change(message):
        count[0] += 1
        if count[0] % 40 < 8:
            message.x = message.y = [0.0] * len(message.names)
        return [message]

    tamper(short, change)
    assert ends(short).error_code == 0
    assert short.controller.poses.gate.jumps > 50
    assert final_errors(short.observer.trace, short.scenario.goal)[0] < 0.02


def test_frozen_poses_end_the_push(short):
    """FAULTS 8: fresh stamps, old poses."""
    pushing(short)
    held = []

    def change(message):
        if not held:
            held.extend([message.x, message.y, message.theta])
        message.x, message.y, message.theta = held
        return [message]

    tamper(short, change)
    assert short.spin_until(
        lambda: any("moved" in r for _, _, r, _ in short.observer.trace.states), 10.0
    ), short.observer.trace.states


@pytest.mark.long
def test_object_taken_away_is_noticed_and_replanned(short):
    """FAULTS 16: moved by hand in mid-push; the goal is reached all the same."""
    pushing(short)
    short.bridge.world.place("box", np.array([-0.6, -0.5, 0.0]))
    state = ends(short, 200.0)
    assert state.error_code == 0 and state.replans >= 1, state.reason
    assert final_errors(short.observer.trace, short.scenario.goal)[0] < 0.02


@pytest.mark.long
def test_object_moved_before_the_push_is_noticed(short):
    short.observer.send_goal(short.scenario.goal)
    assert short.spin_until(
        lambda: short.observer.state.state == JobState.POSITIONING and short.bridge.time > 1.0,
        20.0,
    )
    short.bridge.world.place("box", np.array([-0.45, 0.3, 0.0]))
    state = ends(short, 200.0)
    assert state.error_code == 0 and state.replans >= 1, state.reason


@pytest.mark.long
def test_reset_of_the_bridge_ends_the_job_and_a_new_goal_works(short):
    """FAULTS 12."""
    pushing(short)
    request = type("R", (), {"seed": 5})()
    short.bridge._on_reset(request, type("A", (), {})())
    state = ends(short, 5.0)
    assert state.error_code == 313 and "clock" in state.reason
    assert moved(short, 0.3) < 1e-3
    assert short.reach(short.scenario.goal).error_code == 0


def test_bad_commands_never_reach_the_wheels(short):
    """FAULTS 13, and stale and future stamps of row 10."""
    stranger = short.observer.create_publisher(TwistStamped, "/epuck1/cmd_vel", COMMAND)
    assert short.spinner.until(lambda: stranger.get_subscription_count() > 0, 5.0)
    assert short.spin_until(lambda: len(short.observer.trace.robot) > 5, 5.0)
    good = short.bridge.time
    for v, omega, stamp in [
        (np.nan, 0, good),
        (0, np.inf, good),
        (1e6, 0, good),
        (0.1, 0, -1),
        (0.1, 0, good + 99),
    ]:
        message = TwistStamped()
        message.twist.linear.x, message.twist.angular.z = float(v), float(omega)
        message.header.stamp = pose_stamped_to_ros(np.zeros(3), max(stamp, 0.0)).header.stamp
        stranger.publish(message)
    assert moved(short, 1.0) < 1e-4
    assert short.bridge._diagnostics.refused["/epuck1/cmd_vel"] == 5


def test_cancelled_action_reports_canceled(short):
    from action_msgs.msg import GoalStatus
    from rclpy.action import ActionClient

    client = ActionClient(short.observer, MoveObject, "/move_object")
    assert short.spinner.until(client.server_is_ready, 5.0)
    goal = MoveObject.Goal(goal=pose_stamped_to_ros(short.scenario.goal, 0.0))
    sent = client.send_goal_async(goal)
    assert short.spin_until(sent.done, 5.0) and sent.result().accepted
    assert short.spin_until(lambda: short.observer.trace.object[-1][0] > -0.40, 60.0)
    sent.result().cancel_goal_async()
    result = sent.result().get_result_async()
    assert short.spin_until(result.done, 1.0)
    assert result.result().status == GoalStatus.STATUS_CANCELED
    assert result.result().result.error_code == MoveObject.Result.CANCELED
    moved(short, 0.4)
    assert moved(short, 0.3) < 3e-4 and drift(short) < 2e-5, "it stands"
    unknown = client.send_goal_async(MoveObject.Goal(object="moon", goal=goal.goal))
    assert short.spin_until(unknown.done, 5.0)
    answer = unknown.result().get_result_async()
    assert short.spin_until(answer.done, 5.0)
    assert answer.result().result.error_code == MoveObject.Result.UNKNOWN_OBJECT
