"""How a node commands the robots of its team: one message for all of them."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from rclpy.node import Node

from push_job.method import Command
from push_msgs.msg import Velocities
from push_ros.names import Names
from push_ros.qos import COMMAND
from push_ros.validation import FRAME


class Commander(Protocol):
    """Sends what a method says in answer to a frame."""

    def send(self, stamp: Any, commands: Mapping[str, Command]) -> None:
        """stamp: of the frame; commands: by robot, see ``Told``."""
        ...


class TeamCommander:
    """Velocities of all robots of a team on ``cmd_vels``; robots without a command stand."""

    def __init__(self, node: Node, names: Names, robots: Sequence[str], holonomic: bool) -> None:
        self._robots, self._holonomic = list(robots), holonomic
        self._publisher = node.create_publisher(Velocities, names.world("cmd_vels"), COMMAND)

    def send(self, stamp: Any, commands: Mapping[str, Command]) -> None:
        """See Commander."""
        told = [commands.get(name, (0.0, 0.0)) for name in self._robots]
        first, second = [float(c[0]) for c in told], [float(c[1]) for c in told]
        if self._holonomic:
            message = Velocities(names=self._robots, vx=first, vy=second)
            if any(len(c) > 2 for c in told):
                message.omega = [float(sum(c[2:])) for c in told]
            message.header.frame_id = FRAME
        else:
            message = Velocities(names=self._robots, vx=first, omega=second)
            message.header.frame_id = "base_link"
        message.header.stamp = stamp
        self._publisher.publish(message)
