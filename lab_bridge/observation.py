"""Observes a lab for a diagnosis or a calibration: what motion capture sends, which robots answer,
and how they move. It uses the drivers of the scenario, without the bridge."""

import os
import sys
import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from rclpy.node import Node

from lab_bridge.capture_diagnosis import CaptureFacts, Sample
from lab_bridge.guard import Guard
from lab_bridge.marker_mapping import Marker, MarkerMapping
from lab_bridge.pose_drivers import PoseHost, make_pose_driver
from lab_bridge.robot_diagnosis import DriveTest
from lab_bridge.robot_drivers import RobotDriver, RobotHost, make_robot_driver
from push_model import se2
from push_model.arrays import Array
from push_ros.process import Spinner
from push_scenario.lab import EPuck2Link, LabSettings
from push_scenario.scenario import Scenario

_KINDS = {
    "pose_stamped": "geometry_msgs/msg/PoseStamped",
    "pose_array": "geometry_msgs/msg/PoseArray",
    "named_pose_array": "motion_capture_tracking_interfaces/msg/NamedPoseArray",
    "tf": "tf2_msgs/msg/TFMessage",
}
_ENOUGH = 60  # poses of each body
_KEPT = 20_000  # samples
_FRESH = 0.5  # [s]
_SPEED, _RATE = 0.04, 0.8  # [m/s], [rad/s] of a test
_AHEAD, _TURN, _REST = 0.7, 0.5, 0.2  # [s]
_SILENCE = 1.0  # [s] in which a robot answers
_ANSWER = 1.3  # [s] for a connection and an answer
_ELSEWHERE = 0.01  # [m] that another robot may not move


