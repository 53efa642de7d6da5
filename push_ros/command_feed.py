"""Commands to robots, as somebody who only watches hears them."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from geometry_msgs.msg import TwistStamped
from rclpy.node import Node

from push_msgs.msg import Velocities
from push_ros.conversions import time_from_ros
from push_ros.diagnostics import Diagnostics
from push_ros.names import Names
from push_ros.qos import COMMAND
from push_ros.validation import FRAME


@dataclass(frozen=True)
class Heard:
    """A command to one robot. stamp: [s] of the poses that it answers. vx, vy: [m/s]. omega:
    [rad/s]. fixed: whether vx and vy are in the fixed frame, not in the robot's."""

    robot: str
    stamp: float
    vx: float
    vy: float
    omega: float
    fixed: bool = False


class CommandFeed:
    """Subscribes to the commands of robots on ``<robot>/cmd_vel``, and to those of all robots on
    ``cmd_vels``."""

    def __init__(
        self,
        node: Node,
        names: Names,
        robots: Iterable[str],
        diagnostics: Diagnostics,
        heard: Callable[[Heard], None],
    ) -> None:
        """heard: called with each command."""
        self._heard = heard

        def subscribe(kind: type, topic: str, handler: Callable[..., None]) -> None:
            events = diagnostics.subscription_events(topic)
            node.create_subscription(kind, topic, handler, COMMAND, event_callbacks=events)

        for robot in robots:
            subscribe(TwistStamped, names.robot(robot, "cmd_vel"), self._of(robot))
        subscribe(Velocities, names.world("cmd_vels"), self._on_velocities)

    def _of(self, robot: str) -> Callable[[TwistStamped], None]:
        def on_twist(message: TwistStamped) -> None:
            linear, turn = message.twist.linear, float(message.twist.angular.z)
            stamp = time_from_ros(message.header.stamp)
            self._heard(Heard(robot, stamp, float(linear.x), float(linear.y), turn))

        return on_twist

    def _on_velocities(self, message: Velocities) -> None:
        stamp, fixed = time_from_ros(message.header.stamp), message.header.frame_id == FRAME
        for k, robot in enumerate(message.names):
            vx, vy, omega = (
                float(column[k]) if k < len(column) else 0.0
                for column in (message.vx, message.vy, message.omega)
            )
            self._heard(Heard(str(robot), stamp, vx, vy, omega, fixed))
