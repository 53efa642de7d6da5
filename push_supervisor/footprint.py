"""Exact questions about footprints: does a body fit on a map, how far are two bodies apart.

Outlines ``(n, 2)`` [m] are closed polygons in a body's frame, convex or not; poses ``(3,)``
[m, m, rad] in the world frame.
"""

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.occupancy import OccupancyGrid
from push_model.outlines import cells_hit, distance, overlap

_BLUR = 0.05  # [cells] closer than that to an occupied cell counts as touching


def overlaps(grid: OccupancyGrid, outline: Array, pose: Array) -> bool:
    """Whether a body touches or covers an occupied cell, or reaches beyond the map.

    The planner measures clearances with bounds that lose up to ``_BLUR`` of a cell: what passes
    here must pass there, so that much counts as touching.
    """
    points = se2.transform(pose, outline)
    low, high = points.min(axis=0), points.max(axis=0)
    x0, x1, y0, y1 = grid.extent
    if low[0] <= x0 or low[1] <= y0 or high[0] >= x1 or high[1] >= y1:
        return True
    cell = grid.resolution
    first = np.maximum(np.floor((low - grid.origin) / cell - _BLUR).astype(int), 0)
    last = np.floor((high - grid.origin) / cell + _BLUR).astype(int) + 1
    rows, columns = np.nonzero(grid.occupied[first[1] : last[1], first[0] : last[0]])
    corners = grid.origin + (np.column_stack([columns, rows]) + first - _BLUR) * cell
    return bool(cells_hit(points, corners, (1.0 + 2.0 * _BLUR) * cell).any())


def gap(first: Array, first_pose: Array, second: Array, second_pose: Array) -> float:
    """[m] between two bodies; 0 when they overlap."""
    a, b = se2.transform(first_pose, first), se2.transform(second_pose, second)
    if overlap(a, b):
        return 0.0
    return float(min(distance(a, b).min(), distance(b, a).min()))
