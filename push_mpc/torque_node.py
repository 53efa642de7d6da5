"""The wheel-slip NMPC as a ROS node: ``poses`` and ``joint_states`` in, ``wheel_torques`` out.

A frame is answered by torques while a trajectory is followed, by a standing command otherwise: a
robot of this kind holds its wheels when it is told a velocity.
"""

import math
import sys
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState

from push_estimation.pose_gate import PoseGateSettings
from push_model.settings import SettingsError
from push_model.trajectory import Trajectory
from push_mpc.follower_node import Command, Followed, FollowerKind, FollowerNode
from push_mpc.torque_friction import FrictionTrustSettings
from push_mpc.torque_observer import TorqueObserverSettings
from push_mpc.torque_tracker import TorqueTick, TorqueTracker, TorqueTrackerSettings
from push_mpc.torque_wheels import WheelFeed
from push_mpc.wheel_slip_nmpc import WheelSlipNmpc, WheelSlipSettings
from push_msgs.action import FollowTrajectory
from push_msgs.msg import WheelTorques
from push_ros.conversions import time_from_ros, trajectory_from_ros, twist_to_ros
from push_ros.parameters import declare_settings
from push_ros.pose_feed import Frame
from push_ros.process import run_node
from push_ros.qos import COMMAND, STREAM
from push_ros.scheduling import Urgency
from push_ros.validation import InvalidMessage
from push_scenario.scenario import Scenario

_SECTIONS = ("nmpc", "tracker", "observer", "friction", "poses")


class TorqueFollower:
    """Drives a robot by the torques of its right and its left wheel [Nm], see Follower."""

    sender = "sender"

    def __init__(self, shell: FollowerNode) -> None:
        self._shell, self._robot = shell, shell.robot
        values = dict(shell.scenario.parameters.get("torque_controller", {}))
        sections = {k: values.pop(k, {}) for k in _SECTIONS}
        if values:
            raise SettingsError(f"torque_controller: unknown key '{next(iter(values))}'")

        def declared(cls: type[Any], section: str) -> Any:
            where = f"torque_controller.{section}"
            return declare_settings(shell, cls, sections[section], section, where)

        nmpc = WheelSlipNmpc(declared(WheelSlipSettings, "nmpc"), shell.spec)
        nmpc.warm_up()
        self.tracker = TorqueTracker(
            declared(TorqueTrackerSettings, "tracker"),
            nmpc,
            declared(TorqueObserverSettings, "observer"),
            declared(FrictionTrustSettings, "friction"),
        )
        self.gate: PoseGateSettings = declared(PoseGateSettings, "poses")
        self.bodies: Collection[str] = {self._robot}
        self.wheels = WheelFeed()
        names, diagnostics = shell.names, shell.diagnostics
        topics = [names.robot(self._robot, t) for t in ("wheel_torques", "cmd_vel", "joint_states")]
        events = diagnostics.publisher_events
        self._torques = shell.create_publisher(
            WheelTorques, topics[0], COMMAND, event_callbacks=events(topics[0])
        )
        self._stand = shell.create_publisher(
            TwistStamped, topics[1], COMMAND, event_callbacks=events(topics[1])
        )
        shell.create_subscription(
            JointState,
            topics[2],
            self.take_wheels,
            STREAM,
            event_callbacks=diagnostics.subscription_events(topics[2]),
        )

    def take_wheels(self, message: JointState) -> None:
        """Two wheels, left and right; others say nothing."""
        why = self.wheels.take(
            time_from_ros(message.header.stamp),
            np.array(message.position, dtype=np.float64),
            np.array(message.velocity, dtype=np.float64),
        )
        if why:
            self._shell.diagnostics.refuse("joint_states", why)

    def parse(self, request: Any) -> Trajectory:
        """See Follower: a trajectory of the robot alone."""
        if request.mode != FollowTrajectory.Goal.MOVE:
            raise InvalidMessage(
                "the torque controller accepts only the mode MOVE; an object that is pushed is "
                "a disturbance"
            )
        if request.going_on:
            raise InvalidMessage("only a push can go on where another one is")
        if request.obstacles:
            raise InvalidMessage(
                "the torque controller does not avoid obstacles; leave 'obstacles' empty, and send "
                "a trajectory that is clear of them"
            )
        if request.object:
            raise InvalidMessage(
                "leave 'object' empty: to the torque controller, an object that is pushed is a "
                "disturbance"
            )
        return trajectory_from_ros(request.trajectory)

    def begin(self, request: Any, task: Trajectory) -> None:
        """See Follower."""
        self.tracker.start(task, request.position_tolerance, request.orientation_tolerance)

    def missing(self, frame: Frame) -> str:
        """See Follower: the robot must be seen in every frame."""
        return "" if self._pose(frame) is not None else self._robot

    def _pose(self, frame: Frame) -> Any:
        return frame.seen.get(self._robot)

    def tick(self, dt: float, frame: Frame) -> Followed:
        """See Follower."""
        wheels = self.wheels.at(time_from_ros(frame.stamp))
        tick = self.tracker.tick(dt, self._pose(frame), wheels)
        failed = tick.solve is not None and not tick.solve.solved
        away = math.hypot(float(tick.error[0]), float(tick.error[1]))
        return Followed(
            tick.torques,
            tick.finished,
            int(tick.code),
            tick.message,
            tick.progress,
            (away, abs(float(tick.error[2]))),
            tick.solve.reason if failed and tick.solve else "",
            {**self.fields(), **_fields(tick)},
            tick,
        )

    def rest(self, dt: float, frame: Frame) -> Command:
        """See Follower: it brakes, and stands once it is at rest."""
        return self.tracker.rest(dt, self._pose(frame))

    def refused(self) -> Command:
        """See Follower."""
        return self.tracker.brake()

    def halt(self) -> None:
        """See Follower: the estimate begins anew after a gap in the poses by itself."""

    def canceled(self) -> None:
        """See Follower: it brakes from the next frame on."""

    def send(self, command: Command, stamp: Any) -> None:
        """See Follower."""
        if command is None or not all(map(math.isfinite, command)):
            self._stand.publish(twist_to_ros(0.0, 0.0, stamp))
            return
        message = WheelTorques(right=command[0], left=command[1])
        message.header.stamp = stamp
        message.header.frame_id = "base_link"
        self._torques.publish(message)

    def fields(self) -> Mapping[str, float]:
        """See Follower."""
        return {"v": self.tracker.observer.v, "omega": self.tracker.observer.omega}

    def show(self, followed: Followed) -> None:
        """See Follower: nothing else."""


def _fields(tick: TorqueTick) -> dict[str, float]:
    names = ("error_x", "error_y", "error_theta")
    fields = dict(zip(names, map(float, tick.error), strict=True))
    if tick.solve is not None:
        fields |= {"solve_time": tick.solve.solve_time, "slack": tick.solve.violation}
    return fields


TORQUE_CONTROLLER = FollowerKind("torque_controller", "pioneer", TorqueFollower)


class TorqueControllerNode(FollowerNode):
    """A shell around a ``TorqueFollower``."""

    def __init__(
        self, scenario: Scenario | None = None, robot: str = "", namespace: str = ""
    ) -> None:
        """namespace: the world's; the node lives in its robot's below it."""
        super().__init__(TORQUE_CONTROLLER, scenario, robot, namespace)


def main() -> int:
    """Entry point of the process: ``--ros-args`` on its command line."""
    return run_node(TorqueControllerNode, urgency=Urgency.CONTROL)


if __name__ == "__main__":
    sys.exit(main())
