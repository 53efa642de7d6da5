"""A robot that takes the speeds of its two wheels as std_msgs/Float64MultiArray."""

import array

import numpy as np
from std_msgs.msg import Float64MultiArray

from lab_bridge.robot_drivers import RobotHost
from lab_bridge.throttle import Throttle
from push_model.arrays import Array
from push_model.kinematics import DifferentialDrive
from push_model.settings import SettingsError
from push_ros.qos import COMMAND
from push_scenario.lab import WheelsLink

_REPEAT = 0.1  # [s] the last command is sent again, for robots with a watchdog of their own


class WheelsDriver:
    """See RobotDriver. A topic without a subscription counts as no connection."""

    def __init__(self, host: RobotHost, link: WheelsLink) -> None:
        assert host.node is not None
        drive = host.spec.kinematics
        if drive is None:
            raise SettingsError(f"lab.robots.{host.robot}: the robot has no wheels")
        if link.scale == 0.0:
            raise SettingsError(f"lab.robots.{host.robot}.scale must not be 0")
        self._drive: DifferentialDrive = drive
        self._link, self._throttle = link, Throttle(host.rate)
        self._publisher = host.node.create_publisher(Float64MultiArray, link.topic, COMMAND)
        self._last, self._sent = np.zeros(2), -np.inf

    @property
    def trouble(self) -> str:
        """See RobotDriver."""
        heard = self._publisher.get_subscription_count()
        return "" if heard else f"nobody listens on {self._publisher.topic_name}"

    def command(self, twist: Array, now: float) -> None:
        """See RobotDriver."""
        left, right = self._drive.wheel_speeds(float(twist[0]), float(twist[2]))
        self._send(self._throttle.offer(np.array([left, right]), now), now)

    def poll(self, now: float) -> None:
        """See RobotDriver."""
        due = self._throttle.due(now)
        self._send(self._last if due is None and now - self._sent > _REPEAT else due, now)

    def _send(self, wheels: Array | None, now: float) -> None:
        """wheels: ``(2,)`` [rad/s] left, right."""
        if wheels is None:
            return
        self._last, self._sent = wheels, now
        values = self._link.scale * (wheels if self._link.left_first else wheels[::-1])
        self._publisher.publish(Float64MultiArray(data=array.array("d", values.tolist())))

    def close(self, now: float) -> None:
        """See RobotDriver."""
        self._send(np.zeros(2), now)


DRIVER = WheelsDriver
