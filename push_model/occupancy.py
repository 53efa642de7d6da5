"""Occupancy grids of environments."""

import math
from array import array
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from push_model.arrays import Array
from push_model.specs import EnvironmentSpec

_TOUCH = 1e-7  # of a cell: an obstacle that only touches a cell does not reach into it


@dataclass(frozen=True)
class OccupancyGrid:
    """A grid of free and occupied cells.

    occupied: ``(rows, columns)`` bool, row 0 at the lowest y; resolution: [m] of a cell;
    origin: ``(2,)`` [m] of the lower left corner of cell (0, 0), world frame.
    """

    occupied: NDArray[np.bool_]
    resolution: float
    origin: Array

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """x_min, x_max, y_min, y_max [m]."""
        rows, columns = self.occupied.shape
        x, y = self.origin
        return x, x + columns * self.resolution, y, y + rows * self.resolution

    @property
    def free_extent(self) -> tuple[float, float, float, float] | None:
        """x_min, x_max, y_min, y_max [m] of the rectangle about the free cells; None without."""
        free = ~self.occupied
        rows, columns = np.flatnonzero(free.any(axis=1)), np.flatnonzero(free.any(axis=0))
        if not len(rows):
            return None
        (x, y), r = self.origin, self.resolution
        left, right = x + columns[0] * r, x + (columns[-1] + 1) * r
        return left, right, y + rows[0] * r, y + (rows[-1] + 1) * r

    def contains(self, x: float, y: float) -> bool:
        """Whether the point [m] lies on the grid."""
        x0, x1, y0, y1 = self.extent
        return x0 <= x < x1 and y0 <= y < y1

    def equals(self, other: "OccupancyGrid") -> bool:
        """Whether both are the same map."""
        return (
            self.resolution == other.resolution
            and np.array_equal(self.origin, other.origin)
            and np.array_equal(self.occupied, other.occupied)
        )

    def boundary_points(self, spacing: float) -> Array:
        """``(n, 2)`` [m] centres of occupied cells beside free ones, about ``spacing`` apart."""
        occupied = self.occupied
        padded = np.pad(occupied, 1, constant_values=True)
        inner = padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
        rows, columns = np.nonzero(occupied & ~inner)
        points = np.column_stack([columns, rows]) + 0.5
        keys = np.floor(points * self.resolution / spacing).astype(np.int64)
        _, first = np.unique(keys, axis=0, return_index=True)
        return points[np.sort(first)] * self.resolution + self.origin

    def rectangles(self) -> Array:
        """``(n, 4)`` x_min, x_max, y_min, y_max [m] of disjoint rectangles of occupied cells.

        Runs of occupied cells along the rows; equal runs in rows one above the other are one.
        """
        found = array("l")  # flat: maps can have a million rectangles
        open_runs: dict[tuple[int, int], int] = {}
        rows = self.occupied.shape[0]
        for row in range(rows + 1):
            runs: dict[tuple[int, int], int] = {}
            if row < rows:
                steps = np.diff(self.occupied[row].astype(np.int8), prepend=0, append=0)
                ends = np.flatnonzero(steps).reshape(-1, 2).tolist()
                runs = {(a, b): open_runs.pop((a, b), row) for a, b in ends}
            for (a, b), first in open_runs.items():
                found.extend((a, b, first, row))
            open_runs = runs
        corners = np.array(found, dtype=np.float64).reshape(-1, 4) * self.resolution
        return corners + self.origin[[0, 0, 1, 1]]


@dataclass(frozen=True)
class MapSpec:
    """An environment given by a grid; occupied cells are walls."""

    grid: OccupancyGrid
    wall_height: float
    wall_friction: float


def rasterise(environment: EnvironmentSpec | MapSpec, border: int = 2) -> OccupancyGrid:
    """The grid of an environment; a cell is occupied when an obstacle reaches into it.

    So no part of an obstacle is left out, and none is more than a cell's diagonal too large. The
    border is occupied always.
    """
    if isinstance(environment, MapSpec):
        return environment.grid
    r = environment.resolution
    columns = math.ceil(environment.size[0] / r - _TOUCH) + 2 * border
    rows = math.ceil(environment.size[1] / r - _TOUCH) + 2 * border
    origin = np.array([-columns * r / 2.0, -rows * r / 2.0])
    half = np.array(environment.size) / (2.0 * r)
    low = np.ceil(np.array([columns, rows]) / 2.0 - half - _TOUCH).astype(int)
    high = np.floor(np.array([columns, rows]) / 2.0 + half + _TOUCH).astype(int)
    occupied = np.ones((rows, columns), dtype=np.bool_)
    occupied[low[1] : high[1], low[0] : high[0]] = False
    for box in environment.boxes:
        c, s = math.cos(box.yaw), math.sin(box.yaw)
        corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * box.size / 2.0
        vertices = corners @ np.array([[c, s], [-s, c]]) + box.centre
        _fill_polygon(occupied, (vertices - origin) / r)
    for circle in environment.circles:
        _fill_circle(occupied, (np.array(circle.centre) - origin) / r, circle.radius / r)
    for polygon in environment.polygons:
        _fill_polygon(occupied, (np.array(polygon.vertices) - origin) / r)
    return OccupancyGrid(occupied, r, origin)


def _window(occupied: NDArray[np.bool_], low: Array, high: Array) -> tuple[Any, Array, Array]:
    """The cells that lie in a box of cell units, with the x and y of their centres."""
    first = np.maximum(np.floor(low + _TOUCH).astype(int), 0)
    last = np.maximum(np.minimum(np.ceil(high - _TOUCH).astype(int), occupied.shape[::-1]), first)
    x, y = np.arange(first[0], last[0]) + 0.5, (np.arange(first[1], last[1]) + 0.5)[:, None]
    return occupied[first[1] : last[1], first[0] : last[0]], x, y


def _fill_polygon(occupied: NDArray[np.bool_], vertices: Array) -> None:
    """Occupy what a convex polygon ``(n, 2)`` in cell units overlaps.

    Two convex shapes overlap unless the direction of a side of one of them parts them: the window
    is the directions of the cells, the sides of the polygon are the others.
    """
    cells, x, y = _window(occupied, vertices.min(axis=0), vertices.max(axis=0))
    ends = np.roll(vertices, -1, axis=0)
    turn = vertices[:, 0] @ ends[:, 1] - vertices[:, 1] @ ends[:, 0]
    overlap = np.ones(cells.shape, dtype=np.bool_)
    for a, b in zip(vertices, ends, strict=True):
        length = math.hypot(b[0] - a[0], b[1] - a[1])
        nx, ny = np.array([a[1] - b[1], b[0] - a[0]]) * math.copysign(1.0, turn) / length
        inside = nx * (x - a[0]) + ny * (y - a[1]) + 0.5 * (abs(nx) + abs(ny))
        overlap &= inside > _TOUCH
    cells |= overlap


def _fill_circle(occupied: NDArray[np.bool_], centre: Array, radius: float) -> None:
    """Occupy what a disc in cell units overlaps."""
    cells, x, y = _window(occupied, centre - radius, centre + radius)
    dx = np.maximum(np.abs(x - centre[0]) - 0.5, 0.0)
    dy = np.maximum(np.abs(y - centre[1]) - 0.5, 0.0)
    cells |= np.hypot(dx, dy) < radius - _TOUCH
