"""Ways of robots round an object: towards a place on its other side, without touching it.

They lead round its convex hull, and straight into its notches. All in the object's frame. Compiled,
for there may be a thousand robots.
"""

import math
from functools import lru_cache
from typing import Any

import numba
import numpy as np

from push_model.arrays import Array
from push_model.outlines import convex_hull
from swarm_push.rim import Rim

_NEAR = 3.0  # robot radii from its goal within which a robot goes there along the object
_SPARE = 0.02  # [m] beyond its depth at which the straight way into a notch begins


class WayRound:
    """Ways of round robots around one object."""

    def __init__(
        self,
        outline: Array,
        radius: float,
        clearance: float,
        slide: float,
        others: Array | None = None,
    ) -> None:
        """Prepare ways round one object, or round it and what stands beside it.

        Parameters
        ----------
        outline: ``(k, 2)`` [m] about the centre of mass. radius: [m] of the robots. clearance: [m]
            that robots keep from the object on their way round it. slide: [m] by which the aim of
            a robot that slides along the object may lie inside it. others: ``(k, 3)`` x, y, radius
            [m], in the object's frame, of bodies beside the object; robots go round all together.
        """
        self._radius = radius
        whole = convex_hull(np.vstack([outline, *map(_disc, () if others is None else others)]))
        self._way = Rim(whole, radius + clearance, 0.05).points
        self._keep = Rim(whole, radius + 0.6 * clearance, 0.02).points
        self._core = _core(np.ascontiguousarray(outline).tobytes(), radius - slide)

    def aims(self, robots: Array, goals: Array) -> tuple[Array, Array]:
        """Where robots ``(n, 2)`` [m] head for on their ways to goals ``(n, 2)``, and how far
        ``(n,)`` [m] they have to go."""
        aims, length = _aims(
            np.ascontiguousarray(robots),
            np.ascontiguousarray(goals),
            self._way,
            self._keep,
            self._core,
            _NEAR * self._radius,
        )
        return aims, length


@lru_cache(maxsize=64)
def _core(outline: bytes, away: float) -> Array:
    """``(k, 2)`` [m] the line so far from an outline, which is the same whatever stands about."""
    return Rim(np.frombuffer(outline).reshape(-1, 2), away, 5e-3).points


def _disc(other: Array) -> Array:
    angle = np.arange(12) * math.pi / 6.0
    corners: Array = other[:2] + other[2] * np.column_stack([np.cos(angle), np.sin(angle)])
    return corners


@numba.njit(cache=True, error_model="numpy")
def _blocked(ax: float, ay: float, bx: float, by: float, polygon: Any) -> bool:
    """Whether the way from a to b leads through a convex polygon, counter-clockwise."""
    low, high = 0.0, 1.0
    n = polygon.shape[0]
    for k in range(n):
        px, py = polygon[k, 0], polygon[k, 1]
        u = k + 1 if k + 1 < n else 0
        nx, ny = polygon[u, 1] - py, px - polygon[u, 0]  # outward
        a, b = nx * (ax - px) + ny * (ay - py), nx * (bx - px) + ny * (by - py)
        if a >= 0.0 and b >= 0.0:
            return False
        if a > 0.0:
            low = max(low, a / (a - b))
        elif b > 0.0:
            high = min(high, a / (a - b))
        if high - low < 1e-9:
            return False
    return True


@numba.njit(cache=True, error_model="numpy")
def _enters(ax: float, ay: float, bx: float, by: float, polygon: Any) -> bool:
    """Whether the way from a to b leads through any polygon, or begins in it."""
    n = polygon.shape[0]
    within = False
    for k in range(n):
        px, py = polygon[k, 0], polygon[k, 1]
        u = k + 1 if k + 1 < n else 0
        qx, qy = polygon[u, 0], polygon[u, 1]
        if (py > ay) != (qy > ay) and ax < px + (ay - py) * (qx - px) / (qy - py):
            within = not within
        c = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
        d = (bx - ax) * (qy - ay) - (by - ay) * (qx - ax)
        e = (qx - px) * (ay - py) - (qy - py) * (ax - px)
        f = (qx - px) * (by - py) - (qy - py) * (bx - px)
        if (c > 0.0) != (d > 0.0) and (e > 0.0) != (f > 0.0):
            return True
    return within


@numba.njit(cache=True, error_model="numpy")
def _closest(x: float, y: float, way: Any) -> int:
    best, found = math.inf, 0
    for k in range(way.shape[0]):
        d = (way[k, 0] - x) ** 2 + (way[k, 1] - y) ** 2
        if d < best:
            best, found = d, k
    return found


@numba.njit(cache=True, error_model="numpy")
def _gate(x: float, y: float, way: Any, core: Any) -> Any:
    """The way's closest point to a place from which a straight line leads there, by number."""
    best, found = math.inf, _closest(x, y, way)
    if not _enters(way[found, 0], way[found, 1], x, y, core):
        return found
    for k in range(way.shape[0]):
        d = (way[k, 0] - x) ** 2 + (way[k, 1] - y) ** 2
        if d < best and not _enters(way[k, 0], way[k, 1], x, y, core):
            best, found = d, k
    return found


@numba.njit(cache=True, error_model="numpy")
def _aims(robots: Any, goals: Any, way: Any, keep: Any, core: Any, near: float) -> Any:
    n, m = robots.shape[0], way.shape[0]
    step = math.hypot(way[1, 0] - way[0, 0], way[1, 1] - way[0, 1])
    aims, length = np.empty((n, 2)), np.empty(n)
    for i in range(n):
        x, y, gx, gy = robots[i, 0], robots[i, 1], goals[i, 0], goals[i, 1]
        straight = math.hypot(gx - x, gy - y)
        aims[i, 0], aims[i, 1], length[i] = gx, gy, straight
        last = _gate(gx, gy, way, core)
        # The goal may lie at the object: the way leads to what is outside of it, then straight in.
        tail = math.hypot(gx - way[last, 0], gy - way[last, 1])
        close = near
        if tail + _SPARE > near and _blocked(gx, gy, gx, gy, keep):
            close = tail + _SPARE
        if straight < close and not _enters(x, y, gx, gy, core):
            continue
        if not _blocked(x, y, gx, gy, keep):
            continue
        if not _blocked(x, y, way[last, 0], way[last, 1], keep):
            aims[i, 0], aims[i, 1] = way[last, 0], way[last, 1]
            length[i] = math.hypot(way[last, 0] - x, way[last, 1] - y) + tail
            continue
        first = _closest(x, y, way)
        ahead = (last - first) % m
        turn = 1 if ahead <= m - ahead else -1
        steps = min(ahead, m - ahead)
        aim = (first + turn) % m
        for k in range(steps, 0, -1):
            j = (first + turn * k) % m
            if not _blocked(x, y, way[j, 0], way[j, 1], keep):
                aim = j
                steps -= k
                break
        aims[i, 0], aims[i, 1] = way[aim, 0], way[aim, 1]
        length[i] = math.hypot(way[aim, 0] - x, way[aim, 1] - y) + steps * step + tail
    return aims, length
