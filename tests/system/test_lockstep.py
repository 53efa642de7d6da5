"""The whole graph in one process, in lockstep."""

import hashlib
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import OccupancyGrid, Path
from rclpy.node import Node
from std_msgs.msg import String
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from push_model.settings import SettingsError
from push_msgs.action import MoveObject
from push_msgs.msg import JobState
from push_ros import pace_feed
from push_ros.conversions import pose_stamped_to_ros
from push_ros.qos import COMMAND, LATCHED
from push_scenario.scenario import load_scenario
from push_study.graph_run import LockstepRun
from push_study.observer import final_errors
from tf2_msgs.msg import TFMessage

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))


NODE_MODULES = (
    "push_ros.pace_feed",
    "push_mpc.follower_node",
    "sim_bridge.node",
    "push_ros.command_intake",
)
"""Where the nodes of one robot look at the wall clock, but the planner's."""


def noisy(name="short", seed=3):
    return (
        load_scenario(name)
        .settings(
            "bridge",
            seed=seed,
            motion_capture__position_noise=2e-4,
            motion_capture__orientation_noise=1.7e-3,
            motion_capture__latency=0.01,
        )
        .settings("controller", tracker__pose_delay=0.01)
    )


def run_once(seed=3):
    """Digest of the ground truth of a whole noisy run."""
    scenario = noisy(seed=seed)
    with LockstepRun(scenario, quiet=True) as run:
        run.start()
        state = run.reach(scenario.goal)
        trace = run.observer.trace
        assert state is not None and state.error_code == 0, state
        assert run.bridge.unanswered == 0
        data = np.array(trace.robot).tobytes() + np.array(trace.object).tobytes()
        return hashlib.sha256(data).hexdigest()


@pytest.fixture(scope="module")
def undisturbed():
    """Digest of a run that nothing disturbs."""
    return run_once()


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


_SWING = 0.9  # [s] in which the body of a robot that braked hard rocks back and forth, by 0.1 mm


def drift(run):
    """[m] between the mean places of the robot in two swings of its body."""
    means = []
    for _ in range(2):
        moved(run, _SWING)
        means.append(np.mean(run.observer.trace.robot[-90:], axis=0)[:2])
    return float(np.hypot(*(means[1] - means[0])))


def moved(run, seconds):
    """Way [m] of the robot over some more sim time."""
    start, end = run.observer.trace.robot[-1], run.bridge.time + seconds
    run.spin_until(lambda: run.bridge.time >= end, seconds + 1.0)
    return float(np.hypot(*(run.observer.trace.robot[-1] - start)[:2]))


def ends(run, limit=120.0):
    """Run until the job has ended; its state."""
    assert run.spin_until(lambda: run.observer.state.state == JobState.IDLE, limit)
    return run.observer.state


@pytest.mark.long
def test_equal_seeds_give_equal_runs_to_the_bit_also_in_a_fresh_process(undisturbed):
    here = undisturbed
    assert here == run_once()
    code = "from tests.system.test_lockstep import run_once; print(run_once())"
    out = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    assert out.stdout.split()[-1] == here
    assert run_once(seed=4) != here


def test_a_map_of_map_server_is_an_environment(room):
    with LockstepRun(load_scenario(room), quiet=True) as run:
        run.start()
        beyond = run.reach(np.array([0.0, 0.5, 0.0]))
        assert beyond.refusal_code == MoveObject.Result.GOAL_OCCUPIED, beyond
        state = run.reach(run.scenario.goal)
        assert state.error_code == 0, state


class Outsider(Node):
    """Somebody who knows only standard messages."""

    def __init__(self):
        super().__init__("outsider")
        self.texts, self.maps, self.paths, self.tfs, self.markers = [], [], [], [], []
        self.commands = []
        self.create_subscription(
            String, "/status_text", lambda m: self.texts.append(m.data), LATCHED
        )
        self.create_subscription(OccupancyGrid, "/map", self.maps.append, LATCHED)
        self.create_subscription(Path, "/push_path", self.paths.append, LATCHED)
        self.create_subscription(TFMessage, "/tf", self.tfs.append, 10)
        self.create_subscription(MarkerArray, "/visualization", self.markers.append, 10)
        self.create_subscription(TwistStamped, "/epuck1/cmd_vel", self.commands.append, COMMAND)
        self.goals = self.create_publisher(PoseStamped, "/goal_pose", 10)
        self.cancel = self.create_client(Trigger, "/cancel")


