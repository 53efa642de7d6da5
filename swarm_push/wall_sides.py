"""Sides of the walls of a map: where an occupied cell meets a free one."""

import numpy as np
from numpy.typing import NDArray

from push_model.arrays import Array
from push_model.occupancy import OccupancyGrid


def wall_sides(grid: OccupancyGrid) -> Array:
    """``(n, 2, 2)`` [m] ends of the sides of walls; the free space is to the left of each."""
    solid = np.pad(grid.occupied, 1, constant_values=True)
    # A step from solid to free (-1) or from free to solid (1), from one row to the next one.
    up = solid[1:, 1:-1].astype(np.int8) - solid[:-1, 1:-1]
    # Rows of the transposed map: x and y change places, and so do left and right.
    right = (solid[1:-1, 1:].astype(np.int8) - solid[1:-1, :-1]).T
    cells = np.concatenate([_runs(up), _runs(right)[:, ::-1, ::-1]])
    sides: Array = np.ascontiguousarray(cells * grid.resolution + grid.origin)
    return sides


def _runs(steps: NDArray[np.int8]) -> Array:
    """``(n, 2, 2)`` ends [cells] of the runs of equal steps in rows ``(rows + 1, columns)``."""
    found = []
    for sign in (-1, 1):
        ends = np.diff((steps == sign).astype(np.int8), axis=1, prepend=0, append=0)
        first, last = np.argwhere(ends > 0)[:, ::-1], np.argwhere(ends < 0)[:, ::-1]
        # Free above: to the left of a side that goes to +x.
        pair = (first, last) if sign < 0 else (last, first)
        found.append(np.stack(pair, axis=1).astype(np.float64))
    return np.concatenate(found)
