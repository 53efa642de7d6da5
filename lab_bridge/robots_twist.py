"""A robot that takes geometry_msgs/Twist or TwistStamped on a topic."""

import numpy as np
from geometry_msgs.msg import Twist, TwistStamped

from lab_bridge.robot_drivers import RobotHost
from lab_bridge.throttle import Throttle
from push_model.arrays import Array
from push_ros.qos import COMMAND
from push_scenario.lab import TwistLink

_REPEAT = 0.1  # [s] the last command is sent again, for robots with a watchdog of their own


class TwistDriver:
    """See RobotDriver. A topic without a subscription counts as no connection."""

    def __init__(self, host: RobotHost, link: TwistLink) -> None:
        assert host.node is not None
        self._node, self._link = host.node, link
        self._throttle = Throttle(host.rate)
        self._publisher = host.node.create_publisher(
            TwistStamped if link.stamped else Twist, link.topic, COMMAND
        )
        self._last, self._sent = np.zeros(3), -np.inf

    @property
    def trouble(self) -> str:
        """See RobotDriver."""
        heard = self._publisher.get_subscription_count()
        return "" if heard else f"nobody listens on {self._publisher.topic_name}"

    def command(self, twist: Array, now: float) -> None:
        """See RobotDriver."""
        self._send(self._throttle.offer(twist, now), now)

    def poll(self, now: float) -> None:
        """See RobotDriver."""
        due = self._throttle.due(now)
        self._send(self._last if due is None and now - self._sent > _REPEAT else due, now)

    def _send(self, twist: Array | None, now: float) -> None:
        if twist is None:
            return
        self._last, self._sent = twist, now
        message = Twist()
        message.linear.x, message.linear.y, message.angular.z = (float(v) for v in twist)
        if self._link.stamped:
            message = TwistStamped(twist=message)
            message.header.stamp = self._node.get_clock().now().to_msg()
            message.header.frame_id = "base_link"
        self._publisher.publish(message)

    def close(self, now: float) -> None:
        """See RobotDriver."""
        self._send(np.zeros(3), now)


DRIVER = TwistDriver
