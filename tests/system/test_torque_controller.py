"""The wheel-slip NMPC in the graph: poses and wheel states in, torques out; and what stops it."""

from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest
import rclpy
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from push_bringup.node_settings import changed, resolved
from push_bringup.systems import LOCKSTEP, nodes_of
from push_model.trajectory import line
from push_msgs.action import FollowTrajectory
from push_msgs.msg import Circle, WheelTorques
from push_ros.conversions import poses_to_ros, trajectory_to_ros
from push_ros.process import Spinner
from push_ros.qos import COMMAND, STREAM
from push_scenario.events import DropPoses
from push_scenario.scenario import load_scenario
from push_study.experiments import wheel_slip
from push_study.study import StudyOptions

CODES = FollowTrajectory.Result


class Run:
    """Bridge, controller and somebody who asks, in lockstep."""

    def __init__(self, stack, events=()):
        scenario = replace(load_scenario("wheel-slip"), events=tuple(events))
        scenario = scenario.settings("bridge", lockstep=True)
        scenario = resolved(changed(scenario, LOCKSTEP, only_missing=True))
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        stack.callback(rclpy.try_shutdown)
        self.bridge, self.node = (s.make(scenario) for s in nodes_of("torque", scenario))
        self.me = Node("me")
        self.client = ActionClient(self.me, FollowTrajectory, "/pioneer/follow_trajectory")
        self.heartbeat = self.me.create_publisher(Header, "/pioneer/heartbeat", STREAM)
        self.wheels = self.me.create_publisher(JointState, "/pioneer/joint_states", STREAM)
        self.torques = []
        topic = "/pioneer/wheel_torques"
        self.me.create_subscription(WheelTorques, topic, self.torques.append, COMMAND)
        self.spinner = Spinner([self.bridge, self.node, self.me])
        stack.callback(self.spinner.close)
        assert self.spinner.until(
            lambda: (
                len(self.bridge.commanded()) == 1
                and bool(self.bridge.heard_by(1))
                and self.client.server_is_ready()
            ),
            20.0,
        )
        self.bridge.start()

    def spin(self, seconds):
        end = self.bridge.time + seconds
        assert self.spinner.until(lambda: self.bridge.time >= end, 120.0)

    def send(self, length=2.0, **values):
        start = load_scenario("wheel-slip").robot()[1], self.bridge.world.poses()["pioneer"]
        way = line(start[1], length, 0.5, 0.6)
        goal = FollowTrajectory.Goal(trajectory=trajectory_to_ros(way), **values)
        sent = self.client.send_goal_async(goal)
        assert self.spinner.until(sent.done, 20.0)
        return sent.result()

    def result(self, handle, limit=30.0):
        answer = handle.get_result_async()
        end = self.bridge.time + limit
        self.spinner.until(lambda: answer.done() or self.bridge.time > end, 240.0)
        return answer.result().result

    @property
    def x(self):
        return float(self.bridge.world.poses()["pioneer"][0])

    def stands(self):
        """Comes to rest within a second, and stays."""
        self.spin(1.0)
        before = self.bridge.world.poses()["pioneer"]
        self.spin(0.5)
        return np.abs(self.bridge.world.poses()["pioneer"] - before).max() < 2e-3


@pytest.fixture
def run():
    with ExitStack() as stack:
        yield Run(stack)


def test_it_follows_a_line_by_torques_and_stands_before_and_after(run):
    assert run.stands() and not run.torques
    begin = run.x
    result = run.result(run.send(1.0))
    assert result.error_code == CODES.NONE, result.error_msg
    assert run.x - begin == pytest.approx(1.0, abs=0.1) and len(run.torques) > 50
    assert all(np.isfinite([t.left, t.right]).all() for t in run.torques)
    count = len(run.torques)
    assert run.stands() and len(run.torques) == count


def test_a_push_is_refused_and_a_broken_trajectory_too(run):
    assert not run.send(mode=FollowTrajectory.Goal.PUSH).accepted
    assert not run.send(heartbeat_timeout=float("nan")).accepted
    assert not run.send(heartbeat_timeout=-1.0).accepted
    empty = FollowTrajectory.Goal()
    sent = run.client.send_goal_async(empty)
    assert run.spinner.until(sent.done, 20.0) and not sent.result().accepted
    assert run.stands()