@pytest.mark.long
def test_standard_messages_are_enough():
    scenario = load_scenario("short")
    outsiders = []

    def extra():
        outsiders.append(Outsider())
        return outsiders

    with LockstepRun(scenario, extra, quiet=True) as run:
        run.start()
        me = outsiders[0]
        assert run.spinner.until(lambda: me.cancel.service_is_ready(), 10)
        # inside the arena's wall
        me.goals.publish(pose_stamped_to_ros(np.array([1.49, 0.0, 0.0]), 0.0))
        assert run.spin_until(lambda: any("obstacle" in t for t in me.texts), 5.0), me.texts
        assert run.observer.state.state == JobState.IDLE
        # outside the map
        me.goals.publish(pose_stamped_to_ros(np.array([9.0, 0.0, 0.0]), 0.0))
        assert run.spin_until(lambda: any("outside the map" in t for t in me.texts), 5.0)
        # an unknown frame, and a NaN
        message = pose_stamped_to_ros(scenario.goal, 0.0)
        message.header.frame_id = "moon"
        me.goals.publish(message)
        assert run.spin_until(lambda: any("'moon'" in t for t in me.texts), 5.0)
        me.goals.publish(pose_stamped_to_ros(np.array([np.nan, 0.0, 0.0]), 0.0))
        assert run.spin_until(lambda: any("not finite" in t for t in me.texts), 5.0)
        assert moved(run, 0.5) < 1e-4
        # a good one, cancelled in mid-push
        me.goals.publish(pose_stamped_to_ros(scenario.goal, 0.0))
        assert run.spin_until(lambda: run.observer.trace.object[-1][0] > -0.40, 60.0)
        me.cancel.call_async(Trigger.Request())
        assert run.spin_until(lambda: "IDLE: canceled" in me.texts, 0.2)
        moved(run, 0.2)
        assert moved(run, 0.5) < 3e-4 and drift(run) < 2e-5, "it stands"
        # and again, to the end
        me.goals.publish(pose_stamped_to_ros(scenario.goal, 0.0))
        assert run.spin_until(lambda: me.texts[-1].startswith("IDLE: the goal is reached"), 120.0)
        assert final_errors(run.observer.trace, scenario.goal)[0] < 0.02
        assert me.maps[0].info.resolution == pytest.approx(0.01)
        assert set(me.maps[0].data) == {0, 100}
        assert me.paths[-1].header.frame_id == "map" and len(me.paths[-1].poses) > 50
        names = {t.child_frame_id for m in me.tfs for t in m.transforms}
        assert names == {"epuck1", "box"}
        assert {m.ns for array in me.markers for m in array.markers} == {"bodies"}
        stamps = [c.header.stamp.sec + 1e-9 * c.header.stamp.nanosec for c in me.commands]
        assert np.allclose(np.diff(sorted(set(stamps))), 0.01)  # every tick is answered


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
        sent.append(short.bridge.time > until)
        return frame if sent[-1] else None

    monkeypatch.setattr(capture, "observe", blind)
    start = short.bridge.tick
    short.spin_until(lambda: any(sent), 5.0)
    assert sent.count(False) == 50 and short.bridge.tick >= start + 50
    assert not short.bridge.driving("epuck1")  # since 0.2 s after the last frame
    assert short.bridge.unanswered == 0
    assert ends(short).error_code == 0
    assert final_errors(short.observer.trace, short.scenario.goal)[0] < 0.02


def test_all_nodes_know_that_the_world_waits_before_it_moves():
    """A node that hears so late takes the world for live, and its limits for wall time."""
    with LockstepRun(load_scenario("short"), quiet=True) as run:
        feeds = [c for n in run.nodes if (c := pace_feed._clocks.get(n)) is not None]
        assert len(feeds) >= 2 and not all(c.told for c in feeds)
        run.connect()
        assert all(c.told and c.lockstep for c in feeds)


def test_a_wall_clock_that_leaps_changes_nothing(monkeypatch, undisturbed):
    """FAULTS 30: each look at the wall clock finds that 20 s have passed, more than any limit."""
    leaps = [0]

    class Leaping:
        thread_time, perf_counter = time.thread_time, time.perf_counter

        @staticmethod
        def monotonic():
            leaps[0] += 1
            return 20.0 * leaps[0]

    for module in NODE_MODULES:
        monkeypatch.setattr(f"{module}.time", Leaping)
    assert run_once() == undisturbed
    assert leaps[0] > 1000


@pytest.mark.long
def test_a_process_that_is_stopped_for_15_s_ends_as_one_that_was_not(undisturbed, tmp_path):
    """FAULTS 30: SIGSTOP in the middle of a push, SIGCONT; the result is equal to the bit."""
    code = (
        "from pathlib import Path\n"
        "from push_study.graph_run import LockstepRun\n"
        "from tests.system import test_lockstep\n"
        "class Marked(LockstepRun):\n"
        "    def spin_until(self, condition, limit, *rest):\n"
        "        def watched():\n"
        "            if self.observer.state.state_name == 'PUSHING':\n"
        f"                Path({str(tmp_path)!r}, 'pushing').touch()\n"
        "            return condition()\n"
        "        return super().spin_until(watched, limit, *rest)\n"
        "test_lockstep.LockstepRun = Marked\n"
        "print(test_lockstep.run_once())\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE, text=True
    )
    try:
        end = time.monotonic() + 240.0
        while not (tmp_path / "pushing").exists():
            assert process.poll() is None and time.monotonic() < end
            time.sleep(0.02)
        process.send_signal(signal.SIGSTOP)
        time.sleep(15.0)
        assert process.poll() is None  # it had not ended before it was stopped
        process.send_signal(signal.SIGCONT)
        out, _ = process.communicate(timeout=240.0)
    finally:
        process.kill()
    assert process.returncode == 0 and out.split()[-1] == undisturbed


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

    from push_msgs.action import MoveObject

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


def test_a_second_run_in_the_same_domain_is_refused():
    """They would answer each other's frames."""
    scenario = load_scenario("short")
    with LockstepRun(scenario, quiet=True) as run:
        with pytest.raises(SettingsError, match="a bridge already runs in domain"):
            LockstepRun(scenario, quiet=True)
        run.start()
        assert run.spin_until(lambda: run.bridge.time > 0.1, 5.0), "the first one goes on"
    with LockstepRun(scenario, quiet=True):
        pass
