"""Commands to robots: from a topic each, or from one message for many; through the gate."""

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Protocol

import numpy as np
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node

from push_model.arrays import Array, Mask, Rows
from push_model.drives import HolonomicDrive, TorqueDrive
from push_model.specs import RobotSpec
from push_msgs.msg import Velocities, WheelTorques
from push_ros.command_gate import Admitted, CommandGate, Limits
from push_ros.conversions import time_from_ros
from push_ros.diagnostics import Diagnostics
from push_ros.names import Names
from push_ros.qos import COMMAND
from push_ros.validation import FRAME

_ABSURD = 10.0
"""Commands beyond so many times what a robot can do are refused, not scaled down."""
_OWN_FRAMES = ("", "base_link")


class Commanded(Protocol):
    """What obeys: the robots of a simulated world, or those of a lab."""

    @property
    def names(self) -> tuple[str, ...]:
        """Bodies that are there, robots among them."""
        ...

    def command(self, robot: str, v: float, omega: float) -> None:
        """Set a robot's twist [m/s, rad/s] in its own frame; it holds until the next command."""
        ...

    def command_all(self, robots: Sequence[str], twists: Array, fixed_frame: bool = False) -> None:
        """Set the twists ``(n, 3)`` of several robots, in their own frames or in the world's."""
        ...

    def command_torques(self, robot: str, left: float, right: float) -> None:
        """Set the torques [Nm] of a robot's wheels; they hold until the next command."""
        ...


