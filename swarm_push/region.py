"""The convex region of a map that a swarm covers."""

import numpy as np

from push_model.arrays import Array
from push_model.occupancy import OccupancyGrid


def is_open(grid: OccupancyGrid) -> bool:
    """Whether the free cells of a map fill a rectangle."""
    free = ~grid.occupied
    rows, columns = np.flatnonzero(free.any(axis=1)), np.flatnonzero(free.any(axis=0))
    if not len(rows):
        return False
    return bool(free[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].all())


def covered_region(grid: OccupancyGrid, margin: float) -> Array | None:
    """``(4, 2)`` [m] corners, counter-clockwise, of the rectangle about the free cells of a map,
    so far [m] from its sides; None where there is no room."""
    extent = grid.free_extent
    if extent is None:
        return None
    left, right, low, high = extent
    if min(right - left, high - low) <= 2.0 * margin:
        return None
    left, low, right, high = left + margin, low + margin, right - margin, high - margin
    return np.array([[left, low], [right, low], [right, high], [left, high]])
