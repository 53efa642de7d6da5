"""Occlusion: Chen, Gauci, Li, Kolling and Gross, T-RO 2015, as Queiroz and MacRae 2024 run it.

Every robot for itself: look for the object, go to it, and at it push where the object hides the
goal and nobody is between, else move along it. After a minute at the object it walks off at random.

Reconstructed: robots see all round and over each other; the object hides the goal where the
straight line to it passes through the outline. They push square to the outline, and keep a
distance from it as they move along it, as Chen's wall following does. Distances of the second
paper are kept, for the robots are about as large.
"""

import math

import numba
import numpy as np

from push_job.open_room import OpenRoom, open_room_method
from push_model import se2
from push_model.arrays import Array, Mask, Rows
from push_model.outlines import distance

_AT = 0.1  # [m] from the object: at it
_NEAR, _KEEP = 0.04, 0.2  # [m] between which a robot that moves along it stays
_TIMEOUT, _WALK = 60.0, 5.0  # [s] at the object, and of a walk then
_TURN = 2.0  # [rad/s] of a random walk's direction, standard deviation
_DT = 0.02
_LOOKS = 60


class Occlusion:
    """See the module."""

    def __init__(self, arena: OpenRoom) -> None:
        self._arena = arena
        self._outline = outline = arena.item.geometry.outline
        following = np.roll(outline, -1, axis=0)
        part = np.linspace(0.0, 1.0, 40, endpoint=False)[:, None, None]
        self._ring = (outline + part * (following - outline)).reshape(-1, 2)
        self._random = np.random.default_rng(arena.seed)
        self._since = np.zeros(0)  # [s] of being at the object
        self._walking = np.zeros(0)  # [s] until which it walks
        self._heading = np.zeros(0)
        self._side = np.zeros(0)

    def velocities(self, time: float, pose: Array, robots: Array) -> Array:
        """See VelocityLaw."""
        points, n = robots[:, :2], len(robots)
        if len(self._since) != n:
            self._since, self._walking = np.full(n, math.inf), np.full(n, -math.inf)
            self._heading = robots[:, 2].copy()
            self._side = self._random.choice([-1.0, 1.0], n)
        local = se2.transform(se2.inverse(pose), points)
        gap = distance(self._outline, local) - self._arena.radius
        towards = (self._ring[_nearest(local, self._ring)] - local) @ se2.rotation_matrix(
            float(pose[2])
        ).T
        towards /= np.maximum(np.hypot(*towards.T), 1e-9)[:, None]
        target = se2.transform(se2.inverse(pose), self._arena.target[None])[0]
        hidden = _hidden(self._outline, local, target)
        clear = self._clear(points, towards, gap)
        at = gap < _AT
        self._since = np.where(at, np.minimum(self._since, time), math.inf)
        off = time - self._since > _TIMEOUT
        self._walking[off] = time + _WALK
        self._since[off] = math.inf
        along = np.column_stack([-towards[:, 1], towards[:, 0]]) * self._side[:, None]
        along = along + np.where((gap > _KEEP)[:, None], towards, 0.0)
        along = along - np.where((gap < _NEAR)[:, None], towards, 0.0)
        moved = np.where((at & hidden & clear)[:, None] | ~at[:, None], towards, along)
        self._heading += self._random.normal(0.0, _TURN * math.sqrt(_DT), n)
        walk = np.column_stack([np.cos(self._heading), np.sin(self._heading)])
        moved = np.where((time < self._walking)[:, None], walk, moved)
        speed: Array = self._arena.speed * moved / np.maximum(np.hypot(*moved.T), 1e-9)[:, None]
        return speed

    def _clear(self, points: Array, towards: Array, gap: Array) -> Mask:
        """Whether no robot is between one and the object."""
        d = points[None] - points[:, None]
        ahead = (d * towards[:, None]).sum(axis=2)
        aside = np.abs(d[..., 0] * towards[:, None, 1] - d[..., 1] * towards[:, None, 0])
        r = self._arena.radius
        between = (ahead > 0.5 * r) & (ahead < gap[:, None] + 2.0 * r) & (aside < r)
        clear: Mask = ~between.any(axis=1)
        return clear


@numba.njit(cache=True)
def _nearest(points: Array, ring: Array) -> Rows:
    """``(n,)`` the number of the nearest one of points ``(m, 2)`` to each of ``(n, 2)``."""
    found = np.zeros(len(points), dtype=np.intp)
    for i in range(len(points)):
        least = math.inf
        for k in range(len(ring)):
            away = math.hypot(points[i, 0] - ring[k, 0], points[i, 1] - ring[k, 1])
            if away < least:
                found[i], least = k, away
    return found


@numba.njit(cache=True)
def _hidden(outline: Array, points: Array, target: Array) -> Mask:
    """``(n,)`` whether the straight line from one of points ``(n, 2)`` to the target passes through
    the outline, as far as some points of the line tell."""
    found = np.zeros(len(points), dtype=np.bool_)
    for i in range(len(points)):
        for part in range(_LOOKS):
            x = points[i, 0] + part / (_LOOKS - 1) * (target[0] - points[i, 0])
            y = points[i, 1] + part / (_LOOKS - 1) * (target[1] - points[i, 1])
            odd = False
            for k in range(len(outline)):
                ax, ay = outline[k]
                bx, by = outline[(k + 1) % len(outline)]
                if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
                    odd = not odd
            if odd:
                found[i] = True
                break
    return found


METHOD = open_room_method("occlusion", Occlusion)
