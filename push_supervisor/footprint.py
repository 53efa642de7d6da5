"""Exact questions about outlines: does a body fit on a map, how far are two bodies apart.

Outlines ``(n, 2)`` [m] are closed polygons in a body's frame, convex or not; poses ``(3,)``
[m, m, rad] in the world frame.
"""

import numpy as np
from numpy.typing import NDArray

from push_model import se2
from push_model.arrays import Array
from push_model.occupancy import OccupancyGrid

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
    rows, columns = grid.occupied.shape
    first = np.maximum(np.floor((low - grid.origin) / cell - _BLUR).astype(int), 0)
    last = np.floor((high - grid.origin) / cell + _BLUR).astype(int) + 1
    last = np.minimum(last, [columns, rows])
    inner = np.argwhere(grid.occupied[first[1] : last[1], first[0] : last[0]])
    centres = grid.origin + (inner[:, ::-1] + first + 0.5) * cell
    if not len(centres):
        return False
    if _inside(points, centres).any():
        return True
    # An edge meets a square unless one of three directions parts them: x, y and its own normal.
    half = (0.5 + _BLUR) * cell
    edge = np.roll(points, -1, axis=0) - points
    away = centres[:, None] - (points + 0.5 * edge)[None]
    reach = half + 0.5 * np.abs(edge)
    across = np.abs(edge[:, 0] * away[..., 1] - edge[:, 1] * away[..., 0])
    meets = (np.abs(away) <= reach).all(axis=2) & (across <= half * np.abs(edge).sum(axis=1))
    return bool(meets.any())


def gap(first: Array, first_pose: Array, second: Array, second_pose: Array) -> float:
    """[m] between two bodies; 0 when they touch or overlap."""
    a, b = se2.transform(first_pose, first), se2.transform(second_pose, second)
    if _inside(a, b).any() or _inside(b, a).any() or _edges_cross(a, b):
        return 0.0
    return min(_to_edges(a, b), _to_edges(b, a))


def _inside(points: Array, places: Array) -> NDArray[np.bool_]:
    """Which places ``(k, 2)`` lie in a polygon: an odd number of edges lies to their right."""
    ends = np.roll(points, -1, axis=0)
    x, y = places[:, :1], places[:, 1:]
    spans = (points[:, 1] > y) != (ends[:, 1] > y)
    rise = np.where(ends[:, 1] == points[:, 1], 1.0, ends[:, 1] - points[:, 1])
    crossing = points[:, 0] + (y - points[:, 1]) * (ends[:, 0] - points[:, 0]) / rise
    odd: NDArray[np.bool_] = (spans & (x < crossing)).sum(axis=1) % 2 == 1
    return odd


def _edges_cross(a: Array, b: Array) -> bool:
    """Whether an edge of one polygon crosses one of the other."""
    a0, a1 = a[:, None], np.roll(a, -1, axis=0)[:, None]
    b0, b1 = b[None], np.roll(b, -1, axis=0)[None]

    def turn(p: Array, q: Array, r: Array) -> Array:
        left: Array = (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1])
        right: Array = (q[..., 1] - p[..., 1]) * (r[..., 0] - p[..., 0])
        return left - right

    of_b = turn(a0, a1, b0) * turn(a0, a1, b1) <= 0.0
    of_a = turn(b0, b1, a0) * turn(b0, b1, a1) <= 0.0
    near = (np.maximum(a0, a1) >= np.minimum(b0, b1)) & (np.maximum(b0, b1) >= np.minimum(a0, a1))
    return bool((of_a & of_b & near.all(axis=2)).any())


def _to_edges(points: Array, polygon: Array) -> float:
    """[m] least distance of points ``(k, 2)`` to the edges of a polygon."""
    edge = np.roll(polygon, -1, axis=0) - polygon
    away = points[:, None] - polygon[None]
    along = np.clip((away * edge).sum(axis=2) / (edge * edge).sum(axis=1), 0.0, 1.0)
    rest = away - along[..., None] * edge
    return float(np.hypot(rest[..., 0], rest[..., 1]).min())