class CommandIntake:
    """Subscribes to every way of command, and passes on what the gate admits."""

    def __init__(
        self,
        node: Node,
        names: Names,
        diagnostics: Diagnostics,
        answered: Callable[[float, Rows], None],
    ) -> None:
        """answered: called with the stamp [s] that a message answers and the robots' rows.

        A command that is refused is an answer too: its robot goes on with the one before, until
        that is too old.
        """
        self._node, self._names, self._diagnostics = node, names, diagnostics
        self._answered = answered
        self.now = 0.0
        """[s] on the clock of the poses."""
        self.changed = False
        """Whether commanded() may have changed since it was asked."""
        self.unseen: Rows = np.zeros(0, dtype=np.intp)
        """Robots that the newest frame has not: who answers it for many cannot name them."""
        self._inputs: list[Any] = []
        self._watched: set[str] = set()
        self._many = names.world("cmd_vels")
        self._subscribe_to(Velocities, self._many, self._on_velocities, self._inputs)
        self._own_inputs: list[Any] = []
        self.gate = CommandGate((), Limits(np.zeros((0, 3)), np.zeros(0), 0.0, 0.0))

    def connect(
        self, world: Commanded, robots: dict[str, RobotSpec], age: float, wall: float
    ) -> None:
        """Take commands for the robots of a world or of a lab.

        age: [s] of the oldest fresh command, on the clock of the poses; wall: [s] of wall time.
        """
        self._world = world
        drives = [spec.drive for spec in robots.values()]
        twist = [
            (s.max_speed, s.max_speed * isinstance(s.drive, HolonomicDrive), s.max_turn_rate)
            for s in robots.values()
        ]
        torque = [d.max_torque if isinstance(d, TorqueDrive) else 0.0 for d in drives]
        limits = Limits(
            _ABSURD * np.array(twist).reshape(-1, 3), _ABSURD * np.array(torque), age, wall
        )
        self.gate = CommandGate(tuple(robots), limits)
        for subscription in self._own_inputs:
            self._node.destroy_subscription(subscription)
        self._own_inputs = []
        self._topics: list[tuple[str, ...]] = []
        for robot, drive in zip(robots, drives, strict=True):
            topic = self._names.robot(robot, "cmd_vel")
            self._subscribe_to(
                TwistStamped, topic, partial(self._on_twist, robot), self._own_inputs
            )
            self._topics.append((topic,))
            if isinstance(drive, TorqueDrive):
                topic = self._names.robot(robot, "wheel_torques")
                self._subscribe_to(
                    WheelTorques, topic, partial(self._on_torques, robot), self._own_inputs
                )
                self._topics[-1] += (topic,)
        self.restart()

    def _subscribe_to(
        self, kind: Any, topic: str, handler: Callable[[Any], None], kept: list[Any]
    ) -> None:
        events = self._diagnostics.subscription_events(topic)
        kept.append(
            self._node.create_subscription(kind, topic, handler, COMMAND, event_callbacks=events)
        )
        if topic not in self._watched:
            self._watched.add(topic)
            self._diagnostics.watch_publishers(topic)

    def restart(self) -> None:
        """Forget all commands."""
        self.gate.restart()
        self._named = np.zeros(len(self.gate.names), dtype=bool)  # on cmd_vels, so far
        self._commanders: dict[str, frozenset[bytes]] = {}  # of a topic, when looked at last
        self._spoken = (0.0, 0)  # [s] stamp answered last on cmd_vels, and by how many messages

    def commanded(self) -> Mask:
        """``(n,)`` mask of robots that somebody publishes commands for.

        Who is commanded on cmd_vels is known from its first message on; until then it may be
        everybody who has no commander of his own.
        """
        self.changed = False
        count = self._node.count_publishers
        own = np.array([any(count(t) > 0 for t in topics) for topics in self._topics], dtype=bool)
        if count(self._many) > 0:
            own |= self._named if self._named.any() else True
        return own & np.isin(self.gate.names, self._world.names)

    def forget(self, rows: Rows) -> None:
        """Robots whose commander has left are not taken for commanded on cmd_vels any more."""
        self._named[rows] = False
        self.changed = True

    def abandoned(self, rows: Rows) -> Rows:
        """Those of some robots of which a commander has left the graph since the last look.

        One that came in its place has not seen the frame that its predecessor was to answer.
        """
        changes: dict[str, tuple[bool, bool]] = {}
        result = []
        many = self._named if self._named.any() else np.ones_like(self._named)
        for row in rows:
            topics = (*self._topics[row], *((self._many,) if many[row] else ()))
            for topic in topics:
                if topic not in changes:
                    changes[topic] = self._look_at(topic)
            left = any(changes[t][0] for t in topics)
            if left or not any(changes[t][1] for t in topics):
                result.append(row)
        return np.array(result, dtype=np.intp)

    def _look_at(self, topic: str) -> tuple[bool, bool]:
        """Whether a publisher of a topic has left since the last look; whether there is one."""
        now = frozenset(
            bytes(info.endpoint_gid) for info in self._node.get_publishers_info_by_topic(topic)
        )
        before = self._commanders.get(topic, now)
        self._commanders[topic] = now
        return bool(before - now), bool(now)

    def all_have_spoken(self, stamp: float) -> bool:
        """Whether everybody who publishes on cmd_vels has answered the frame of a stamp [s]."""
        answered, count = self._spoken
        return answered == stamp and count >= int(self._node.count_publishers(self._many))

    def drop_unnamed(self, rows: Rows) -> Rows:
        """Those of some robots that nobody commands but on cmd_vels, where nobody names them any
        more. They are stopped, and not taken for commanded until they are named again."""
        count = self._node.count_publishers
        alone = [r for r in rows if not any(count(t) > 0 for t in self._topics[r])]
        result = np.array(alone, dtype=np.intp)
        if result.size:
            self.stop(result)
            self.forget(result)
        return result

    def note_seen(self, names: tuple[str, ...]) -> None:
        """Tell the bodies in the newest frame."""
        here = self._world.names
        if len(names) == len(here):
            self.unseen = np.zeros(0, dtype=np.intp)
        else:
            robots = set(self.gate.names) & set(here) - set(names)
            self.unseen = self.gate.rows(sorted(robots))

    def watch(self, now: float) -> Rows:
        """Stop robots that drive without a fresh command at a time now [s]; their rows."""
        rows: Rows = self.gate.silent(now, time.monotonic())
        if rows.size:
            self.stop(rows)
        return rows

    def stop(self, rows: Rows) -> None:
        """Command robots to stand."""
        self.gate.stop(rows)
        self._world.command_all([self.gate.names[r] for r in rows], np.zeros((len(rows), 3)))

    def _on_twist(self, robot: str, message: TwistStamped) -> None:
        if robot not in self.gate.names:
            return  # one that is gone with the last scenario
        t = message.twist
        stamp = time_from_ros(message.header.stamp)
        twist = np.array([[t.linear.x, t.linear.y, t.angular.z]])
        admitted = self.gate.admit([robot], twist, stamp, self.now, time.monotonic())
        if self._admitted(self._names.robot(robot, "cmd_vel"), admitted):
            if twist[0, 1] == 0.0:
                self._world.command(robot, float(twist[0, 0]), float(twist[0, 2]))
            else:
                self._world.command_all([robot], admitted.values)
        self._answered(stamp, self.gate.rows([robot]))

    def _on_torques(self, robot: str, message: WheelTorques) -> None:
        if robot not in self.gate.names:
            return
        stamp = time_from_ros(message.header.stamp)
        torques = np.array([message.left, message.right])
        admitted = self.gate.admit_torques(robot, torques, stamp, self.now, time.monotonic())
        if self._admitted(self._names.robot(robot, "wheel_torques"), admitted):
            self._world.command_torques(robot, message.left, message.right)
        self._answered(stamp, self.gate.rows([robot]))

    def _on_velocities(self, message: Velocities) -> None:
        stamp = time_from_ros(message.header.stamp)
        before, count = self._spoken
        self._spoken = (stamp, count + 1 if before == stamp else 1)
        self._take_velocities(message, stamp)
        rows = self.gate.rows(message.names)
        blind = self.unseen[self._named[self.unseen]]
        self._answered(stamp, np.append(rows[rows >= 0], blind))

    def _take_velocities(self, message: Velocities, stamp: float) -> None:
        n = len(message.names)
        columns = [
            np.asarray(c, dtype=np.float64) if len(c) else np.zeros(n)
            for c in (message.vx, message.vy, message.omega)
        ]
        frame = message.header.frame_id
        if {len(c) for c in columns} != {n}:
            self._diagnostics.refuse(self._many, "each array must be empty or as long as 'names'")
            return
        if frame != FRAME and frame not in _OWN_FRAMES:
            self._diagnostics.refuse(
                self._many, f"its frame is '{frame}', expected 'base_link' or '{FRAME}'"
            )
            return
        fixed = frame == FRAME
        twists = np.column_stack(columns)
        admitted = self.gate.admit(message.names, twists, stamp, self.now, time.monotonic(), fixed)
        if self._admitted(self._many, admitted):
            known = self.gate.names
            robots = (
                message.names if len(admitted.rows) == n else [known[row] for row in admitted.rows]
            )
            self._world.command_all(robots, admitted.values, fixed)
            if not self._named[admitted.rows].all():
                self._named[admitted.rows] = True
                self.changed = True

    def _admitted(self, topic: str, admitted: Admitted) -> bool:
        for reason in admitted.refused:
            self._diagnostics.refuse(topic, reason)
        return bool(admitted.rows.size)
