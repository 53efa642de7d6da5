"""How a node commands the robots of its team: one message for all of them."""

from collections.abc import Sequence
from typing import Any, Protocol

from rclpy.node import Node

from push_job.method import Told
from push_msgs.msg import Velocities
from push_ros.names import Names
from push_ros.qos import COMMAND
from push_ros.validation import FRAME


class Commander(Protocol):
    """Sends what a method says in answer to a frame."""

    def send(self, stamp: Any, told: Told) -> None:
        """stamp: of the frame that is answered."""
        ...


class TeamCommander:
    """Velocities of all robots of a team on ``cmd_vels``; robots without a command stand."""

    def __init__(self, node: Node, names: Names, robots: Sequence[str], holonomic: bool) -> None:
        self._robots, self._holonomic = list(robots), holonomic
        self._publisher = node.create_publisher(Velocities, names.world("cmd_vels"), COMMAND)

    def send(self, stamp: Any, told: Told) -> None:
        """See Commander."""
        commands = [told.commands.get(name, (0.0, 0.0)) for name in self._robots]
        first, second = [float(a) for a, _ in commands], [float(b) for _, b in commands]
        if self._holonomic:
            message = Velocities(names=self._robots, vx=first, vy=second)
            if told.turns:
                message.omega = [float(told.turns.get(name, 0.0)) for name in self._robots]
            message.header.frame_id = FRAME
        else:
            message = Velocities(names=self._robots, vx=first, omega=second)
            message.header.frame_id = "base_link"
        message.header.stamp = stamp
        self._publisher.publish(message)