@pytest.mark.parametrize(
    "field",
    [
        {"obstacles": [Circle(x=0.5, y=0.0, radius=0.4)]},
        {"object": "box"},
        {"position_tolerance": float("nan")},
        {"position_tolerance": -0.1},
        {"orientation_tolerance": float("inf")},
        {"orientation_tolerance": -1.0},
    ],
    ids=lambda field: next(iter(field)),
)
def test_a_field_that_it_cannot_obey_is_refused(run, field):
    assert not run.send(**field).accepted
    assert run.send(1.0).accepted


def test_tolerances_of_a_goal_are_obeyed(run):
    result = run.result(run.send(0.6, position_tolerance=1e-6))
    assert result.error_code == CODES.TIMEOUT, result.error_msg
    result = run.result(run.send(0.6))
    assert result.error_code == CODES.NONE, result.error_msg


@pytest.mark.parametrize("how", ["cancel", "heartbeat"])
def test_it_stands_when(run, how):
    """Canceled; the sender silent."""
    timeout = 0.3 if how == "heartbeat" else 0.0
    handle = run.send(6.0, heartbeat_timeout=timeout)
    answer = handle.get_result_async()
    run.spin(0.2)
    if how == "cancel":
        run.spin(0.8)
        assert run.torques
        handle.cancel_goal_async()
    else:
        run.me.destroy_publisher(run.heartbeat)  # in lockstep the sender is lost when it is gone
    assert run.spinner.until(answer.done, 30.0)
    expected = CODES.CANCELED if how == "cancel" else CODES.PREEMPTED
    assert answer.result().result.error_code == expected
    assert run.stands()


def test_wheel_states_of_nonsense_are_counted_and_change_nothing(run):
    for speeds in ([], [1.0], [1.0, 2.0, 3.0], [float("nan"), 1.0]):
        run.wheels.publish(JointState(velocity=speeds))
        run.spin(0.1)
    result = run.result(run.send(0.6))
    assert result.error_code == CODES.NONE, result.error_msg
    assert run.node.diagnostics.refused["joint_states"] == 4


def test_without_poses_it_stands_and_gives_up():
    with ExitStack() as stack:
        run = Run(stack, events=[DropPoses(1.5, ("pioneer",), 60.0)])
        answer = run.send(6.0).get_result_async()
        run.spin(1.5 - run.bridge.time)
        assert run.torques and run.stands()
        run.spin(4.0)
        assert run.spinner.until(answer.done, 30.0)
        assert answer.result().result.error_code == CODES.POSES_STALE


@pytest.mark.parametrize("how", ["frozen", "silent"])
def test_wheel_states_that_stop_coming_expire_and_it_goes_on_from_poses(run, monkeypatch, how):
    """In mid-way at 0.5 m/s: repeated with fresh stamps, or not sent any more. A controller that
    believed them would take the end of the way for slip and trust the least friction there is."""
    answer = run.send(3.0).get_result_async()
    run.spin(3.0)
    heard, kept = run.node.follower.take_wheels, []
    assert run.node.follower.wheels.at(run.bridge.time - 0.01) is not None

    def broken(message):
        kept.append(message)
        if how == "frozen":
            message.position, message.velocity = kept[0].position, kept[0].velocity
            heard(message)

    for subscription in run.node.subscriptions:
        if subscription.topic_name.endswith("joint_states"):
            monkeypatch.setattr(subscription, "callback", broken)
    run.spin(0.3)
    assert kept and abs(kept[0].velocity[0]) > 3.0  # it was driving
    assert run.node.follower.wheels.at(run.bridge.time) is None
    assert run.spinner.until(answer.done, 120.0)
    assert answer.result().result.error_code == CODES.NONE
    assert run.node.tracker.trust.part > 0.9
    assert (run.node.diagnostics.refused.get("joint_states", 0) > 100) == (how == "frozen")


def test_a_cancel_at_full_speed_skids_no_wheel(run):
    """It brakes by torques, and only a robot at rest is told to stand."""
    handle = run.send(6.0)
    run.spin(3.0)
    assert run.bridge.world.wheel_state("pioneer").speed.min() > 4.0
    begin, slips = run.x, []
    handle.cancel_goal_async()
    for _ in range(25):
        before = run.bridge.world.poses()["pioneer"]
        at = run.bridge.time
        run.spin(0.02)
        v = (run.bridge.world.poses()["pioneer"] - before)[0] / (run.bridge.time - at)
        slips.append(np.abs(run.bridge.world.wheel_state("pioneer").speed * 0.095 - v).max())
    assert max(slips) < 0.1, slips  # locked wheels: 0.5 m/s
    assert run.stands() and run.x - begin < 0.3


