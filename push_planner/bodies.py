"""Other bodies on the map: what stands in the way now, for one plan."""

from dataclasses import replace

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.occupancy import OccupancyGrid
from push_model.outlines import distance, inside


def with_bodies(
    grid: OccupancyGrid, circles: Array, outline: Array, start: Array, margin: float
) -> OccupancyGrid:
    """A copy of the map on which the cells under other bodies are occupied.

    A body that stands beside the object's start gets only as wide as leaves the object its margin:
    the circle about a body holds more than the body, and where the object stands it stands.

    Parameters
    ----------
    circles: ``(n, 3)`` [m] x, y, radius.
    outline: ``(m, 2)`` [m] of the object. start: ``(3,)`` its pose. margin: [m] that plans keep.
    """
    occupied = grid.occupied.copy()
    points = se2.transform(start, outline)
    cell = grid.resolution
    room = margin + 1.5 * cell  # a marked cell reaches a diagonal beyond the circle
    for x, y, radius in circles:
        middle = np.array([[x, y]])
        apart = 0.0 if inside(points, middle)[0] else float(distance(points, middle)[0])
        radius = min(radius, apart - room)
        if radius <= 0.0:
            continue
        low = np.floor((np.array([x, y]) - radius - grid.origin) / cell).astype(int)
        high = np.floor((np.array([x, y]) + radius - grid.origin) / cell).astype(int) + 1
        low, high = np.maximum(low, 0), np.minimum(high, occupied.shape[::-1])
        if (low >= high).any():
            continue
        columns = grid.origin[0] + (np.arange(low[0], high[0]) + 0.5) * cell
        rows = grid.origin[1] + (np.arange(low[1], high[1]) + 0.5) * cell
        dx = np.maximum(np.abs(columns - x) - cell / 2.0, 0.0)
        dy = np.maximum(np.abs(rows - y) - cell / 2.0, 0.0)
        occupied[low[1] : high[1], low[0] : high[0]] |= np.hypot(dx, dy[:, None]) <= radius
    return replace(grid, occupied=occupied)
