"""How a node commands the robots of its team: one message for all of them."""

import math
from itertools import chain
from typing import Any, Protocol

from rclpy.node import Node

from push_job.method import Command, Told
from push_msgs.msg import Velocities
from push_ros.names import Names
from push_ros.qos import COMMAND
from push_ros.roster import Roster
from push_ros.validation import FRAME

_STAND = (0.0, 0.0)  # [m/s], and [m/s] or [rad/s]
_SAID = 3  # of the commands that are not finite, how many are logged


class Commander(Protocol):
    """Sends what a method says in answer to a frame."""

    def send(self, stamp: Any, told: Told) -> None:
        """stamp: of the frame that is answered."""
        ...


class TeamCommander:
    """Velocities of all robots of a team on ``cmd_vels``; robots without a command stand. One that
    is released is told to stand once more.

    not_finite: commands of the method so far that were not finite; their robots stand instead.
    """

    def __init__(self, node: Node, names: Names, roster: Roster, holonomic: bool) -> None:
        self._roster, self._holonomic = roster, holonomic
        self._log, self.not_finite = node.get_logger().warning, 0
        self._publisher = node.create_publisher(Velocities, names.world("cmd_vels"), COMMAND)

    def send(self, stamp: Any, told: Told) -> None:
        """See Commander."""
        robots = [*self._roster.robots, *self._roster.released()]
        commands = [told.commands.get(name, _STAND) for name in robots]
        if not all(map(math.isfinite, chain.from_iterable(commands))):
            commands = [self._finite(n, c) for n, c in zip(robots, commands, strict=True)]
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

    def _finite(self, name: str, command: Command) -> Command:
        if all(map(math.isfinite, command)):
            return command
        self.not_finite += 1
        if self.not_finite <= _SAID:
            self._log(f"the method's command to '{name}' is not finite: {command}; it is stopped")
        return _STAND
