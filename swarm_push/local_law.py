"""The law of one robot that has only its own sensing: what it sees in, its velocity out.

The robot estimates the centre c of the object from the outermost points that it sees
(``seen_centre``). From there u points to the target, or to the point that a guide gives instead
(``map_guide.py``). Where u points into the object at the place of the object that is nearest to the
robot, the robot pushes: it moves along u, and evenly apart from its neighbours at the object.
Elsewhere it goes round the object to its back, the shorter way.

Two terms keep the object on course. A robot whose push is not square to the side that it pushes
turns the object, until it is; and a robot whose side makes the object drift off the line to the
target slows down, until robots at another side make up for it. Near the target all slow down.
"""

import math
from collections.abc import Sequence
from typing import Any, Protocol

import numba
import numpy as np

from push_model.arrays import Array, Mask
from push_model.se2 import rotation_matrix
from push_model.settings import bounded, settings
from swarm_push.robot_sensor import Reading

_SEEN = 2  # points of an outline that tell where it is
_LEAST_HALF = 0.02  # [m] of an object
_FAR = 0.3  # [m] beyond which robots behind the object do not move with it; of a free place
_AT = 0.04  # [m] from the object: a robot is at it
_DEEP = 0.75  # of half the extent: between a square, which is as deep as wide, and a triangle
_REACH, _SWEEPS = 0.15, 4  # [m] of gaps that are looked at; sweeps over them
_PRESS, _FASTEST = 0.01, 0.06  # [m/s] into the object in contact, and at most
_KEEPS = 20.0  # [1/m] of gaps to the object as a part of the speed, on the way round it
_PATIENCE, _STRAIGHT = 10.0, 20.0  # [s] before a robot walks at random; of a straight walk, mean
_TURNS = 0.2  # [m] from a wall: a robot that walks at random turns
_SLOWEST = 0.2  # part of its speed that a robot keeps that makes the object drift


@settings
class LocalLawSettings:
    """Speeds and gains of a robot."""

    speed: float = bounded(
        0.8,
        low=0.05,
        high=1.0,
        doc="Push speed as a fraction of the robot's maximum speed (dimensionless)",
    )
    slowing: float = bounded(
        0.3,
        low=0.01,
        high=10.0,
        doc="Push speed near the target, divided by the remaining distance (1/s)",
    )
    least_speed: float = bounded(
        0.2,
        low=0.0,
        high=1.0,
        doc="Lowest push speed near the target as a fraction of the robot's maximum speed "
        "(dimensionless)",
    )
    least: float = bounded(
        0.3,
        low=0.0,
        high=0.99,
        doc="A robot pushes if the cosine of the angle between the push direction (from the "
        "object's centre to the target) and the inward normal of the outline is above this value "
        "(dimensionless)",
    )
    gain: float = bounded(
        3.0,
        low=0.01,
        high=100.0,
        doc="Speed towards the object that is added to the push speed, divided by the gap between "
        "robot and object; a constant 1 cm/s is added as well (1/s)",
    )
    shift: float = bounded(
        0.3,
        low=0.0,
        high=100.0,
        doc="Speed at which a robot in contact moves along the outline of the object, divided by "
        "its distance from the middle between its neighbours (1/s)",
    )
    spread: float = bounded(
        2.0,
        low=0.0,
        high=100.0,
        doc="Speed at which a robot behind the object, but not in contact, moves along the "
        "outline of the object, divided by its distance from the middle between its neighbours "
        "(1/s)",
    )
    turn: float = bounded(
        0.3,
        low=0.0,
        high=10.0,
        doc="Angular velocity at which a robot turns the object, divided by the sine of the angle "
        "between the push direction and the inward normal of the outline (rad/s)",
    )
    walled_turn: float = bounded(
        0.6,
        low=0.0,
        high=10.0,
        doc="Value of 'turn' on a map with walls (rad/s). It is greater, because an object that "
        "turns too slowly comes to a wall beside its route",
    )
    drift: float = bounded(
        4.0,
        low=0.0,
        high=100.0,
        doc="Fraction by which a robot slows down if its push makes the object drift sideways, "
        "divided by the drift speed (as a fraction of the robot's maximum speed) and by the "
        "sideways component of the inward normal of the pushed side (dimensionless)",
    )
    memory: float = bounded(
        0.5,
        low=0.02,
        high=60.0,
        doc="Time constant of the filter of the object's velocity (s)",
    )
    clearance: float = bounded(
        0.05,
        low=1e-3,
        high=1.0,
        doc="Gap to the object that a robot keeps while it moves around it (m)",
    )
    contact: float = bounded(
        0.02,
        low=1e-3,
        high=1.0,
        doc="Gap to the object below which a robot counts as in contact (m)",
    )
    apart: float = bounded(
        6e-3, low=0.0, high=1.0, doc="Gap that a robot keeps to other robots and to walls (m)"
    )
    closing: float = bounded(
        4.0,
        low=0.01,
        high=100.0,
        doc="Highest speed towards another robot or a wall, divided by the gap in excess of "
        "'apart' (1/s)",
    )


