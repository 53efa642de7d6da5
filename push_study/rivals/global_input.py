"""One input for all robots: Shahrokhi, Lin, Ertel, Wan and Becker, T-RO 2018.

Value iteration on a 20 x 20 grid says whereto the object goes next (moves in eight directions that
come out with 0.5, else one of both neighbouring ones; discount 0.97, 200 sweeps; +100, -100, -1).
The swarm's mean is driven behind the object and against it by a PD law (4, 1), round it by a
repulsive field in the half plane before it (75 within 3, attraction 2). When the swarm's variance
is too great, it is driven into the nearest corner until it is small again; when its mean has not
moved for 5 s, into another one.

Reconstructed: lengths are in units of two robots' radii, for which the published gains are. The
point that the mean is driven to lies half the swarm's deviation and the object's radius behind its
centre, and 0.2 of that beyond the centre when it pushes. Regrouping ends in the corner. Transfer
regions, of which an open room has none, are left out.
"""

import math

import numpy as np

from push_job.open_room import OpenRoom, open_room_method
from push_model.arrays import Array

_CELLS, _SWEEPS, _DISCOUNT = 20, 200, 0.97
_KP, _KD = 4.0, 1.0
_REPULSION, _ATTRACTION, _NEAR = 75.0, 2.0, 3.0
_STUCK, _STILL = 5.0, 0.02  # [s] without so much [m] of motion
_CONE = 0.25 * math.pi  # of directions to the mean from which it pushes
_MOVES = np.array([[0, 1], [1, 1], [1, 0], [1, -1], [0, -1], [-1, -1], [-1, 0], [-1, 1]])


class GlobalInput:
    """See the module."""

    def __init__(self, arena: OpenRoom) -> None:
        self._arena, self._unit = arena, 2.0 * arena.radius
        outline = arena.item.geometry.outline
        self._reach = float(np.hypot(*outline.T).max())
        self._half = 0.5 * np.array(arena.size)
        self._policy = self._iterate()
        self._before: tuple[float, Array] | None = None
        self._regrouping = False
        self._corner = 0
        self._still: tuple[float, Array] | None = None

    def velocities(self, time: float, pose: Array, robots: Array) -> Array:
        """See VelocityLaw."""
        points = robots[:, :2]
        mean = points.mean(axis=0)
        variance = float(points.var(axis=0).sum()) / self._unit**2
        rate = np.zeros(2)
        if self._before is not None and time > self._before[0]:
            rate = (mean - self._before[1]) / (time - self._before[0])
        self._before = time, mean
        self._judge(time, mean, variance, len(points))
        if self._regrouping:
            goal, push = self._corners()[self._corner], False
        else:
            goal, push = self._behind(pose[:2], mean, math.sqrt(variance) * self._unit)
        u = _KP * (goal - mean) / self._unit - _KD * rate / self._unit
        if not push:
            u = self._field(pose[:2], mean, goal)
        size = float(np.hypot(*u))
        u = u * min(1.0, 1.0 / max(size, 1e-9)) * self._arena.speed
        return np.repeat(u[None], len(points), axis=0)

    def _judge(self, time: float, mean: Array, variance: float, count: int) -> None:
        """Whether to regroup, and where."""
        r, width = 0.5, self._arena.size[0] / self._unit
        least = 2.5 * r + 0.55 * count * r**2 + 0.003 * width
        most = 15.0 * r + 0.55 * count * r**2 + 0.006 * width
        if self._still is None or np.hypot(*(mean - self._still[1])) > _STILL:
            self._still = time, mean
        stuck = time - self._still[0] > _STUCK
        if stuck:
            self._corner = (self._corner + 1) % 4
            self._regrouping, self._still = True, (time, mean)
        elif not self._regrouping and variance > most:
            away = np.hypot(*(self._corners() - mean).T)
            self._regrouping, self._corner = True, int(away.argmin())
        elif self._regrouping and variance < least:
            away = float(np.hypot(*(self._corners()[self._corner] - mean)))
            self._regrouping = away > 3.0 * math.sqrt(variance) * self._unit

    def _corners(self) -> Array:
        corners: Array = self._half * np.array([[1.0, 1], [-1, 1], [-1, -1], [1, -1]])
        return corners

    def _behind(self, item: Array, mean: Array, spread: float) -> tuple[Array, bool]:
        """Where the mean is to go, and whether it pushes."""
        ahead = self._direction(item)
        away = self._reach + 0.5 * spread
        offset = item - mean
        angle = abs(math.atan2(ahead[0] * offset[1] - ahead[1] * offset[0], float(ahead @ offset)))
        if angle < _CONE and np.hypot(*offset) < 1.5 * away + self._unit:
            return item + 0.2 * away * ahead, True
        return item - away * ahead, False

    def _field(self, item: Array, mean: Array, goal: Array) -> Array:
        """Attraction to a place behind the object, repulsion in the half plane before it, or all
        round where the swarm regroups."""
        pull = goal - mean
        u = _ATTRACTION * pull / max(float(np.hypot(*pull)), 1e-9)
        away = mean - item
        gap = (float(np.hypot(*away)) - self._reach) / self._unit
        before = self._regrouping or float(away @ self._direction(item)) > 0.0
        if before and gap < _NEAR:
            gap = max(gap, 0.1)
            strength = _REPULSION * (1.0 / gap - 1.0 / _NEAR) / gap**2
            unit = away / max(float(np.hypot(*away)), 1e-9)
            side = np.array([-unit[1], unit[0]])
            side *= 1.0 if side @ pull >= 0.0 else -1.0  # round it, not to and fro
            u = u + min(strength, 2.0 * _ATTRACTION) * unit + _ATTRACTION * side
        return u

    def _cell(self, point: Array) -> tuple[int, int]:
        k = np.floor((point + self._half) / (2.0 * self._half) * _CELLS).astype(int)
        x, y = np.clip(k, 0, _CELLS - 1)
        return int(x), int(y)

    def _direction(self, item: Array) -> Array:
        """Unit vector in which the object is to go."""
        straight: Array = self._arena.target - item
        if np.hypot(*straight) < 3.0 * self._half.max() / _CELLS:
            straight /= max(float(np.hypot(*straight)), 1e-9)
            return straight
        move: Array = _MOVES[self._policy[self._cell(item)]]
        unit: Array = move / float(np.hypot(*move))
        return unit

    def _iterate(self) -> Array:
        """The best of the eight moves in every cell."""
        n = _CELLS
        goal = self._cell(self._arena.target)
        inner = int(math.ceil(self._reach / (2.0 * self._half[0] / n)))
        reward = np.full((n, n), -1.0)
        edge = np.ones((n, n), dtype=bool)
        edge[inner:-inner, inner:-inner] = False
        reward[edge] = -100.0
        reward[goal] = 100.0
        value = np.zeros((n, n))
        for _ in range(_SWEEPS):
            padded = np.pad(value, 1, mode="edge")
            after = np.array([padded[1 + a : 1 + a + n, 1 + b : 1 + b + n] for a, b in _MOVES])
            expected = 0.5 * after + 0.25 * (np.roll(after, 1, axis=0) + np.roll(after, -1, axis=0))
            value = reward + _DISCOUNT * expected.max(axis=0)
            value[goal] = 100.0
        best: Array = expected.argmax(axis=0)
        return best


METHOD = open_room_method("global-input", GlobalInput)
