"""The wheel-slip NMPC as a ROS node: ``poses`` and ``joint_states`` in, ``wheel_torques`` out.

A frame is answered by torques while a trajectory is followed, by a standing command otherwise: a
robot of this kind holds its wheels when it is told a velocity.
"""

import math
import sys
import time
from typing import Any

import numpy as np
from geometry_msgs.msg import TwistStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from push_estimation.pose_gate import PoseGateSettings, Stamp
from push_model.settings import SettingsError
from push_mpc.torque_friction import FrictionTrustSettings
from push_mpc.torque_observer import TorqueObserverSettings
from push_mpc.torque_tracker import TorqueTick, TorqueTracker, TorqueTrackerSettings
from push_mpc.torque_wheels import WheelFeed
from push_mpc.wheel_slip_nmpc import WheelSlipNmpc, WheelSlipSettings
from push_msgs.action import FollowTrajectory
from push_msgs.msg import ControllerStatus, WheelTorques
from push_ros.actions import GoalServer
from push_ros.conversions import time_from_ros, trajectory_from_ros, twist_to_ros
from push_ros.diagnostics import Diagnostics
from push_ros.heartbeat import HeartbeatWatch
from push_ros.names import inside, names_of_robot
from push_ros.parameters import declare_settings
from push_ros.pose_feed import Frame, PoseFeed
from push_ros.process import run_node
from push_ros.qos import COMMAND, STATUS, STREAM
from push_ros.validation import FRAME, InvalidMessage, check_frame, finite
from push_scenario.scenario import Scenario, load_scenario

_TICK = 0.01  # [s] assumed where the time since the last frame is not known
_FEEDBACK_EVERY = 10  # frames
_WATCH = 0.05  # [s] wall time between looks at the pose stream