class Guide(Protocol):
    """Takes the place of the beacon; all points are in the robot's frame."""

    def look(self, reading: Reading) -> None:
        """Once for every reading, before the others."""
        ...

    def target(self, centre: Array) -> Array:
        """``(2,)`` [m] to which the object with its centre at ``(2,)`` [m] is to be pushed."""
        ...

    def pins(self, inward: Array) -> bool:
        """Whether a push along ``inward (2,)`` presses the object against a wall that is near."""
        ...

    def blocked(self, centre: Array, turn: float) -> bool:
        """Whether walls leave the robot no room on its way round the object with its centre at
        ``(2,)`` [m], by an angle of ``turn`` [rad], counterclockwise."""
        ...

    def walk(self) -> Array:
        """``(2,)`` [m] to which the robot is to walk if it does not see the object."""
        ...


class LocalLaw:
    """One robot of a radius [m] and a greatest speed [m/s], and what it remembers."""

    def __init__(
        self,
        radius: float,
        speed: float,
        settings: LocalLawSettings,
        seed: Sequence[int] = (0,),
        guide: Guide | None = None,
        discs: tuple[float, float] | None = None,
    ) -> None:
        """seed: of the directions in which it looks for the object. guide: of a robot with a map;
        takes the place of the beacon. discs: radii [m] of two discs about the object's centre, if
        the robot is told them: one lies in the object, the other one contains it."""
        self._guide, self._discs = guide, discs
        self._random = np.random.default_rng(seed)
        self._lost, self._heading = 0.0, self._random.uniform(-math.pi, math.pi)  # [s], [rad]
        self._radius, self._speed, self.settings = radius, speed, settings
        self._half = _LEAST_HALF  # [m] of the extent of the object that is seen
        self._centre: Array | None = None  # (2,) [m] of the object at the last reading
        self._drifts = np.zeros(2)  # [m/s] of the object

    def step(self, reading: Reading, dt: float) -> Array:
        """Velocity ``(2,)`` [m/s] in the robot's frame. dt: [s] since the reading before."""
        if self._guide is not None:
            self._guide.look(reading)
        if len(reading.object) < _SEEN:
            self._centre, self._drifts = None, np.zeros(2)
            return self._search(reading, dt)
        self._lost = 0.0
        centre = self._look(reading, dt)
        target = reading.target if self._guide is None else self._guide.target(centre)
        to_target = target - centre
        left = math.hypot(*to_target)
        u = to_target / max(left, 1e-9)
        away = np.hypot(*reading.object.T)
        nearest = int(away.argmin())
        gap = float(away[nearest]) - self._radius
        inward = reading.object[nearest] / max(float(away[nearest]), 1e-9)
        s, top = self.settings, self._speed
        pace = min(s.speed * top, max(s.least_speed * top, s.slowing * left))
        mates, at, behind = self._mates(reading, u)
        moving = np.where(behind[:, None], pace * u, 0.0)
        pins = self._guide is not None and self._guide.pins(inward)
        if inward @ u > s.least and not pins:
            v = self._push(gap, inward, centre, u, pace, mates[at] @ _left(u))
        else:
            v = self._go_round(gap, inward, centre, u)
        return self._apart(v, mates, moving, reading.walls)

    def _look(self, reading: Reading, dt: float) -> Array:
        """``(2,)`` [m] of the object's centre; keeps half its extent and its velocity."""
        centre, self._half = seen_centre(reading.object)
        if self._discs is not None:
            centre = _between(centre, reading.object, self._discs)
        back = rotation_matrix(float(reading.moved[2])).T
        self._drifts = back @ self._drifts
        if self._centre is not None and dt > 0.0:
            before = back @ (self._centre - reading.moved[:2])
            part = min(1.0, dt / self.settings.memory)
            self._drifts = self._drifts + part * ((centre - before) / dt - self._drifts)
        self._centre = centre
        return centre

    def _mates(self, reading: Reading, u: Array) -> tuple[Array, Mask, Mask]:
        """Robots that are seen ``(m, 2)`` [m]; which of them are at the object and push it, and
        which are behind it and move with it."""
        mates = reading.robots
        off = np.hypot(*(mates[:, None] - reading.object).transpose(2, 0, 1))
        near, gap = off.argmin(axis=1), off.min(axis=1)
        inward = (reading.object[near] - mates) / np.maximum(gap, 1e-9)[:, None]
        pushes = inward @ u > self.settings.least
        gap = gap - self._radius
        return mates, pushes & (gap < _AT), pushes & (gap < _FAR)

    def _push(
        self, gap: float, inward: Array, centre: Array, u: Array, pace: float, others: Array
    ) -> Array:
        """Velocity ``(2,)`` [m/s]. others: [m] places of the robots at the object, to the left of
        this one, seen along u."""
        s, top, side = self.settings, self._speed, _left(u)
        touches = gap < s.contact
        drift = float(self._drifts @ side) / top
        worse = max(0.0, float(inward @ side) * drift)
        pace = pace * min(1.0, max(_SLOWEST, 1.0 - s.drift * worse))
        into = min(max(s.gain * gap + _PRESS, 0.0), _FASTEST if touches else top)
        v = pace * u + into * inward
        off = float(inward[0] * u[1] - inward[1] * u[0])
        rate = s.turn if self._guide is None else s.walled_turn
        v = v + rate * off * _left(-centre)
        along = _left(inward)
        along = along if along @ side > 0.0 else -along
        left = others[others > 0.0]
        right = others[others < 0.0]
        middle = -float(centre @ side)  # to the left of the line through the centre
        high = float(left.min()) if len(left) else self._half - middle
        low = float(right.max()) if len(right) else -self._half - middle
        shift = 0.5 * (min(high, _FAR) + max(low, -_FAR))
        gain, most = (s.shift, 0.3 * top) if touches else (s.spread, s.speed * top)
        moved: Array = v + along * min(max(gain * shift, -most), most)
        return moved

    def _go_round(self, gap: float, inward: Array, centre: Array, u: Array) -> Array:
        """Velocity ``(2,)`` [m/s] along the outline to the back, the shorter way."""
        ahead = math.atan2(float(-centre @ _left(u)), float(-centre @ u))
        along = _left(inward)
        # Counterclockwise about the centre for a robot to the left of the line to the target.
        sign = 1.0 if ahead > 0.0 else -1.0
        if self._guide is not None:
            shorter, longer = math.pi * sign - ahead, -math.pi * sign - ahead
            if self._guide.blocked(centre, shorter) and not self._guide.blocked(centre, longer):
                sign = -sign
        if float(along @ _left(-centre)) * sign < 0.0:
            along = -along
        closer = min(max(_KEEPS * (gap - self.settings.clearance), -1.0), 1.0)
        v: Array = self._speed * (along + closer * inward)
        return v

    def _search(self, reading: Reading, dt: float) -> Array:
        """Velocity ``(2,)`` [m/s] of a robot that does not see the object: with a guide, to where
        this says. Without one, to the robots that it sees, for some of them may see the object;
        else to the target. If this has not helped for a time, it walks straight on, in a new
        direction at each wall and now and then."""
        self._lost += dt
        walls = reading.walls
        if self._guide is not None:
            way = self._guide.walk()
        elif self._lost > _PATIENCE:
            self._heading -= float(reading.moved[2])
            way = np.array([math.cos(self._heading), math.sin(self._heading)])
            meets = walls[np.hypot(*walls.T) < _TURNS] @ way > 0.0
            if meets.any() or self._random.random() < dt / _STRAIGHT:
                self._heading = self._random.uniform(-math.pi, math.pi)
        elif len(reading.robots):
            way = reading.robots.mean(axis=0)
        else:
            way = reading.target
        v = self._speed * way / max(math.hypot(*way), 1e-9)
        return self._apart(v, reading.robots, np.zeros_like(reading.robots), walls)

    def _apart(self, v: Array, mates: Array, moving: Array, walls: Array) -> Array:
        """The constraint of ``spacing.py``, in which a robot does its own part: it does not know
        what others do, and takes those behind the object to move with it."""
        bodies = np.concatenate([mates, walls])
        speeds = np.concatenate([moving, np.zeros_like(walls)])
        radii = np.repeat([2.0 * self._radius, self._radius], [len(mates), len(walls)])
        s = self.settings
        kept: Array = _kept_apart(
            v.astype(np.float64), bodies, speeds, radii, self._speed, s.apart, s.closing
        )
        return kept


