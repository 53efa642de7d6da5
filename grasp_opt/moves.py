"""Motions of robots between pushes: straight lines, and turns in place."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from grasp_opt.sequencing import Move
from push_model import se2
from push_model.arrays import Array
from push_model.kinematics import DifferentialDrive
from push_model.settings import bounded, settings


@settings
class MoveSettings:
    """Speeds and what counts as there."""

    speed: float = bounded(
        0.1,
        low=1e-3,
        high=5.0,
        doc="Speed of robots that drive to their places between two pushes (m/s).",
    )
    deceleration: float = bounded(
        0.15,
        low=1e-3,
        high=50.0,
        doc="Deceleration of robots before a corner of their path between two pushes (m/s^2).",
    )
    turn_rate: float = bounded(
        2.0, low=1e-2, high=50.0, doc="Highest turn rate of robots between two pushes (rad/s)."
    )
    turn_gain: float = bounded(
        4.0,
        low=0.1,
        high=100.0,
        doc="Turn rate of a robot divided by its heading error, between two pushes (1/s).",
    )
    turn_first: float = bounded(
        0.12,
        low=1e-3,
        high=3.0,
        doc="Heading error above which a robot stops and turns in place before it drives on (rad).",
    )
    near: float = bounded(
        3e-3,
        low=1e-4,
        high=0.1,
        doc="Distance from a corner of the path within which a robot heads for the next corner "
        "(m).",
    )
    straight: float = bounded(
        0.02,
        low=1e-3,
        high=1.0,
        doc="Heading error below which a robot ends a turn in place and drives on (rad).",
    )
    slowest: float = bounded(
        0.01, low=1e-4, high=1.0, doc="Lowest speed of a robot near a corner of its path (m/s)."
    )
    back_off: float = bounded(
        0.03, low=0.0, high=1.0, doc="Gap to the object to which robots back off after a push (m)."
    )
    back_speed: float = bounded(
        0.03, low=1e-3, high=1.0, doc="Speed at which robots back off from the object (m/s)."
    )


@dataclass
class _Walk:
    """One move under way; corner: index of the point that is next."""

    move: Move
    corner: int = 1
    standing: bool = True


class Mover:
    """Carries out batches of moves, one batch after the other."""

    def __init__(
        self,
        batches: Sequence[Sequence[Move]],
        drive: DifferentialDrive,
        settings: MoveSettings | None = None,
    ) -> None:
        self.settings = settings or MoveSettings()
        self._drive = drive
        self._left = [list(batch) for batch in batches]
        self._walks: list[_Walk] = []
        self.done = False

    def step(self, robots: Array) -> Array:
        """Twists ``(n, 2)`` v [m/s], omega [rad/s] for all robots at poses ``(n, 3)``."""
        twists = np.zeros((len(robots), 2))
        while not self._walks and self._left:
            self._walks = [_Walk(m) for m in self._left.pop(0)]
        for walk in list(self._walks):
            command = self._walk(walk, robots[walk.move.robot])
            if command is None:
                self._walks.remove(walk)
            else:
                twists[walk.move.robot] = self._drive.saturate(*command)
        self.done = not self._walks and not self._left
        return twists

    def _walk(self, walk: _Walk, pose: Array) -> tuple[float, float] | None:
        """v, omega of one robot, None when it is there."""
        s, points = self.settings, walk.move.points
        while walk.corner < len(points):
            to = points[walk.corner] - pose[:2]
            away = float(np.hypot(*to))
            leg = points[walk.corner] - points[walk.corner - 1]
            passed = float(to @ leg) <= 0.0
            if away < s.near or (passed and away < 5.0 * s.near):
                walk.corner, walk.standing = walk.corner + 1, True
                continue
            error = se2.wrap(math.atan2(to[1], to[0]) - float(pose[2]))
            omega = self._turn(error)
            if walk.standing and abs(error) > s.straight:
                return 0.0, omega
            walk.standing = abs(error) > s.turn_first
            speed = min(s.speed, max(s.slowest, math.sqrt(2.0 * s.deceleration * away) - 0.01))
            return (0.0 if walk.standing else speed), omega
        if walk.move.heading is None:
            return None
        error = se2.wrap(walk.move.heading - float(pose[2]))
        return None if abs(error) < s.straight else (0.0, self._turn(error))

    def _turn(self, error: float) -> float:
        s = self.settings
        return float(np.clip(s.turn_gain * error, -s.turn_rate, s.turn_rate))


def back_off(
    robots: Array,
    gaps: Array,
    ahead: Array,
    alive: Sequence[int],
    room: float,
    settings: MoveSettings,
) -> Array:
    """Twists ``(n, 2)`` that lead robots straight away from the object, as long as they are nearer
    than they should be.

    gaps ``(n,)`` [m] between robots and object; ahead ``(n,)`` cosine of the angle between heading
    and the direction of the object; room: [m] that robots keep between their centres at least.
    """
    twists = np.zeros((len(robots), 2))
    for i in alive:
        if gaps[i] >= settings.back_off or abs(ahead[i]) < 0.3:
            continue
        sign = -math.copysign(1.0, float(ahead[i]))
        next_to = robots[i, :2] + sign * 0.02 * np.array(
            [math.cos(robots[i, 2]), math.sin(robots[i, 2])]
        )
        others = [j for j in range(len(robots)) if j != i]
        now = np.hypot(*(robots[others, :2] - robots[i, :2]).T)
        then = np.hypot(*(robots[others, :2] - next_to).T)
        if not ((then < room) & (then < now)).any():
            twists[i, 0] = sign * settings.back_speed
    return twists
