"""The LTV-MPC as a ROS node: ``poses`` in, ``cmd_vel`` out.

It pushes, keeps off other bodies, uses what is believed of robot and object, and reports.
"""

import math
import sys
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from geometry_msgs.msg import TwistStamped

from push_estimation.pose_gate import PoseGateSettings
from push_model.arrays import Array
from push_model.belief import POSES
from push_model.settings import SettingsError
from push_model.stick_certificate import ContactBelief
from push_model.trajectory import Trajectory
from push_mpc import Push, Task, Tick, TrackerSettings, TrajectoryTracker, controller_kind
from push_mpc.believed_push import Unstable, believed_push
from push_mpc.follower_node import Command, Followed, FollowerKind, FollowerNode
from push_mpc.line_contact import line_contact
from push_mpc.other_bodies import kept_off
from push_mpc.settings import ControllerSettings
from push_mpc.tick_report import tick_report
from push_msgs.action import FollowTrajectory
from push_msgs.msg import Report
from push_ros.belief_feed import BeliefFeed
from push_ros.conversions import (
    circles_from_ros,
    limits_from_ros,
    trajectory_from_ros,
    twist_to_ros,
)
from push_ros.parameters import declare_settings
from push_ros.pose_feed import Frame
from push_ros.process import run_node
from push_ros.qos import COMMAND, STATUS
from push_ros.report_conversions import report_to_ros
from push_ros.scheduling import Urgency
from push_ros.validation import InvalidMessage, planar_pose
from push_scenario.scenario import Scenario

_SAME = 1e-6  # [m], [rad] between poses in which two pushes begin
_REPORTS = 0.05  # [s] of pose time between reports


