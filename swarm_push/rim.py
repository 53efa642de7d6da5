"""The line on which the centres of round robots lie that touch an object's convex hull."""

import numpy as np
from numpy.typing import NDArray

from push_model.arrays import Array
from push_model.outlines import convex_hull

_DIRECTIONS = 720

Nearest = tuple[NDArray[np.int64], Array]
"""Which of a rim's points ``(n,)`` is the nearest to each of some others, and how far ``(n,)`` [m]
these lie inward of it, negative outside."""


class Rim:
    """Points at even distances along that line, in the object's frame.

    points ``(m, 2)`` [m], counter-clockwise; normals ``(m, 2)`` unit, inward; length [m] of it all.
    """

    def __init__(self, outline: Array, radius: float, spacing: float) -> None:
        """outline: ``(k, 2)`` [m] of the object about its centre of mass. radius: [m] of the
        robots. spacing: [m] between points, at most."""
        angle = np.arange(_DIRECTIONS) / _DIRECTIONS * 2.0 * np.pi
        out = np.column_stack([np.cos(angle), np.sin(angle)])
        hull = convex_hull(outline)
        line = hull[np.argmax(out @ hull.T, axis=1)] + radius * out
        ring = np.vstack([line, line[:1]])
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(ring, axis=0).T))])
        self.length = float(way[-1])
        count = max(8, int(np.ceil(self.length / spacing)))
        at = np.arange(count) / count * self.length
        self.points = np.column_stack([np.interp(at, way, column) for column in ring.T])
        # A step of the line is along an edge of the hull or round a corner: its middle direction
        # is the normal there.
        k = np.clip(np.searchsorted(way, at, side="right") - 1, 0, _DIRECTIONS - 1)
        step = np.diff(ring, axis=0)[k]
        normal = np.column_stack([-step[:, 1], step[:, 0]])
        self.normals = normal / np.hypot(*normal.T)[:, None]

    def nearest(self, points: Array) -> Nearest:
        """Of points ``(n, 2)`` [m]."""
        k = np.hypot(*(points[:, None] - self.points[None]).transpose(2, 0, 1)).argmin(axis=1)
        depth: Array = ((points - self.points[k]) * self.normals[k]).sum(axis=1)
        return k, depth

    def approach(self, twist: Array) -> Array:
        """``(m,)`` [m/s] at which the points flee inward when the object moves with a twist
        ``(3,)`` in its frame: where that is much, robots push it so."""
        vx = twist[0] - twist[2] * self.points[:, 1]
        vy = twist[1] + twist[2] * self.points[:, 0]
        speed: Array = vx * self.normals[:, 0] + vy * self.normals[:, 1]
        return speed
