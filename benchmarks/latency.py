"""From poses to command across processes at 100 Hz, the controller following a trajectory: alone,
with two readers of what a page reads, and with two pages in browsers on the same cores.

The three take turns, several times, and the medians over the rounds are compared: a burst of other
work on the machine then spoils single rounds and not the result.
"""

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
from pathlib import Path
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
_ROUNDS, _SECONDS = 6, 8.0  # [s] of each measurement
_LOADING, _ENDING = 4.0, 5.0  # [s] for a browser
_READER = "import sys, urllib.request as r\nfor _ in r.urlopen(sys.argv[1], timeout=60): pass"
_MOST = 1.1  # times the p99 without pages


def run() -> dict[str, Any]:
    """Wall time from publishing a frame to receiving its command."""
    claim_domain()
    prepare_environment()
    controller = next(n for n in single(load_scenario("short")) if n.kind == "controller")
    port = _free_port()
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
        beside: dict[str, list[list[str]]] = {"readers": [_reader(port)] * _PAGES}
        browser = shutil.which("chromium") or shutil.which("chromium-browser")
        if browser is None:
            print("  no Chromium is installed: browsers are not measured")
        else:
            profiles = [stack.enter_context(tempfile.TemporaryDirectory()) for _ in range(_PAGES)]
            beside["browsers"] = [_browser(browser, port, profile) for profile in profiles]
        course.follow(_LOADING)  # the first answers take longer
        delays: dict[str, list[np.ndarray]] = {name: [] for name in ("alone", *beside)}
        for count in range(_ROUNDS):
            print(f"  round {count + 1} of {_ROUNDS}", flush=True)
            delays["alone"].append(course.measure())
            for name, commands in beside.items():
                delays[name].append(_beside(port, commands, course))
        rows = {name: _summary(name, rounds) for name, rounds in delays.items()}
        print(f"  unanswered {course.unanswered}")
    alone = rows.pop("alone")
    bounds = {"p99 [ms]": at_most(alone["p99_ms"], 8.0)}
    for name, row in rows.items():
        row["p99_ratio"] = row["p99_ms"] / alone["p99_ms"]
        bounds[f"p99 with {_PAGES} {name} over p99 alone"] = at_most(row["p99_ratio"], _MOST)
    held = {"real_time_priority": priority.held, "unanswered": course.unanswered}
    return {**alone, **rows, **held, "bounds": bounds}


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
        self.unanswered = 0

    def _on_command(self, message: TwistStamped) -> None:
        tick = round(message.header.stamp.sec * 100 + message.header.stamp.nanosec / 1e7)
        if tick in self.sent:
            self.delays.append(time.perf_counter() - self.sent.pop(tick))
        v, omega = message.twist.linear.x, message.twist.angular.z
        self.robot = unicycle_step(self.robot, v, omega, 0.01)

    def follow(self, seconds: float) -> np.ndarray:
        """Delays [s] over a time."""
        there = lambda: (  # noqa: E731
            self.client.server_is_ready() and self.publisher.get_subscription_count() > 0
        )
        if not self.spinner.until(there, 30.0):
            raise RuntimeError("the controller did not come up")
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
        return np.array(self.delays[50:])

    def measure(self) -> np.ndarray:
        """Delays [s] of a round; counts what is not answered."""
        delays = self.follow(_SECONDS)
        self.unanswered += len(self.sent)
        return delays


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _answers(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def _connections(port: int) -> int:
    """Connections that a server at a port of this machine has."""
    lines = Path("/proc/net/tcp").read_text().splitlines()[1:]
    own = f"0100007F:{port:04X}"  # 127.0.0.1
    return sum(line.split()[1] == own and line.split()[3] == "01" for line in lines)


def _reader(port: int) -> list[str]:
    return [sys.executable, "-c", _READER, f"http://127.0.0.1:{port}/events"]


def _browser(browser: str, port: int, profile: str) -> list[str]:
    quiet = ["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run"]
    quiet += ["--disable-background-networking", "--remote-debugging-port=0"]
    return [browser, *quiet, f"--user-data-dir={profile}", f"http://127.0.0.1:{port}/"]


def _beside(port: int, commands: Sequence[list[str]], course: _Course) -> np.ndarray:
    """The delays while the viewer runs, and processes that show its page."""
    words = ["view", "--scenario", "short", "--port", str(port)]
    with ExitStack() as stack:
        logs = Path(stack.enter_context(tempfile.TemporaryDirectory()))  # not among the results
        viewer = Launcher([Child("viewer", "planar_push", words)], logs=logs)
        stack.callback(viewer.stop)
        viewer.start()
        if not course.spinner.until(lambda: _answers(port), 30.0):
            raise RuntimeError("the viewer did not come up")
        quiet = subprocess.DEVNULL
        for command in commands:
            process = subprocess.Popen(
                command,
                preexec_fn=die_with_parent,
                start_new_session=True,
                stdin=quiet,
                stdout=quiet,
                stderr=quiet,
            )
            stack.callback(_end, process)
        course.follow(_LOADING)
        delays = course.measure()
        if _connections(port) < len(commands):
            raise RuntimeError("no page was open")
        return delays


def _end(process: "subprocess.Popen[bytes]") -> None:
    process.terminate()  # a browser ends its own processes
    try:
        process.wait(_ENDING)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _summary(name: str, rounds: Sequence[np.ndarray]) -> dict[str, Any]:
    """Medians over the rounds, and the p99 of all answers together."""
    p50, p99 = 1e3 * np.array([np.percentile(d, [50, 99]) for d in rounds]).T
    everything = 1e3 * np.concatenate(rounds)
    together = float(np.percentile(everything, 99))
    row = {
        "median_ms": float(np.median(p50)),
        "p99_ms": float(np.median(p99)),
        "p99_of_rounds_ms": [round(float(p), 3) for p in p99],
        "p99_together_ms": together,
        "answers": len(everything),
    }
    label = name if name == "alone" else f"{_PAGES} {name}"
    print(
        f"  {label}: {len(everything)} answers; medians of the rounds: median "
        f"{row['median_ms']:.2f} ms, p99 {row['p99_ms']:.2f} ms ({p99.min():.2f} to "
        f"{p99.max():.2f}); p99 of all together {together:.2f} ms, max {everything.max():.2f} ms"
    )
    return row