def seen_centre(points: Array) -> tuple[Array, float]:
    """Centre ``(2,)`` [m] of an object of which points ``(k, 2)`` are seen, and half its extent
    [m]: that of the chord between the outermost points. The centre lies on the middle of the chord
    if the object bulges towards the robot, as a corner of a square does, and behind the chord if
    the object is flat there."""
    ahead = points.mean(axis=0)
    angle = np.arctan2(points @ _left(ahead), points @ ahead)
    one, other = points[angle.argmin()], points[angle.argmax()]
    chord = other - one
    half = max(0.5 * math.hypot(*chord), _LEAST_HALF)
    behind = -_left(chord) / (2.0 * half)
    bulge = float(((one - points) @ behind).max())
    centre: Array = 0.5 * (one + other) + max(_DEEP * half - bulge, 0.0) * behind
    return centre, half


def _between(centre: Array, points: Array, discs: tuple[float, float]) -> Array:
    """A centre ``(2,)`` [m], moved away from the robot or towards it, so that points ``(k, 2)`` of
    the outline are not inside the inner one of two discs about it, nor outside the outer one.
    discs: their radii [m]."""
    inner, outer = discs
    away = max(math.hypot(*centre), 1e-9)
    unit = centre / away
    along, across = points @ unit, np.abs(points @ _left(unit))
    near, inside = across < inner, across < outer
    least = (along[near] + np.sqrt(inner**2 - across[near] ** 2)).max(initial=away)
    most = (along[inside] + np.sqrt(outer**2 - across[inside] ** 2)).min(initial=math.inf)
    moved: Array = unit * min(float(least), float(most))
    return moved


def _left(v: Array) -> Array:
    """A vector turned by a quarter, counterclockwise."""
    return np.array([-v[1], v[0]])


@numba.njit(cache=True, error_model="numpy")
def _kept_apart(
    v: Any, bodies: Any, speeds: Any, radii: Any, top: float, apart: float, closing: float
) -> Any:
    fast = math.hypot(v[0], v[1])
    if fast > top:
        v = v * (top / fast)
    for _ in range(_SWEEPS):
        for k in range(bodies.shape[0]):
            away = math.hypot(bodies[k, 0], bodies[k, 1])
            gap = away - radii[k]
            if gap > _REACH or away < 1e-9:
                continue
            x, y = bodies[k, 0] / away, bodies[k, 1] / away
            excess = (v[0] - speeds[k, 0]) * x + (v[1] - speeds[k, 1]) * y - closing * (gap - apart)
            if excess > 0.0:
                v[0] -= excess * x
                v[1] -= excess * y
    return v
