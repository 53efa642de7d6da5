"""From poses to command across processes at 100 Hz, the controller following a trajectory; alone,
and with two pages of the live view open."""

import socket
import subprocess
import sys
import time
from contextlib import ExitStack
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import TwistStamped
from rclpy.action import ActionClient
from rclpy.signals import SignalHandlerOptions

from benchmarks.measure import at_most
from push_bringup.launcher import Child, Launcher
from push_bringup.node_kinds import MODULES
from push_bringup.systems import single
from push_model import line, unicycle_step
from push_msgs.action import FollowTrajectory
from push_msgs.msg import Poses
from push_ros.claims import claim_domain
from push_ros.conversions import poses_to_ros, trajectory_to_ros
from push_ros.process import Spinner, die_with_parent, prepare_environment
from push_ros.qos import COMMAND, STREAM
from push_scenario.scenario import load_scenario

_PAGES = 2
_READER = "import sys, urllib.request as r\nfor _ in r.urlopen(sys.argv[1], timeout=60): pass"


def run(seconds: float = 15.0) -> dict[str, Any]:
    """Wall time from publishing a frame to receiving its command."""
    claim_domain()
    prepare_environment()
    controller = next(n for n in single(load_scenario("short")) if n.kind == "controller")
    port = _free_port()
    page = Child("viewer", "planar_push", ["view", "--scenario", "short", "--port", str(port)])
    with ExitStack() as stack:
        first = Launcher([Child("controller", MODULES["controller"], controller.words("short"))])
        stack.callback(first.stop)
        first.start()
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        stack.callback(rclpy.try_shutdown)
        course = _Course()
        stack.callback(course.spinner.close)
        alone = _summary("alone", course.follow(seconds), course)
        second = Launcher([page])
        stack.callback(second.stop)
        second.start()
        course.follow(0.0)  # until the viewer is there
        for _ in range(_PAGES):
            stack.callback(_open(port).kill)
        shown = _summary(f"{_PAGES} pages open", course.follow(seconds), course)
    ratio = shown["p99_ms"] / alone["p99_ms"]
    print(f"  p99 with pages over p99 alone: {ratio:.2f}")
    return {
        **alone,
        "pages": shown,
        "p99_ratio": ratio,
        "bounds": {"p99 [ms]": at_most(alone["p99_ms"], 8.0)},
    }


class _Course:
    """A robot that goes as it is commanded, and a trajectory that is followed again and again."""

    def __init__(self) -> None:
        self.node = rclpy.create_node("latency")
        self.spinner = Spinner([self.node])
        self.sent: dict[int, float] = {}
        self.delays: list[float] = []
        self.robot = np.array([-1.3, 0.0, 0.0])
        self.tick = 100
        self.publisher = self.node.create_publisher(Poses, "/poses", STREAM)
        self.node.create_subscription(TwistStamped, "/epuck1/cmd_vel", self._on_command, COMMAND)
        self.client = ActionClient(self.node, FollowTrajectory, "/epuck1/follow_trajectory")
        self.listeners = 1

    def _on_command(self, message: TwistStamped) -> None:
        tick = round(message.header.stamp.sec * 100 + message.header.stamp.nanosec / 1e7)
        if tick in self.sent:
            self.delays.append(time.perf_counter() - self.sent.pop(tick))
        v, omega = message.twist.linear.x, message.twist.angular.z
        self.robot = unicycle_step(self.robot, v, omega, 0.01)

    def follow(self, seconds: float) -> list[float]:
        """Delays [s] over a time; with none, wait for one more listener."""
        if not seconds:
            self.listeners += 1
        there = lambda: (  # noqa: E731
            self.client.server_is_ready()
            and self.publisher.get_subscription_count() >= self.listeners
        )
        if not self.spinner.until(there, 30.0):
            raise RuntimeError("the controller or the viewer did not come up")
        if not seconds:
            return []
        back = -1.0 if self.robot[0] > 0.0 else 1.0
        way = line(self.robot, back * 2.6, 0.1, 0.1)
        self.client.send_goal_async(FollowTrajectory.Goal(trajectory=trajectory_to_ros(way)))
        self.sent.clear()
        self.delays.clear()
        aside = np.array([1.4, 0.8, 0.0])
        following = time.perf_counter()
        end = following + seconds
        while time.perf_counter() < end:
            self.tick += 1
            message = poses_to_ros({"epuck1": self.robot, "box": aside}, self.tick / 100)
            self.sent[self.tick] = time.perf_counter()
            self.publisher.publish(message)
            following += 0.01
            while time.perf_counter() < following:
                self.spinner.once(max(0.0005, following - time.perf_counter()))
        return self.delays[50:]


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _open(port: int) -> "subprocess.Popen[bytes]":
    """A reader of the stream that a page reads."""
    address = f"http://127.0.0.1:{port}/events"
    return subprocess.Popen(
        [sys.executable, "-c", _READER, address],
        preexec_fn=die_with_parent,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def _summary(label: str, delays: list[float], course: _Course) -> dict[str, Any]:
    values = 1e3 * np.array(delays)
    p50, p99 = (float(v) for v in np.percentile(values, [50, 99]))
    print(
        f"  {label}: {len(values)} answers: median {p50:.2f} ms, p99 {p99:.2f} ms, "
        f"max {values.max():.2f} ms; unanswered {len(course.sent)}"
    )
    return {"median_ms": p50, "p99_ms": p99, "answers": len(values)}