class VelocityFollower:
    """Drives a robot by v [m/s] and omega [rad/s], see Follower."""

    sender = "supervisor"

    def __init__(self, shell: FollowerNode) -> None:
        self._shell, self._scenario, self._spec = shell, shell.scenario, shell.spec
        robot, names, diagnostics = shell.robot, shell.names, shell.diagnostics
        self._robot, self._drive = robot, shell.spec.differential
        self._declare(dict(self._scenario.parameters.get("controller", {})))
        self._others = {  # [m] least distance of the axle midpoint to the middle of each body
            other: self._spec.body_radius + radius
            for other, radius in self._scenario.radii.items()
            if other != robot
        }
        self.bodies: Collection[str] = {robot, *self._scenario.objects, *self._others}
        self._object = ""
        self._told_push: Push | None = None  # as it was planned
        self._alarmed = False  # in this push
        self._beliefs = BeliefFeed(
            shell, names, self._scenario, diagnostics, lambda belief: self._take_up()
        )
        self._reports = shell.create_publisher(Report, names.robot(robot, "report"), STATUS)
        self._reported = -math.inf
        topic = names.robot(robot, "cmd_vel")
        self._commands = shell.create_publisher(
            TwistStamped, topic, COMMAND, event_callbacks=diagnostics.publisher_events(topic)
        )

    def _declare(self, values: dict[str, Any]) -> None:
        shell, where = self._shell, "controller"
        mpc, tracker, poses = (values.pop(k, {}) for k in ("mpc", "tracker", "poses"))
        own = declare_settings(shell, ControllerSettings, values, where=where)
        self._controller = own.controller
        self._kind = controller_kind(self._controller)
        self._mpc_settings = declare_settings(
            shell, self._kind.settings, mpc, "mpc", f"{where}.mpc", self._apply_mpc
        )
        self._tracker_settings = declare_settings(
            shell, TrackerSettings, tracker, "tracker", f"{where}.tracker", self._apply_tracker
        )
        self._rebuild()
        self.gate = declare_settings(shell, PoseGateSettings, poses, "poses", f"{where}.poses")

    def _busy(self) -> None:
        if self.tracker.active:
            raise SettingsError("the controller is busy; change its parameters when it is idle")

    def _apply_mpc(self, settings: Any) -> None:
        self._busy()
        self._mpc_settings = settings
        self._rebuild()

    def _apply_tracker(self, settings: TrackerSettings) -> None:
        self._busy()
        self._tracker_settings = settings
        self._rebuild()

    def _rebuild(self) -> None:
        self.tracker = TrajectoryTracker(
            self._tracker_settings, self._kind.make(self._mpc_settings, self._drive)
        )
        self.tracker.warm_up()

    def _take_up(self) -> None:
        """Go on with what is believed now: a push under way too."""
        belief, told = self._beliefs.current, self._told_push
        delay = self._tracker_settings.pose_delay
        if (POSES, "latency") in belief.values:
            delay = belief.latency.value
        push = None
        if self.tracker.active and told is not None:
            item, robot = belief.object(self._object), belief.robot(self._robot)
            try:
                push = believed_push(told, robot, item, ContactBelief.of(belief, self._object))
            except Unstable as error:
                self._shell.end(FollowTrajectory.Result.SOLVER_FAILED, str(error))
        self.tracker.believe(push, delay)

    def parse(self, request: Any) -> Task:
        """See Follower."""
        trajectory = trajectory_from_ros(request.trajectory)
        push = None
        if request.object and request.object not in self._scenario.objects:
            raise InvalidMessage(f"unknown object '{request.object}'")
        if request.mode == FollowTrajectory.Goal.PUSH:
            if not request.object:
                raise InvalidMessage("a push needs the name of its object")
            grasp = planar_pose(request.contact, "the contact")
            item = self._beliefs.current.object(request.object)
            line = line_contact(self._spec, item, grasp)
            push = Push(grasp, limits_from_ros(request), line)
            if request.going_on:
                self._check_going_on(request.object, trajectory)
        elif request.going_on:
            raise InvalidMessage("only a push can go on where another one is")
        elif request.mode != FollowTrajectory.Goal.MOVE:
            raise InvalidMessage(f"unknown mode {request.mode}")
        s = self._tracker_settings
        return Task(
            trajectory,
            push,
            circles_from_ros(request.obstacles),
            request.position_tolerance or s.position_tolerance,
            request.orientation_tolerance or s.orientation_tolerance,
        )

    def _check_going_on(self, item: str, trajectory: Trajectory) -> None:
        """Raise InvalidMessage unless a push of the object is under way that begins like this."""
        old = self.tracker.trajectory if self._told_push is not None else None
        if old is None or item != self._object:
            raise InvalidMessage(f"there is no push of '{item}' to go on with")
        if np.abs(trajectory.pose[0] - old.pose[0]).max() > _SAME:
            raise InvalidMessage("the push under way begins in another pose")

    def begin(self, request: Any, task: Task) -> None:
        """See Follower."""
        self._object, self._told_push = request.object, task.push
        self._alarmed = False
        self._reported = -math.inf  # the clock may have been reset
        self.tracker.start(task, bool(request.going_on))
        if self._beliefs.current.values:
            self._take_up()

    def missing(self, frame: Frame) -> str:
        """See Follower: a push needs its object, too; poses that were seen lately will do."""
        poses = self._shell.poses
        if poses.pose(self._robot) is None:
            return self._robot
        if self._told_push is not None and poses.pose(self._object) is None:
            return self._object
        return ""

    def tick(self, dt: float, frame: Frame) -> Followed:
        """See Follower."""
        poses = self._shell.poses
        robot, item = poses.pose(self._robot), None
        assert robot is not None
        if self._told_push is not None and self._object in frame.seen:
            item = poses.pose(self._object)
        age = poses.gate.age(self._robot)
        tick = self.tracker.tick(dt, robot, item, self._around(robot), age)
        if tick.alarm and not tick.finished and not self._alarmed:
            self._alarmed = True
            self._shell.get_logger().warning(tick.alarm)
        failed = tick.solve is not None and not tick.solve.solved
        return Followed(
            (tick.v, tick.omega),
            tick.finished,
            int(tick.code),
            tick.message,
            tick.progress,
            (tick.position_error, tick.orientation_error),
            tick.solve.reason if failed and tick.solve else "",
            _fields(tick),
            tick,
        )

    def _around(self, me: Array) -> Array:
        """Other bodies ``(n, 3)`` to keep away from."""
        others = {name: reach for name, reach in self._others.items() if name != self._object}
        return kept_off(me, self._shell.poses.discs(others))

    def rest(self, dt: float, frame: Frame) -> Command:
        """See Follower."""
        self.tracker.rest(dt)
        return None

    def refused(self) -> Command:
        """See Follower."""
        self.tracker.rest(0.0)
        return None

    def halt(self) -> None:
        """See Follower."""
        self.tracker.halt()

    def canceled(self) -> None:
        """See Follower: it stops at once."""
        self._shell.send(None)

    def send(self, command: Command, stamp: Any) -> None:
        """See Follower."""
        v, omega = command or (0.0, 0.0)
        if not (math.isfinite(v) and math.isfinite(omega)):
            v = omega = 0.0
        self._commands.publish(twist_to_ros(v, omega, stamp))

    def fields(self) -> Mapping[str, float]:
        """See Follower."""
        return {}

    def show(self, followed: Followed) -> None:
        """See Follower: the report."""
        shell = self._shell
        if not followed.finished and shell.poses.stamp - self._reported < _REPORTS - 1e-9:
            return
        self._reported = shell.poses.stamp
        report = tick_report(followed.tick, self._told_push is not None)
        self._reports.publish(report_to_ros(report, shell.stamp, self._controller, self._object))


def _fields(tick: Tick) -> dict[str, float]:
    fields = {
        **dict(zip(("error_x", "error_y", "error_theta"), map(float, tick.error[:3]), strict=True)),
        "error_v": float(tick.error[3]),
        "error_omega": float(tick.error[4]),
        "v": tick.v,
        "omega": tick.omega,
        "curvature_margin": tick.curvature_margin,
        "obstacle_margin": tick.obstacle_margin,
        "object_offset_y": tick.object_offset,
    }
    if tick.solve is not None:
        fields |= {"solve_time": tick.solve.solve_time, "slack": tick.solve.slack}
    return fields


CONTROLLER = FollowerKind("controller", "env1-target1", VelocityFollower)


class ControllerNode(FollowerNode):
    """A shell around a ``VelocityFollower``."""

    def __init__(
        self, scenario: Scenario | None = None, robot: str = "", namespace: str = ""
    ) -> None:
        """namespace: the world's; the node lives in its robot's below it."""
        super().__init__(CONTROLLER, scenario, robot, namespace)


def main() -> int:
    """Entry point of the process: ``--ros-args`` on its command line."""
    return run_node(ControllerNode, urgency=Urgency.CONTROL)


if __name__ == "__main__":
    sys.exit(main())
