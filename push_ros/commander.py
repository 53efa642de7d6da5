"""How a node commands the robots of its team: one message for all of them."""

from typing import Any, Protocol

from rclpy.node import Node

from push_job.method import Told
from push_msgs.msg import Velocities
from push_ros.names import Names
from push_ros.qos import COMMAND
from push_ros.roster import Roster
from push_ros.validation import FRAME


class Commander(Protocol):
    """Sends what a method says in answer to a frame."""

    def send(self, stamp: Any, told: Told) -> None:
        """stamp: of the frame that is answered."""
        ...


class TeamCommander:
    """Velocities of all robots of a team on ``cmd_vels``; robots without a command stand. One that
    is released is told to stand once more."""

    def __init__(self, node: Node, names: Names, roster: Roster, holonomic: bool) -> None:
        self._roster, self._holonomic = roster, holonomic
        self._publisher = node.create_publisher(Velocities, names.world("cmd_vels"), COMMAND)

    def send(self, stamp: Any, told: Told) -> None:
        """See Commander."""
        robots = [*self._roster.robots, *self._roster.released()]
        commands = [told.commands.get(name, (0.0, 0.0)) for name in robots]
        first, second = [float(c[0]) for c in commands], [float(c[1]) for c in commands]
        if self._holonomic:
            message = Velocities(names=robots, vx=first, vy=second)
            if any(len(c) > 2 for c in commands):
                message.omega = [float(sum(c[2:])) for c in commands]
            message.header.frame_id = FRAME
        else:
            message = Velocities(names=robots, vx=first, omega=second)
            message.header.frame_id = "base_link"
        message.header.stamp = stamp
        self._publisher.publish(message)
