"""How a robot is told its velocity: a driver for each kind of link, a file each.

The driver of the kind ``twist`` is ``DRIVER`` of the module ``robots_twist``. One outside the
packages is named as ``MODULE:ATTRIBUTE``. A driver is polled: it has no thread and no clock.
"""

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from rclpy.node import Node

from push_model.arrays import Array
from push_model.outside import from_outside
from push_model.specs import RobotSpec
from push_scenario.lab import OtherLink


@dataclass(frozen=True)
class RobotHost:
    """What a driver works with. rate: [Hz] of commands at most. robot, spec: whom it drives."""

    node: Node | None
    robot: str
    spec: RobotSpec
    rate: float


class RobotDriver(Protocol):
    """A link to one robot. Times ``now`` are monotonic [s]."""

    @property
    def trouble(self) -> str:
        """Why the robot cannot be commanded, for people; empty where it can."""
        ...

    def command(self, twist: Array, now: float) -> None:
        """Let it move with a twist ``(3,)`` [m/s, m/s, rad/s] in its own frame, feasible for it.

        A zero is sent at once, anything else not more often than the rate.
        """
        ...

    def poll(self, now: float) -> None:
        """Send what waits, read what came, connect again; called at every tick of the bridge."""
        ...

    def close(self, now: float) -> None:
        """Stop the robot and end the link."""
        ...


RobotDriverMaker = Callable[[RobotHost, Any], RobotDriver]
"""Makes a driver for a host, from the settings of its link; raises SettingsError."""


def make_robot_driver(host: RobotHost, link: Any) -> RobotDriver:
    """The driver of a link.

    Raises
    ------
    SettingsError: it cannot be found, or it refuses its settings.
    """
    if isinstance(link, OtherLink):
        where = f"lab.robots.{host.robot}.driver"
        maker: RobotDriverMaker = from_outside(link.driver, where)
        return maker(host, link.settings)
    maker = importlib.import_module(f"lab_bridge.robots_{link.kind}").DRIVER
    return maker(host, link)