class Observer:
    """Drivers of a lab on a node of its own. Close it: that stops the robots."""

    def __init__(self, node: Node, spinner: Spinner, scenario: Scenario) -> None:
        """scenario: with a section ``lab``."""
        assert scenario.lab is not None
        self.scenario, self.lab = scenario, scenario.lab
        self.bodies = (*scenario.robots, *scenario.objects)
        self._node, self._spinner = node, spinner
        self._mapping = MarkerMapping(self.lab, self.bodies)
        self.samples: list[Sample] = []
        self.troubles: list[str] = []
        self.robots: dict[str, RobotDriver] = {}
        self._guard: Guard | None = None
        host = PoseHost(node, self, tuple(self._mapping.bodies))
        self._source = make_pose_driver(host, self.lab.poses)

    # A PoseSink

    def part(self, marker: str, seen: Marker, stamp: float | None) -> None:
        """See PoseSink."""
        self.samples.append(Sample(marker, seen, stamp, time.time()))

    def frame(self, seen: Any, stamp: float | None) -> None:
        """See PoseSink."""
        for marker, one in seen.items():
            self.part(marker, one, stamp)

    def refuse(self, where: str, reason: str) -> None:
        """See PoseSink."""
        self.troubles.append(f"{where}: {reason}")

    # Motion capture

    def watch(self, limit: float) -> None:
        """Listen for limit [s] of wall time, or until every body has been seen often and it is
        clear whether the robots answer."""
        began = time.monotonic()

        def enough() -> bool:
            if self.robots and time.monotonic() - began < _ANSWER:
                return False  # one that accepts but never answers is found by its silence
            if any(driver.trouble for driver in self.robots.values()):
                return False
            counts = [sum(s.marker == m for s in self.samples) for m in self._mapping.bodies]
            return min(counts) >= _ENOUGH

        self.run(limit, enough)

    def capture_facts(self) -> CaptureFacts:
        """What has been observed of motion capture so far."""
        kind = _KINDS.get(self.lab.poses.kind, "")
        full = [self._node.resolve_topic_name(t) for t in self._source.sources] if kind else []
        infos = {t: self._node.get_publishers_info_by_topic(t) for t in full}
        others = [
            name
            for name, types in self._node.get_topic_names_and_types()
            if set(types) & {*_KINDS.values(), "push_msgs/msg/Poses"} and name not in full
        ]
        return CaptureFacts(
            tuple(self._source.sources),
            tuple(self.samples),
            {t: [i.topic_type for i in found] for t, found in infos.items()},
            kind,
            [o for o in others if o != "/tf"],
            tuple(self.troubles),
            os.environ.get("ROS_DOMAIN_ID") or "0",
            os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET"),
        )

    def pose(self, body: str) -> Array | None:
        """Median ``(3,)`` of the newest poses of a body; None where it is not seen now."""
        marker, now = self._mapping.markers[body], time.time()
        newest = [s for s in self.samples[-400:] if s.marker == marker and now - s.arrived < _FRESH]
        placed = [p.pose for s in newest[-9:] if (p := self._mapping.place(body, s.seen))]
        if not placed:
            return None
        table = np.array(placed)
        table[:, 2] = table[-1, 2] + [se2.wrap(float(a - table[-1, 2])) for a in table[:, 2]]
        middle: Array = np.median(table, axis=0)
        return middle

    # Robots

    def connect(self, robots: Collection[str] | None = None) -> None:
        """Begin links to robots, to all by default; they come about while it watches."""
        lab: LabSettings = self.lab
        addresses = []
        for robot, (spec, _) in self.scenario.robots.items():
            if robots is not None and robot not in robots:
                continue
            host, link = RobotHost(self._node, robot, spec, 50.0), lab.robots[robot]
            if isinstance(link, EPuck2Link):
                link = replace(link, silence=min(link.silence, _SILENCE))
                addresses.append((link.host, link.port))
            self.robots[robot] = make_robot_driver(host, link)
        if addresses:
            self._guard = Guard(addresses)

    def link_troubles(self) -> dict[str, str]:
        """Why robots cannot be commanded, by name; empty for those that can."""
        return {n: d.trouble for n, d in self.robots.items()}

    def poll(self) -> None:
        """Handle what is there, for a hundredth of a second."""
        self._spinner.once(0.01)
        now = time.monotonic()
        for driver in self.robots.values():
            driver.poll(now)
        del self.samples[:-_KEPT]

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Go on for some time; whether the condition came about."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.poll()
            if until():
                return True
        return False

    def command(self, robot: str, v: float, omega: float) -> None:
        """Let a robot move [m/s, rad/s] until it is told otherwise."""
        spec = self.scenario.robots[robot][0]
        if spec.kinematics is not None:
            v, omega = spec.kinematics.saturate(v, omega)
        self.robots[robot].command(np.array([v, 0.0, omega]), time.monotonic())

    def move(self, robot: str, v: float, omega: float, seconds: float) -> None:
        """Move for some time, and stop."""
        self.command(robot, v, omega)
        self.run(seconds)
        self.command(robot, 0.0, 0.0)
        self.run(_REST)

    def drive_test(self, robot: str) -> DriveTest | None:
        """Let a robot go ahead and turn, and take both back; None where it is not seen."""
        others: Sequence[str] = [r for r in self.robots if r != robot]
        start = self.pose(robot)
        stood = {r: self.pose(r) for r in others}
        if start is None:
            return None
        self.move(robot, _SPEED, 0.0, _AHEAD)
        ahead = self.pose(robot)
        self.move(robot, 0.0, _RATE, _TURN)
        turned = self.pose(robot)
        moved = [
            r
            for r, before in stood.items()
            if before is not None
            and (after := self.pose(r)) is not None
            and float(np.hypot(*(after - before)[:2])) > _ELSEWHERE
        ]
        self.move(robot, 0.0, -_RATE, _TURN)
        self.move(robot, -_SPEED, 0.0, _AHEAD)
        if ahead is None or turned is None:
            return None
        way = se2.between(start, ahead)
        angle = se2.wrap(float(turned[2] - ahead[2]))
        return DriveTest(_SPEED * _AHEAD, _RATE * _TURN, way, angle, moved)

    def close(self) -> None:
        """Stop all robots, and listen no more."""
        for robot in self.robots:
            self.command(robot, 0.0, 0.0)
        self.run(0.25 if self.robots else 0.0)
        for driver in self.robots.values():
            driver.close(time.monotonic())
        if self._guard is not None and (left := self._guard.release(self.robots)):
            print(left, file=sys.stderr)
        self._source.close()
