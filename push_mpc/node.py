"""The controller node: follows trajectories with the LTV-MPC, driven by the pose stream."""

import math
import sys
import time
from typing import Any

import numpy as np
from geometry_msgs.msg import TwistStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import Header

from push_estimation.pose_gate import PoseGateSettings, Stamp
from push_model.arrays import Array
from push_model.belief import POSES
from push_model.settings import SettingsError
from push_mpc import (
    Push,
    Task,
    Tick,
    TrackerSettings,
    TrajectoryTracker,
    controller_kind,
)
from push_mpc.believed_push import Unstable, believed_push
from push_mpc.line_contact import line_contact
from push_mpc.settings import ControllerSettings
from push_mpc.tick_report import tick_report
from push_msgs.action import FollowTrajectory
from push_msgs.msg import ControllerStatus, Report
from push_ros.actions import GoalServer
from push_ros.belief_feed import BeliefFeed
from push_ros.conversions import (
    circles_from_ros,
    limits_from_ros,
    trajectory_from_ros,
    twist_to_ros,
)
from push_ros.diagnostics import Diagnostics
from push_ros.heartbeat import HeartbeatWatch
from push_ros.names import inside, names_of_robot
from push_ros.parameters import declare_settings
from push_ros.pose_feed import Frame, PoseFeed
from push_ros.process import run_node
from push_ros.qos import COMMAND, STATUS
from push_ros.report_conversions import report_to_ros
from push_ros.validation import FRAME, InvalidMessage, check_frame, finite, planar_pose
from push_scenario.scenario import Scenario, load_scenario

_TICK = 0.01  # [s] assumed where the time since the last frame is not known
_FEEDBACK_EVERY = 10  # frames
_REPORTS = 0.05  # [s] of pose time between reports
_WATCH = 0.05  # [s] wall time between looks at the pose stream


