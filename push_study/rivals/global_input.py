"""One input for all robots: Shahrokhi, Lin, Ertel, Wan and Becker, T-RO 2018.

Value iteration on a 20 x 20 grid says whereto the object goes next. The swarm's mean is driven
behind the object and against it, and round it by a field of potentials; the direction is chosen
anew every second. When the swarm's variance is too great, its mean is driven into a corner until
the variance is small again. Every five seconds that ends, unless the mean has stopped: then it is
driven into another corner. A room with walls in it is divided into regions; mean and variance are
those of the robots that are in the object's region, and when fewer than half of them are, they are
gathered first. Constants and rules are those of the code that the authors published
(aabecker/SwarmControlSandbox, January 2017).

Reconstructed: the variance is that of the robots in the region; their code leaves out some of them
unless all are there. Of two regions with equally many robots, the first counts. Where their code
has no rule for a corner, robots are not gathered. Their robots are moved by a force of constant
size against a drag; ours drive at full speed in its direction. Their lengths are those of an object
with a circumscribed circle of 1.5; ours are scaled by the object. Their corners are chosen for
their room; in an open room, the corner is the nearest, and after a stop the next one. Their goal is
4 wide; so near to ours, the object goes straight to it.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from push_job.open_room import OpenRoom, open_room_method
from push_model.arrays import Array, Mask

CELLS = 20
_WALL = 1  # cells of the grid that the room's own walls take up
_SWEEPS, _DISCOUNT, _STRAIGHT = 200, 0.97, 0.5
_GOAL, _STEP, _OBSTACLE = 100.0, -1.0, -100.0  # rewards
_REACH = 1.5  # of the object, in their lengths
_ATTRACTION, _REPULSION, _NEAR = 2.0, 75.0, 3.0
_CONE = 0.25 * math.pi  # of directions from the object to the mean, from which it pushes
_CLOSE, _BEHIND, _INSIDE = 1.5, 0.8, 0.1  # from the object: less than this; aims
_HOLD, _WATCH, _STILL = 1.0, 5.0, 0.1  # [s] of a direction; [s] and motion of the mean: stopped
_MOST, _LEAST = 0.48, 0.18  # variance, by robots and their radius
_PRESSED, _BESIDE = 0.1, 4.0  # least variance where the mean has stopped so near to the object
_ENOUGH = 0.5  # of the robots
_THERE = 2.0  # from the goal
_MOVES = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]])


@dataclass(frozen=True)
class Region:
    """A part of a room. cells ``(CELLS, CELLS)`` of the grid, by x and y; corners: where its robots
    are driven to, and where once they have stopped, in their lengths from the room's middle; None
    for the nearest corner of the room, and the next ones."""

    cells: Mask
    corners: tuple[tuple[float, float], tuple[float, float]] | None = None


@dataclass(frozen=True)
class Floor:
    """A room with walls in it. blocked ``(CELLS, CELLS)``. main: regions that cover it. transfer:
    regions that join them; the object is in one of these from when it leaves a main region until it
    leaves that one too. gather: a corner by the object's main region and the two main regions with
    the most robots.
    """

    blocked: Mask
    main: tuple[Region, ...]
    transfer: tuple[Region, ...] = ()
    gather: Mapping[tuple[int, frozenset[int]], tuple[float, float]] = field(default_factory=dict)


def open_floor() -> Floor:
    """With nothing but its own walls."""
    blocked = np.ones((CELLS, CELLS), dtype=bool)
    blocked[_WALL:-_WALL, _WALL:-_WALL] = False
    return Floor(blocked, (Region(np.ones_like(blocked)),))


class GlobalInput:
    """See the module."""

    def __init__(self, arena: OpenRoom, floor: Floor | None = None) -> None:
        self._arena, self._floor = arena, floor or open_floor()
        self._unit = float(np.hypot(*arena.item.geometry.outline.T).max()) / _REACH
        self._half = 0.5 * np.array(arena.size)
        self._ways = self._iterate()
        self._region, self._is_main = self._floor.main[0], True
        self._direction, self._chosen = np.array([1.0, 0.0]), -math.inf
        self._regrouping, self._stopped, self._corner = False, False, 0
        self._watched: tuple[float, Array] | None = None
        self._lost: Array | None = None  # corner where too few robots are gathered

    def velocities(self, time: float, pose: Array, robots: Array) -> Array:
        """See VelocityLaw."""
        u = self._arena.speed * self.direction(time, pose, robots)
        return np.repeat(u[None], len(robots), axis=0)

    def direction(self, time: float, pose: Array, robots: Array) -> Array:
        """``(2,)`` unit vector in which all robots are driven; see VelocityLaw."""
        here, points = pose[:2] / self._unit, robots[:, :2] / self._unit
        self._enter(pose[:2])
        with_it = points[self._inside(self._region, robots[:, :2])]
        few = len(with_it) < _ENOUGH * len(points)
        if not len(with_it):
            with_it = points
        mean, variance = with_it.mean(axis=0), with_it.var(axis=0)
        self._watch(time, mean)
        self._gather(few, pose[:2], robots[:, :2])
        self._judge(mean, variance, len(with_it), float(np.hypot(*(here - mean))))
        if self._lost is not None:
            return _unit(self._lost - mean)
        if self._regrouping:
            return _unit(self._gathering(mean) - mean)
        if time - self._chosen > _HOLD or time < self._chosen:
            self._direction, self._chosen = self._driven(here, mean), time
        return self._direction

    def _enter(self, place: Array) -> None:
        """The object's region: it changes between the two kinds when the object leaves one."""
        if self._inside(self._region, place[None])[0]:
            return
        others = self._floor.transfer if self._is_main else self._floor.main
        found = [r for r in others if self._inside(r, place[None])[0]]
        if found:
            self._region, self._is_main = found[0], not self._is_main

    def _watch(self, time: float, mean: Array) -> None:
        """Every few seconds: whether the mean has stopped. Regrouping ends if it has not."""
        if self._watched is None or time < self._watched[0]:
            self._watched = time, mean
        elif time - self._watched[0] > _WATCH:
            self._stopped = bool(np.hypot(*(mean - self._watched[1])) < _STILL)
            if self._stopped and self._regrouping:
                self._corner += 1
            elif self._stopped:
                self._corner = self._nearest(mean)
            self._regrouping = self._stopped
            self._watched = time, mean

    def _gather(self, few: bool, place: Array, robots: Array) -> None:
        """Where robots are to be driven before anything else, if too few are in the region."""
        if not few or not self._floor.gather:
            self._lost = None
        elif self._lost is None:
            counts = [int(self._inside(r, robots).sum()) for r in self._floor.main]
            order = sorted(range(len(counts)), key=lambda k: -counts[k])  # the first of equals
            at = [k for k, r in enumerate(self._floor.main) if self._inside(r, place[None])[0]]
            key = (at or [len(counts) - 1])[0], frozenset(order[:2])
            if key in self._floor.gather:
                self._lost = np.array(self._floor.gather[key])

    def _judge(self, mean: Array, variance: Array, count: int, away: float) -> None:
        """Whether to regroup: by the variance, with hysteresis."""
        scale = count * self._arena.radius / self._unit
        pressed = self._stopped and away < _BESIDE and self._lost is None
        least = _PRESSED if pressed else _LEAST * scale
        if (variance < least).all():
            self._regrouping = False
        if (variance > _MOST * scale).any():
            if not self._regrouping:
                self._corner = self._nearest(mean)
            self._regrouping = True

    def _gathering(self, mean: Array) -> Array:
        """The corner in which the robots regroup."""
        if self._region.corners is not None:
            return np.array(self._region.corners[int(self._stopped)])
        corner: Array = self._corners()[self._corner % 4]
        return corner

    def _nearest(self, mean: Array) -> int:
        return int(np.hypot(*(self._corners() - mean).T).argmin())

    def _corners(self) -> Array:
        corners: Array = self._half / self._unit * np.array([[1.0, 1], [-1, 1], [-1, -1], [1, -1]])
        return corners

    def _driven(self, here: Array, mean: Array) -> Array:
        """Behind the object and against it, or round it; places in their lengths."""
        back = -self._way(here)
        behind, offset = _unit(back), mean - here
        away = float(np.hypot(*offset))
        off = math.atan2(behind[0] * offset[1] - behind[1] * offset[0], float(behind @ offset))
        if away < _NEAR and abs(off) > _CONE:
            away = max(away, 1e-3)
            aim = here + _BEHIND * behind - mean
            pull = _ATTRACTION * _unit(aim)
            size = _REPULSION * (1.0 / away - 1.0 / _NEAR) / away**2
            return _unit(pull + size * offset)
        return _unit(here + (_INSIDE if away < _CLOSE else _BEHIND) * back - mean)

    def _way(self, here: Array) -> Array:
        """``(2,)`` in which the object is to go; longer where that is to a cell at a corner."""
        straight: Array = self._arena.target / self._unit - here
        if np.abs(straight).max() < _THERE:
            return _unit(straight)
        way: Array = self._ways[self._cells((here * self._unit)[None])[0]]
        return way

    def _cells(self, places: Array) -> list[tuple[int, int]]:
        """Of places ``(n, 2)`` [m]; the walls round the room are cells too."""
        inner = CELLS - 2 * _WALL
        found = np.floor((places + self._half) / (2.0 * self._half) * inner).astype(int) + _WALL
        return [(int(x), int(y)) for x, y in np.clip(found, 0, CELLS - 1)]

    def _inside(self, region: Region, places: Array) -> Mask:
        return np.array([region.cells[c] for c in self._cells(places)])

    def _iterate(self) -> Array:
        """``(CELLS, CELLS, 2)`` best of eight moves, which come out with half the probability, or
        else as one of both neighbouring ones."""
        blocked = self._floor.blocked
        goal = self._cells(self._arena.target[None])[0]
        reward = np.where(blocked, _OBSTACLE, _STEP)
        reward[goal] = _GOAL
        value, side, n = reward.copy(), 0.5 * (1.0 - _STRAIGHT), CELLS
        for _ in range(_SWEEPS):
            padded = np.pad(value, 1, constant_values=_OBSTACLE)
            after = np.array([padded[1 + a : 1 + a + n, 1 + b : 1 + b + n] for a, b in _MOVES])
            beside = np.roll(after, 1, axis=0) + np.roll(after, -1, axis=0)
            expected = _STRAIGHT * after + side * beside
            value = np.where(blocked, _OBSTACLE, _DISCOUNT * (reward + expected.max(axis=0)))
        ways: Array = _MOVES[expected.argmax(axis=0)].astype(float)
        return ways


def _unit(v: Array) -> Array:
    unit: Array = v / max(float(np.hypot(*v)), 1e-9)
    return unit


METHOD = open_room_method("global-input", GlobalInput)
