"""From poses to command across processes at 100 Hz, the controller following a trajectory: alone,
with two readers of what a page reads, and with two pages in browsers on the same cores."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
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
from push_ros.scheduling import RealTimePriority, Urgency
from push_scenario.scenario import load_scenario

_PAGES = 2
_LOADING, _ENDING = 4.0, 5.0  # [s] for a browser
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
        priority = RealTimePriority(Urgency.WORLD, print)  # as the bridge, whose place it takes
        stack.callback(priority.close)
        print(f"  {priority.refusal or 'real-time priority: yes'}")
        alone = _summary("alone", course.follow(seconds), course)
        second = Launcher([page])
        stack.callback(second.stop)
        second.start()
        course.follow(0.0)  # until the viewer is there
        beside = {"readers": _beside("readers", [_reader(port)] * _PAGES, course, seconds)}
        browser = shutil.which("chromium") or shutil.which("chromium-browser")
        if browser is None:
            print("  no Chromium is installed: browsers are not measured")
        else:
            profiles = [stack.enter_context(tempfile.TemporaryDirectory()) for _ in range(_PAGES)]
            words = [_browser(browser, port, profile) for profile in profiles]
            beside["browsers"] = _beside("browsers", words, course, seconds)
    for name, row in beside.items():
        row["p99_ratio"] = row["p99_ms"] / alone["p99_ms"]
        print(f"  p99 with {_PAGES} {name} over p99 alone: {row['p99_ratio']:.2f}")
    held = {"real_time_priority": priority.held}
    return {**alone, **beside, **held, "bounds": {"p99 [ms]": at_most(alone["p99_ms"], 8.0)}}


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


def _reader(port: int) -> list[str]:
    return [sys.executable, "-c", _READER, f"http://127.0.0.1:{port}/events"]


def _browser(browser: str, port: int, profile: str) -> list[str]:
    quiet = ["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run"]
    quiet += ["--disable-background-networking", "--remote-debugging-port=0"]
    return [browser, *quiet, f"--user-data-dir={profile}", f"http://127.0.0.1:{port}/"]


def _beside(
    name: str, commands: Sequence[list[str]], course: _Course, seconds: float
) -> dict[str, Any]:
    """The delays while processes run that show the page."""
    quiet = subprocess.DEVNULL
    running = [
        subprocess.Popen(
            words,
            preexec_fn=die_with_parent,
            start_new_session=True,
            stdin=quiet,
            stdout=quiet,
            stderr=quiet,
        )
        for words in commands
    ]
    try:
        course.follow(_LOADING)
        return _summary(f"{len(running)} {name}", course.follow(seconds), course)
    finally:
        for process in running:
            process.terminate()  # a browser ends its own processes
            try:
                process.wait(_ENDING)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


def _summary(label: str, delays: list[float], course: _Course) -> dict[str, Any]:
    values = 1e3 * np.array(delays)
    p50, p99 = (float(v) for v in np.percentile(values, [50, 99]))
    print(
        f"  {label}: {len(values)} answers: median {p50:.2f} ms, p99 {p99:.2f} ms, "
        f"max {values.max():.2f} ms; unanswered {len(course.sent)}"
    )
    return {"median_ms": p50, "p99_ms": p99, "answers": len(values)}