def test_refused_frames_at_full_speed_lock_no_wheel(run, monkeypatch):
    """It brakes by torques; the trajectory goes on with the next frame."""
    answer = run.send(6.0).get_result_async()
    run.spin(3.0)
    assert run.bridge.world.wheel_state("pioneer").speed.min() > 4.0
    follower, sent = run.node.follower, []
    send = follower.send
    monkeypatch.setattr(follower, "send", lambda *told: (sent.append(told[0]), send(*told)))
    before = dict(run.bridge._diagnostics.refused)
    for back in (0.0, 0.0, 0.1, 0.1, 0.1):
        stamp = run.node.poses.stamp - back
        run.node.poses.take(poses_to_ros(run.bridge.world.poses(), stamp))
    assert all(torques is not None and max(torques) < 0.0 for torques in sent), sent
    assert run.spinner.until(answer.done, 120.0)
    assert answer.result().result.error_code == CODES.NONE
    assert dict(run.bridge._diagnostics.refused) == before, "the bridge takes the commands"


def compare(tmp_path, case, seeds, **changes):
    """Slip kept and error ratio, with the constraint over without it, after settling."""
    rows = {
        constraint: [
            wheel_slip.trial(
                wheel_slip.SlipTask("wheel-slip", seed, str(tmp_path), case, constraint, **changes)
            )
            for seed in seeds
        ]
        for constraint in (True, False)
    }
    assert all(r["success"] for r in rows[True]), rows
    mean = {
        (name, constraint): np.mean([r[name] for r in rows[constraint]])
        for name in ("slip_rms_m_s", "error_rms_m")
        for constraint in rows
    }
    late = max(r["solve_p99_ms"] for r in rows[True])
    return (
        mean["slip_rms_m_s", True] / mean["slip_rms_m_s", False],
        mean["error_rms_m", True] / mean["error_rms_m", False],
        late,
        rows,
    )


@pytest.mark.long
def test_the_constraint_takes_the_slip_of_the_bends_away(tmp_path, capsys):
    """Case II, with the noise, the latency and the frictions of ``mild``."""
    kept, ratio, _, rows = compare(tmp_path, 2, [4], pairs=2)
    assert kept < 0.2 and ratio < 1.2, (kept, ratio)
    (without,) = rows[False]
    assert without["slip_rms_m_s"] > 0.02 and without["slip_max_m_s"] > 0.3  # the bends provoke it
    assert without["box_floor_friction"] != 0.3 and without["settled_from_s"] == pytest.approx(4.0)
    options = StudyOptions(("wheel-slip",), 1, 4, tmp_path)
    tasks = [replace(t, pairs=2) for t in wheel_slip.tasks(options)]
    wheel_slip.conclude(options, tasks, rows[True] + rows[False])
    assert (tmp_path / "wheel-slip.png").stat().st_size > 5000
    assert "from 4.0 s on, before the first bend; uncertainty: mild" in capsys.readouterr().out


@pytest.mark.study
@pytest.mark.parametrize("case", [1, 2, 3])
def test_in_every_case_slip_goes_and_the_error_stays(tmp_path, case):
    kept, ratio, late, _ = compare(tmp_path, case, [1, 2, 3])
    assert kept <= 0.2 and ratio <= 1.2, (kept, ratio)
    assert late <= 10.0


def test_uncertainty_reaches_world_and_motion_capture(tmp_path):
    """What is drawn is simulated, and is not what the controller believes."""
    found = {}
    for level in ("none", "mild", "hard"):
        task = wheel_slip.SlipTask("wheel-slip", 3, str(tmp_path), 3, True, level)
        believed, world, _, drawn = wheel_slip.world_of(task)
        capture = world.parameters["bridge"]["motion_capture"]
        friction = world.robot()[1].drive.wheel_friction
        assert believed.robot()[1].drive.wheel_friction == 0.5
        assert believed.parameters["torque_controller"]["nmpc"]["friction"] == 0.7
        assert drawn["pioneer_wheel_friction"] == friction
        found[level] = (friction, capture["position_noise"], capture["latency"])
    assert found["none"] == (0.5, 0.0, 0.0)
    assert found["mild"][0] != 0.5 and found["mild"][1] == 2e-4
    assert found["hard"][1] == 1e-3 and found["hard"][2] >= 0.02