class ControllerNode(Node):
    """Answers every frame of the pose stream with a command, zero when it has no task."""

    def __init__(
        self, scenario: Scenario | None = None, robot: str = "", namespace: str = ""
    ) -> None:
        """namespace: the world's; the node lives in its robot's below it."""
        super().__init__("controller", namespace=inside(namespace, robot))
        name = self.declare_parameter("scenario", "env1-target1").value
        robot = str(self.declare_parameter("robot", robot).value)
        self._scenario = scenario or load_scenario(str(name))
        self.robot, spec = self._scenario.robot(robot)
        names = names_of_robot(self, self.robot)
        values = dict(self._scenario.parameters.get("controller", {}))
        sections = {k: values.pop(k, {}) for k in ("mpc", "tracker", "poses")}
        own = declare_settings(self, ControllerSettings, values, where="controller")
        self._spec, self._drive = spec, spec.differential
        self._controller = own.controller
        self._kind = controller_kind(own.controller)
        self._mpc_settings = declare_settings(
            self, self._kind.settings, sections["mpc"], "mpc", "controller.mpc", self._apply_mpc
        )
        self._tracker_settings = declare_settings(
            self,
            TrackerSettings,
            sections["tracker"],
            "tracker",
            "controller.tracker",
            self._apply_tracker,
        )
        self._rebuild()
        poses = declare_settings(
            self, PoseGateSettings, sections["poses"], "poses", "controller.poses"
        )
        self._others = {  # [m] least distance of the axle midpoint to the middle of each body
            other: spec.body_radius + radius
            for other, radius in self._scenario.radii.items()
            if other != self.robot
        }
        self._object = ""
        self._told_push: Push | None = None  # as it was planned
        self._pushing = False
        self._held = 0.0  # [s] without a pose that this task needs
        self._ticks = 0
        self._last_stamp = Header().stamp
        self._reason = "no task"
        self._mode = ControllerStatus.IDLE
        self._diagnostics = Diagnostics(self, names, self._state)
        self._beliefs = BeliefFeed(
            self, names, self._scenario, self._diagnostics, lambda belief: self._take_up()
        )
        self._reports = self.create_publisher(Report, names.robot(self.robot, "report"), STATUS)
        self._reported = -math.inf
        topic = names.robot(self.robot, "cmd_vel")
        self._command_publisher = self.create_publisher(
            TwistStamped, topic, COMMAND, event_callbacks=self._diagnostics.publisher_events(topic)
        )
        self._status_publisher = self.create_publisher(
            ControllerStatus, names.robot(self.robot, "controller/status"), STATUS
        )
        self._server = GoalServer(
            self,
            FollowTrajectory,
            names.robot(self.robot, "follow_trajectory"),
            check=self._check,
            start=self._begin,
            cancel=self._canceled,
            preempt=lambda request: self._preempt(),
        )
        bodies = {self.robot, *self._scenario.objects, *self._others}
        self._poses = PoseFeed(self, names, poses, bodies, self._diagnostics, self._on_frame)
        self._heartbeat = HeartbeatWatch(self, names, self.robot, self._poses, self._diagnostics)
        self._watched = time.monotonic()
        self._watchdog = self.create_timer(
            _WATCH, self._on_watchdog, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

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
            item, robot = belief.object(self._object), belief.robot(self.robot)
            try:
                push = believed_push(told, robot, item)
            except Unstable as error:
                self._end(FollowTrajectory.Result.SOLVER_FAILED, str(error))
        self.tracker.believe(push, delay)

    def _check(self, request: Any) -> None:
        """Raise InvalidMessage unless the goal is a task."""
        self._parse(request)

    def _parse(self, request: Any) -> tuple[Task, float]:
        """A task from a goal; raises InvalidMessage."""
        check_frame(request.trajectory.header.frame_id, "the trajectory")
        finite(request.heartbeat_timeout, "the heartbeat timeout")
        if request.heartbeat_timeout < 0.0:
            raise InvalidMessage(
                "the heartbeat timeout must not be negative; 0 turns the check off"
            )
        trajectory = trajectory_from_ros(request.trajectory)
        tolerances = (request.position_tolerance, request.orientation_tolerance)
        finite(tolerances, "a tolerance")
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
        elif request.mode != FollowTrajectory.Goal.MOVE:
            raise InvalidMessage(f"unknown mode {request.mode}")
        if min(tolerances) < 0.0:
            raise InvalidMessage("a tolerance must not be negative")
        s = self._tracker_settings
        return Task(
            trajectory,
            push,
            circles_from_ros(request.obstacles),
            tolerances[0] or s.position_tolerance,
            tolerances[1] or s.orientation_tolerance,
        ), float(request.heartbeat_timeout)

    def _begin(self, request: Any) -> None:
        task, heartbeat_timeout = self._parse(request)
        self._object, self._pushing = request.object, task.push is not None
        self._heartbeat.begin(heartbeat_timeout)
        self._held = 0.0
        self.tracker.start(task)
        self._told_push = task.push
        if self._beliefs.current.values:
            self._take_up()
        self._mode = ControllerStatus.PUSH if task.push else ControllerStatus.MOVE
        self._reason = "following a trajectory"

    def _preempt(self) -> None:
        if self._server.active:
            self._end(FollowTrajectory.Result.PREEMPTED, "a new trajectory replaces this one")

    def _canceled(self) -> None:
        self._end(FollowTrajectory.Result.CANCELED, "canceled")
        self._publish_command(0.0, 0.0)

    def _end(self, code: int, message: str, tick: Tick | None = None) -> None:
        self.tracker.stop()
        self._mode = ControllerStatus.IDLE
        self._reason = message or "done"
        self._server.finish(self._result(code, message, tick), success=code == 0)

    def _result(self, code: int, message: str, tick: Tick | None = None) -> Any:
        result = FollowTrajectory.Result(error_code=int(code), error_msg=message)
        if tick is not None:
            result.position_error = tick.position_error
            result.orientation_error = tick.orientation_error
        return result

    def _on_frame(self, frame: Frame) -> None:
        self._last_stamp = frame.stamp
        if frame.verdict is Stamp.REFUSED:
            self._publish_command(0.0, 0.0)  # whatever time it is: stand still
            return
        if frame.verdict is Stamp.RESET:
            self._heartbeat.reset()
            if self.tracker.active:
                self._end(FollowTrajectory.Result.CLOCK_RESET, "the clock jumped back")
        if frame.verdict is Stamp.RESUMED:
            self.tracker.halt()
        self._step(frame.elapsed or _TICK, frame.seen)

    def _step(self, dt: float, seen: frozenset[str]) -> None:
        tracker = self.tracker
        if tracker.active and self._heartbeat.lost:
            self._end(FollowTrajectory.Result.PREEMPTED, "no heartbeat of the supervisor arrives")
        if not tracker.active:
            tracker.rest(dt)
            self._publish_command(0.0, 0.0)
            self._publish_status(None)
            return
        self._ticks += 1
        robot = self._poses.pose(self.robot)
        item = self._poses.pose(self._object) if self._pushing else None
        if robot is None or (self._pushing and item is None):
            self._hold(dt, self.robot if robot is None else self._object)
            return
        self._held = 0.0
        age = self._poses.gate.age(self.robot)
        item = item if self._object in seen else None
        tick = tracker.tick(dt, robot, item, self._bodies(), age)
        self._publish_command(tick.v, tick.omega)
        failed = tick.solve is not None and not tick.solve.solved
        self._mode = (
            ControllerStatus.FALLBACK
            if failed
            else (ControllerStatus.PUSH if self._pushing else ControllerStatus.MOVE)
        )
        self._reason = tick.solve.reason if failed and tick.solve else "following a trajectory"
        self._publish_status(tick)
        if tick.finished:
            self._end(int(tick.code), tick.message, tick)
        elif self._ticks % _FEEDBACK_EVERY == 0:
            self._server.feedback(
                FollowTrajectory.Feedback(
                    progress=tick.progress,
                    position_error=tick.position_error,
                    orientation_error=tick.orientation_error,
                )
            )

    def _hold(self, dt: float, missing: str) -> None:
        """Stand still while a pose that the task needs is missing; give up after a while."""
        self.tracker.rest(dt)
        self._mode = ControllerStatus.HOLD
        self._reason = f"no valid pose of {missing}"
        self._held += dt
        if self._held > self.tracker.settings.give_up:
            why = f"{self._reason} for {self._held:.1f} s"
            self._end(FollowTrajectory.Result.POSES_STALE, why)
        if self._ticks % _FEEDBACK_EVERY == 0:
            self._server.feedback(FollowTrajectory.Feedback())
        self._publish_command(0.0, 0.0)
        self._publish_status(None)

    def _bodies(self) -> Array:
        """Other bodies to keep away from ``(n, 3)``: x, y, least distance of the axle midpoint.

        One that came closer than that is not fled from: it must come no closer.
        """
        rows = []
        me = self._poses.pose(self.robot)
        for name, reach in self._others.items():
            pose = None if name == self._object else self._poses.pose(name)
            if pose is not None and me is not None:
                gap = math.hypot(pose[0] - me[0], pose[1] - me[1])
                rows.append((pose[0], pose[1], min(reach, gap)))
        return np.array(rows, dtype=np.float64).reshape(-1, 3)

    def _publish_command(self, v: float, omega: float) -> None:
        if not (math.isfinite(v) and math.isfinite(omega)):
            v = omega = 0.0
        self._command_publisher.publish(twist_to_ros(v, omega, self._last_stamp))

    def _publish_status(self, tick: Tick | None) -> None:
        message = ControllerStatus(
            mode=self._mode,
            robot=self.robot,
            reason=self._reason,
            solves=self.tracker.solves,
            failures=self.tracker.failures,
            curvature_margin=math.inf,
            obstacle_margin=math.inf,
        )
        message.header.stamp = self._last_stamp
        message.header.frame_id = FRAME
        if tick is not None:
            e = tick.error
            message.error_x, message.error_y, message.error_theta = (
                float(e[0]),
                float(e[1]),
                float(e[2]),
            )
            message.error_v, message.error_omega = float(e[3]), float(e[4])
            message.v, message.omega = tick.v, tick.omega
            message.curvature_margin = tick.curvature_margin
            message.obstacle_margin = tick.obstacle_margin
            message.object_offset_y = tick.object_offset
            if tick.solve is not None:
                message.solve_time = tick.solve.solve_time
                message.slack = tick.solve.slack
        self._status_publisher.publish(message)
        if tick is not None and self._poses.stamp - self._reported >= _REPORTS - 1e-9:
            self._reported = self._poses.stamp
            report = tick_report(tick, self._pushing)
            self._reports.publish(
                report_to_ros(report, self._last_stamp, self._controller, self._object)
            )

    def _on_watchdog(self) -> None:
        """Wall time: the pose stream may be dead, and with it every other clock."""
        now = time.monotonic()
        held_up, self._watched = now - self._watched > 2.0 * _WATCH, now
        if held_up:  # it was this process that stood still: what came meanwhile comes first
            return
        silence = self._poses.silence
        if not self.tracker.active or silence < 2.0 * self._poses.gate.settings.timeout:
            return
        self.tracker.halt()
        self._publish_command(0.0, 0.0)
        if silence > self.tracker.settings.give_up:
            self._end(FollowTrajectory.Result.POSES_STALE, f"no poses for {silence:.1f} s")

    def stop(self) -> None:
        """Last act of a live process: a zero command."""
        self._publish_command(0.0, 0.0)

    def _state(self) -> dict[str, Any]:
        stale = self.tracker.active and self._poses.silence > 0.3
        return {
            "mode": self._mode,
            "reason": self._reason,
            "solves": self.tracker.solves,
            "failures": self.tracker.failures,
            "poses refused": self._poses.gate.refused,
            "pose jumps": self._poses.gate.jumps,
            "warning": "poses are stale" if stale else "",
        }


def main() -> int:
    """Entry point of the process: ``--ros-args`` on its command line."""
    return run_node(ControllerNode)


if __name__ == "__main__":
    sys.exit(main())
