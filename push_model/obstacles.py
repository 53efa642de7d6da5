"""Obstacles that are not on the map: closed outlines and discs, as capsules for compiled code.

A capsule ``ax, ay, bx, by, radius`` is all that is at most ``radius`` from the segment between a
and b. A disc is a capsule without length; the edges of an outline are capsules without radius.
Functions without a unit in their docstrings work in any unit of length.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from push_model.arrays import Array


@dataclass(frozen=True)
class Obstacles:
    """Obstacles beside the map's walls.

    outlines: ``(m, 2)`` [m] each, simple polygons, world frame. discs: ``(k, 3)`` x, y, radius [m].
    """

    outlines: tuple[Array, ...] = ()
    discs: Array = field(default_factory=lambda: np.zeros((0, 3)))

    @cached_property
    def capsules(self) -> Array:
        """``(n, 5)`` [m]: the discs, then the edges of the outlines."""
        parts = [disc_capsules(self.discs)]
        for outline in self.outlines:
            ends = np.roll(outline, -1, axis=0)
            parts.append(np.column_stack([outline, ends, np.zeros(len(outline))]))
        return np.ascontiguousarray(np.vstack(parts))

    @cached_property
    def corners(self) -> Array:
        """``(n, 2)`` [m] of all outlines, one after the other."""
        return np.ascontiguousarray(np.vstack([np.zeros((0, 2)), *self.outlines]))

    @cached_property
    def last(self) -> NDArray[np.int64]:
        """``(k,)`` where in ``corners`` each outline ends."""
        return np.cumsum([len(outline) for outline in self.outlines], dtype=np.int64)


NOTHING = Obstacles()


def disc_capsules(discs: Array) -> Array:
    """``(n, 5)`` capsules of discs ``(n, 3)`` x, y, radius."""
    discs = np.reshape(np.asarray(discs, dtype=np.float64), (-1, 3))
    return np.column_stack([discs[:, :2], discs])


def scaled_capsules(capsules: Array, origin: tuple[float, float], scale: float) -> Array:
    """``(n, 5)`` capsules with a point ``origin`` as the new origin, in units of ``1 / scale``."""
    found: Array = (capsules - [*origin, *origin, 0.0]) * scale
    return found


@numba.njit(cache=True)
def point_gap(capsules: Any, k: int, u: float, v: float) -> float:
    """Distance of a point to capsule k, negative inside it."""
    ax, ay = capsules[k, 0], capsules[k, 1]
    du, dv = capsules[k, 2] - ax, capsules[k, 3] - ay
    square = du * du + dv * dv
    if square > 0.0:
        t = min(max(((u - ax) * du + (v - ay) * dv) / square, 0.0), 1.0)
        ax, ay = ax + t * du, ay + t * dv
    return math.hypot(u - ax, v - ay) - float(capsules[k, 4])


@numba.njit(cache=True)
def _from_segment(u: float, v: float, ax: float, ay: float, bx: float, by: float) -> float:
    du, dv = bx - ax, by - ay
    square = du * du + dv * dv
    t = 0.0
    if square > 0.0:
        t = min(max(((u - ax) * du + (v - ay) * dv) / square, 0.0), 1.0)
    return math.hypot(u - ax - t * du, v - ay - t * dv)


@numba.njit(cache=True)
def segment_gap(
    capsules: Any,
    k: int,
    u0: float,
    v0: float,
    du: float,
    dv: float,
    low: float,
    high: float,
) -> float:
    """Distance of a straight piece to capsule k, negative where it comes into it.

    The piece leads from (u0, v0), in the direction of the unit vector (du, dv), from ``low`` to
    ``high``.
    """
    ax, ay = capsules[k, 0], capsules[k, 1]
    bx, by, radius = capsules[k, 2], capsules[k, 3], float(capsules[k, 4])
    if ax == bx and ay == by:
        t = (ax - u0) * du + (ay - v0) * dv
        t = min(max(t, low), high)
        return math.hypot(u0 + du * t - ax, v0 + dv * t - ay) - radius
    cx, cy, ex, ey = u0 + du * low, v0 + dv * low, u0 + du * high, v0 + dv * high
    one = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    two = (bx - ax) * (ey - ay) - (by - ay) * (ex - ax)
    three = (ex - cx) * (ay - cy) - (ey - cy) * (ax - cx)
    four = (ex - cx) * (by - cy) - (ey - cy) * (bx - cx)
    if (one > 0.0) != (two > 0.0) and (three > 0.0) != (four > 0.0):
        return -radius
    least = min(_from_segment(cx, cy, ax, ay, bx, by), _from_segment(ex, ey, ax, ay, bx, by))
    least = min(least, _from_segment(ax, ay, cx, cy, ex, ey))
    return float(min(least, _from_segment(bx, by, cx, cy, ex, ey))) - radius


@numba.njit(cache=True)
def inside_polygon(corners: Any, first: int, last: int, u: float, v: float) -> bool:
    """Whether a point lies in the polygon of the corners from ``first`` to before ``last``."""
    within = False
    j = last - 1
    for k in range(first, last):
        if (corners[k, 1] > v) != (corners[j, 1] > v) and u < corners[k, 0] + (
            v - corners[k, 1]
        ) * (corners[j, 0] - corners[k, 0]) / (corners[j, 1] - corners[k, 1]):
            within = not within
        j = k
    return within


@numba.njit(cache=True)
def inside_outlines(corners: Any, last: Any, u: float, v: float) -> bool:
    """Whether a point lies in any of several outlines, see ``Obstacles``."""
    first = 0
    for k in range(last.shape[0]):
        if inside_polygon(corners, first, last[k], u, v):
            return True
        first = last[k]
    return False