class TorqueControllerNode(Node):
    """Answers every frame of the pose stream."""

    def __init__(
        self, scenario: Scenario | None = None, robot: str = "", namespace: str = ""
    ) -> None:
        """namespace: the world's; the node lives in its robot's below it."""
        super().__init__("torque_controller", namespace=inside(namespace, robot))
        name = self.declare_parameter("scenario", "pioneer").value
        robot = str(self.declare_parameter("robot", robot).value)
        self._scenario = scenario or load_scenario(str(name))
        self.robot, spec = self._scenario.robot(robot)
        names = names_of_robot(self, self.robot)
        values = dict(self._scenario.parameters.get("torque_controller", {}))
        sections = {
            k: values.pop(k, {}) for k in ("nmpc", "tracker", "observer", "friction", "poses")
        }
        if values:
            raise SettingsError(f"torque_controller: unknown key '{next(iter(values))}'")

        def declared(cls: type[Any], section: str) -> Any:
            where = f"torque_controller.{section}"
            return declare_settings(self, cls, sections[section], section, where)

        nmpc = WheelSlipNmpc(declared(WheelSlipSettings, "nmpc"), spec)
        nmpc.warm_up()
        self.tracker = TorqueTracker(
            declared(TorqueTrackerSettings, "tracker"),
            nmpc,
            declared(TorqueObserverSettings, "observer"),
            declared(FrictionTrustSettings, "friction"),
        )
        self._held = 0.0  # [s] without a pose of the robot
        self._wheels = WheelFeed()
        self._ticks = 0
        self._last_stamp = Header().stamp
        self._mode, self._reason = ControllerStatus.IDLE, "no task"
        self._diagnostics = Diagnostics(self, names, self._state)
        events = self._diagnostics.publisher_events
        topics = [names.robot(self.robot, t) for t in ("wheel_torques", "cmd_vel")]
        self._torques = self.create_publisher(
            WheelTorques, topics[0], COMMAND, event_callbacks=events(topics[0])
        )
        self._stand = self.create_publisher(
            TwistStamped, topics[1], COMMAND, event_callbacks=events(topics[1])
        )
        self._status = self.create_publisher(
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
        gate = declared(PoseGateSettings, "poses")
        self._poses = PoseFeed(self, names, gate, {self.robot}, self._diagnostics, self._on_frame)
        joints = names.robot(self.robot, "joint_states")
        events = self._diagnostics.subscription_events
        self.create_subscription(
            JointState, joints, self._on_wheels, STREAM, event_callbacks=events(joints)
        )
        self._heartbeat = HeartbeatWatch(self, names, self.robot, self._poses, self._diagnostics)
        self._watched = time.monotonic()
        self._watchdog = self.create_timer(
            _WATCH, self._on_watchdog, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def _check(self, request: Any) -> None:
        """Raise InvalidMessage unless the goal is a trajectory of the robot alone."""
        check_frame(request.trajectory.header.frame_id, "the trajectory")
        finite(request.heartbeat_timeout, "the heartbeat timeout")
        if request.heartbeat_timeout < 0.0:
            raise InvalidMessage(
                "the heartbeat timeout must not be negative; 0 turns the check off"
            )
        if request.mode != FollowTrajectory.Goal.MOVE:
            raise InvalidMessage(
                "the torque controller accepts only the mode MOVE; an object that is pushed is "
                "a disturbance"
            )
        trajectory_from_ros(request.trajectory)

    def _begin(self, request: Any) -> None:
        self._heartbeat.begin(float(request.heartbeat_timeout))
        self._held = 0.0
        self.tracker.start(trajectory_from_ros(request.trajectory))
        self._mode, self._reason = ControllerStatus.MOVE, "following a trajectory"

    def _preempt(self) -> None:
        if self._server.active:
            self._end(FollowTrajectory.Result.PREEMPTED, "a new trajectory replaces this one")

    def _canceled(self) -> None:
        self._end(FollowTrajectory.Result.CANCELED, "canceled")  # it brakes from the next frame on

    def _end(self, code: int, message: str, tick: TorqueTick | None = None) -> None:
        self.tracker.stop()
        self._mode, self._reason = ControllerStatus.IDLE, message or "done"
        result = FollowTrajectory.Result(error_code=int(code), error_msg=message)
        if tick is not None:
            result.position_error = math.hypot(float(tick.error[0]), float(tick.error[1]))
            result.orientation_error = abs(float(tick.error[2]))
        self._server.finish(result, success=code == 0)

    def _on_frame(self, frame: Frame) -> None:
        self._last_stamp = frame.stamp
        if frame.verdict is Stamp.REFUSED:
            self._publish(None)  # whatever time it is: stand still
            return
        if frame.verdict is Stamp.RESET:
            self._heartbeat.reset()
            if self.tracker.active:
                self._end(FollowTrajectory.Result.CLOCK_RESET, "the clock jumped back")
        dt = frame.elapsed or _TICK
        pose = self._poses.pose(self.robot) if self.robot in frame.seen else None
        if self.tracker.active and self._heartbeat.lost:
            self._end(FollowTrajectory.Result.PREEMPTED, "no heartbeat of the sender arrives")
        if not self.tracker.active or pose is None:
            self._wait(dt, pose)
            return
        self._held, self._ticks = 0.0, self._ticks + 1
        wheels = self._wheels.at(time_from_ros(frame.stamp))
        tick = self.tracker.tick(dt, pose, wheels)
        self._publish(tick.torques)
        failed = tick.solve is not None and not tick.solve.solved
        self._mode = ControllerStatus.FALLBACK if failed else ControllerStatus.MOVE
        if failed and tick.solve is not None:
            self._reason = tick.solve.reason
        self._publish_status(tick)
        if tick.finished:
            self._end(int(tick.code), tick.message, tick)
        elif self._ticks % _FEEDBACK_EVERY == 0:
            self._server.feedback(FollowTrajectory.Feedback(progress=tick.progress))

    def _on_wheels(self, message: JointState) -> None:
        """Two wheels, left and right; others say nothing."""
        why = self._wheels.take(
            time_from_ros(message.header.stamp),
            np.array(message.position, dtype=np.float64),
            np.array(message.velocity, dtype=np.float64),
        )
        if why:
            self._diagnostics.refuse("joint_states", why)

    def _wait(self, dt: float, pose: Any) -> None:
        """Stand; a trajectory waits for a pose, but not for ever."""
        self._publish(self.tracker.rest(dt, pose))
        if self.tracker.active:
            self._mode, self._reason = ControllerStatus.HOLD, f"no valid pose of {self.robot}"
            self._held += dt
            if self._held > self.tracker.settings.give_up:
                why = f"{self._reason} for {self._held:.1f} s"
                self._end(FollowTrajectory.Result.POSES_STALE, why)
        self._publish_status(None)

    def _publish(self, torques: tuple[float, float] | None) -> None:
        if torques is None or not all(map(math.isfinite, torques)):
            self._stand.publish(twist_to_ros(0.0, 0.0, self._last_stamp))
            return
        message = WheelTorques(right=torques[0], left=torques[1])
        message.header.stamp = self._last_stamp
        message.header.frame_id = "base_link"
        self._torques.publish(message)

    def _publish_status(self, tick: TorqueTick | None) -> None:
        tracker = self.tracker
        message = ControllerStatus(
            mode=self._mode,
            robot=self.robot,
            reason=self._reason,
            solves=tracker.solves,
            failures=tracker.failures,
            curvature_margin=math.inf,
            obstacle_margin=math.inf,
            v=tracker.observer.v,
            omega=tracker.observer.omega,
        )
        message.header.stamp = self._last_stamp
        message.header.frame_id = FRAME
        if tick is not None:
            message.error_x, message.error_y, message.error_theta = map(float, tick.error)
            if tick.solve is not None:
                message.solve_time = tick.solve.solve_time
                message.slack = tick.solve.violation
        self._status.publish(message)

    def _on_watchdog(self) -> None:
        """Wall time: the pose stream may be dead, and with it every other clock."""
        now = time.monotonic()
        held_up, self._watched = now - self._watched > 2.0 * _WATCH, now
        silence = self._poses.silence
        if held_up or not self.tracker.active:
            return
        if silence < 2.0 * self._poses.gate.settings.timeout:
            return
        self._publish(None)
        if silence > self.tracker.settings.give_up:
            self._end(FollowTrajectory.Result.POSES_STALE, f"no poses for {silence:.1f} s")

    def stop(self) -> None:
        """Last act of a live process: stand."""
        self._publish(None)

    def _state(self) -> dict[str, Any]:
        stale = self.tracker.active and self._poses.silence > 0.3
        return {
            "mode": self._mode,
            "reason": self._reason,
            "solves": self.tracker.solves,
            "failures": self.tracker.failures,
            "poses refused": self._poses.gate.refused,
            "warning": "poses are stale" if stale else "",
        }


def main() -> int:
    """Entry point of the process: ``--ros-args`` on its command line."""
    return run_node(TorqueControllerNode)


if __name__ == "__main__":
    sys.exit(main())
