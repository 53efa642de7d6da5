"""Distance to the nearest obstacle, everywhere on an occupancy grid."""

import math
from collections.abc import Sequence
from typing import Any

import numba
import numpy as np
from scipy.ndimage import distance_transform_edt

from push_model.arrays import Array
from push_model.occupancy import OccupancyGrid


@numba.njit(cache=True, fastmath=True)
def lookup(field: Any, x: float, y: float, ox: float, oy: float, scale: float) -> float:
    """Bilinear interpolation between cell centres; 0 outside the grid."""
    u = (x - ox) * scale - 0.5
    v = (y - oy) * scale - 0.5
    j = int(math.floor(u))
    i = int(math.floor(v))
    if i < 0 or j < 0 or i >= field.shape[0] - 1 or j >= field.shape[1] - 1:
        return 0.0
    a = u - j
    b = v - i
    low = (1.0 - a) * field[i, j] + a * field[i, j + 1]
    high = (1.0 - a) * field[i + 1, j] + a * field[i + 1, j + 1]
    return float((1.0 - b) * low + b * high)


@numba.njit(cache=True, fastmath=True)
def points_clearance(
    field: Any,
    points: Any,
    x: float,
    y: float,
    theta: float,
    ox: float,
    oy: float,
    scale: float,
) -> float:
    """Least distance [m] of points ``(n, 2)`` of a body at a pose, by bilinear interpolation."""
    c, s = math.cos(theta), math.sin(theta)
    least = 1e9
    for k in range(points.shape[0]):
        px = x + c * points[k, 0] - s * points[k, 1]
        py = y + s * points[k, 0] + c * points[k, 1]
        d = lookup(field, px, py, ox, oy, scale)
        if d < least:
            least = d
    return float(least)


@numba.njit(cache=True, fastmath=True)
def _segment_clearance(
    field: Any,
    x0: float,
    y0: float,
    x1: float,
    y1: float,
    ox: float,
    oy: float,
    scale: float,
    enough: float,
) -> float:
    """Least distance along a segment, by steps of a cell; stops once it is below ``enough``."""
    length = math.hypot(x1 - x0, y1 - y0)
    n = int(length * scale) + 1
    least = 1e9
    for k in range(n + 1):
        t = k / n
        d = lookup(field, x0 + (x1 - x0) * t, y0 + (y1 - y0) * t, ox, oy, scale)
        if d < least:
            least = d
            if least < enough:
                return float(least)
    return float(least)


class DistanceField:
    """Euclidean distance [m] from a point to the nearest occupied cell's edge."""

    def __init__(self, grid: OccupancyGrid) -> None:
        self.grid = grid
        cells = distance_transform_edt(~grid.occupied)
        # Measured between cell centres: half a cell less reaches the obstacle's edge.
        self.values: Array = np.maximum(0.0, (cells - 0.5) * grid.resolution)
        self.args = (float(grid.origin[0]), float(grid.origin[1]), 1.0 / grid.resolution)

    def at(self, x: float, y: float) -> float:
        """[m] at a point; 0 outside the grid."""
        return float(lookup(self.values, x, y, *self.args))

    def clearance(self, outline: Array, pose: Array) -> float:
        """[m] of an outline ``(n, 2)`` placed at a pose ``(3,)``."""
        return float(points_clearance(self.values, outline, pose[0], pose[1], pose[2], *self.args))

    def segment(
        self, start: Sequence[float] | Array, end: Sequence[float] | Array, enough: float = -1.0
    ) -> float:
        """[m] least distance along a segment between points ``(2,)``."""
        return float(
            _segment_clearance(self.values, start[0], start[1], end[0], end[1], *self.args, enough)
        )
