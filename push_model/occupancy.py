"""Occupancy grids of environments."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from push_model.arrays import Array
from push_model.specs import EnvironmentSpec


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
        """``(n, 4)`` x_min, x_max, y_min, y_max [m] of disjoint rectangles of occupied cells."""
        left = self.occupied.copy()
        found = []
        for row, column in np.argwhere(left).tolist():
            if not left[row, column]:
                continue
            across = left[row, column:]
            gaps = np.flatnonzero(~across)
            width = int(gaps[0]) if len(gaps) else across.shape[0]
            full = left[row:, column : column + width].all(axis=1)
            ends = np.flatnonzero(~full)
            height = int(ends[0]) if len(ends) else full.shape[0]
            left[row : row + height, column : column + width] = False
            found.append((column, column + width, row, row + height))
        corners = np.array(found, dtype=np.float64).reshape(-1, 4) * self.resolution
        return corners + self.origin[[0, 0, 1, 1]]


@dataclass(frozen=True)
class MapSpec:
    """An environment given by a grid; occupied cells are walls."""

    grid: OccupancyGrid
    wall_height: float
    wall_friction: float


def rasterise(environment: EnvironmentSpec | MapSpec, border: int = 2) -> OccupancyGrid:
    """The grid of an environment; a cell is occupied when its centre is, the border always."""
    if isinstance(environment, MapSpec):
        return environment.grid
    r = environment.resolution
    columns = math.ceil(environment.size[0] / r - 1e-9) + 2 * border
    rows = math.ceil(environment.size[1] / r - 1e-9) + 2 * border
    origin = np.array([-columns * r / 2.0, -rows * r / 2.0])
    x = origin[0] + (np.arange(columns) + 0.5) * r
    y = origin[1] + (np.arange(rows) + 0.5) * r
    gx, gy = np.meshgrid(x, y)
    half_x, half_y = environment.size[0] / 2.0, environment.size[1] / 2.0
    occupied = (np.abs(gx) > half_x) | (np.abs(gy) > half_y)
    for box in environment.boxes:
        c, s = math.cos(box.yaw), math.sin(box.yaw)
        dx, dy = gx - box.centre[0], gy - box.centre[1]
        u, v = c * dx + s * dy, -s * dx + c * dy
        occupied |= (np.abs(u) <= box.size[0] / 2.0) & (np.abs(v) <= box.size[1] / 2.0)
    for circle in environment.circles:
        occupied |= np.hypot(gx - circle.centre[0], gy - circle.centre[1]) <= circle.radius
    for polygon in environment.polygons:
        vertices = np.array(polygon.vertices)
        ends = np.roll(vertices, -1, axis=0)
        side = np.stack(
            [
                (b[0] - a[0]) * (gy - a[1]) - (b[1] - a[1]) * (gx - a[0])
                for a, b in zip(vertices, ends, strict=True)
            ]
        )
        occupied |= (side >= 0.0).all(axis=0) | (side <= 0.0).all(axis=0)
    return OccupancyGrid(occupied, r, origin)
