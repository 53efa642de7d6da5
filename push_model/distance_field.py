"""Distance to the nearest obstacle, everywhere on an occupancy grid, never more than it is.

Obstacles are the closed squares of the occupied cells, and all that lies outside the grid. On a
lattice of half cells, corners and centres of cells included, the distance to them is exact: the
point of such a square that is nearest to a point of the lattice lies on the lattice too, so squared
distances are whole numbers of lattice spacings, which float32 holds exactly.

Between points of the lattice the bound is the following. The squared distance to a set is the least
of |p - q|^2 over its points q, so d^2(p) - |p|^2 is the least of functions that are linear in p: it
is concave, and interpolating it linearly or bilinearly never gives more than it is. With a and b
the place between four points of the lattice, in spacings,

    d^2 >= bilinear(d^2) - a (1 - a) - b (1 - b),

and on a straight piece of length g between points with squared distances A and B,

    d^2 >= (1 - t) A + t B - t (1 - t) g^2.

Both are exact for a single point; beside a wall they lose less than g^2 / 8 d. Closer than a cell
to an obstacle the squares around are asked instead, which is exact.
"""

import math
from collections.abc import Sequence
from typing import Any

import numba
import numpy as np

from push_model.arrays import Array
from push_model.occupancy import OccupancyGrid

_FINENESS = 0.05  # [lattice spacings] that a piece of an outline may lose before it is halved


@numba.njit(cache=True, fastmath=True)
def _squared_distances(occupied: Any) -> Any:
    """Exact squared distance, in lattice spacings, on ``(2 rows + 1, 2 columns + 1)`` points."""
    rows, columns = 2 * occupied.shape[0] + 1, 2 * occupied.shape[1] + 1
    values = np.empty((rows, columns), dtype=np.float32)
    for i in range(rows):
        above, below = max(0, (i - 1) // 2), min(occupied.shape[0] - 1, i // 2)
        for j in range(columns):
            left, right = max(0, (j - 1) // 2), min(occupied.shape[1] - 1, j // 2)
            edge = i == 0 or j == 0 or i == rows - 1 or j == columns - 1
            touched = occupied[above, left] or occupied[above, right]
            if edge or touched or occupied[below, left] or occupied[below, right]:
                values[i, j] = 0.0
            else:
                values[i, j] = values[i - 1, j] + np.float32(1.0)
    for i in range(rows - 2, -1, -1):
        for j in range(columns):
            values[i, j] = min(values[i, j], values[i + 1, j] + np.float32(1.0))
    # Along each row, the lower envelope of the parabolas (j - k)^2 + g_k^2.
    squares = np.empty(columns, dtype=np.int64)
    apex = np.empty(columns, dtype=np.int64)
    begin = np.empty(columns, dtype=np.int64)
    for i in range(rows):
        for j in range(columns):
            squares[j] = np.int64(values[i, j]) ** 2
        last = 0
        apex[0], begin[0] = 0, 0
        for j in range(1, columns):
            while last >= 0:
                k, at = apex[last], begin[last]
                if (at - k) ** 2 + squares[k] <= (at - j) ** 2 + squares[j]:
                    break
                last -= 1
            if last < 0:
                last = 0
                apex[0], begin[0] = j, 0
            else:
                k = apex[last]
                above = j * j - k * k + squares[j] - squares[k]
                first = 1 + above // (2 * (j - k))
                if first < columns:
                    last += 1
                    apex[last], begin[last] = j, first
        for j in range(columns - 1, -1, -1):
            values[i, j] = (j - apex[last]) ** 2 + squares[apex[last]]
            if j == begin[last]:
                last -= 1
    return values


@numba.njit(cache=True, fastmath=True, inline="always")
def _bilinear_square(field: Any, u: float, v: float) -> float:
    j, i = int(u), int(v)
    a, b = u - j, v - i
    low = (1.0 - a) * field[i, j] + a * field[i, j + 1]
    high = (1.0 - a) * field[i + 1, j] + a * field[i + 1, j + 1]
    square: float = (1.0 - b) * low + b * high - a * (1.0 - a) - b * (1.0 - b)
    return square


@numba.njit(cache=True, fastmath=True)
def square_at(field: Any, u: float, v: float) -> float:
    """Lower bound of the squared distance at a point; all in lattice spacings."""
    rows, columns = field.shape
    if not (0.0 <= u < columns - 1 and 0.0 <= v < rows - 1):
        return 0.0
    square: float = _bilinear_square(field, u, v)
    if square < 4.0:
        square = max(square, _near_square(field, u, v, int(v), int(u)))
    return square


@numba.njit(cache=True, fastmath=True)
def _near_square(field: Any, u: float, v: float, i: int, j: int) -> float:
    """Squared distance to the squares of a cell and its neighbours; all others are 2 away."""
    rows, columns = field.shape
    nearest = 4.0
    ci, cj = i | 1, j | 1  # the centre of the cell
    for k in range(max(1, ci - 2), min(rows - 1, ci + 3), 2):
        for m in range(max(1, cj - 2), min(columns - 1, cj + 3), 2):
            if field[k, m] == 0.0:
                du = max(abs(u - m) - 1.0, 0.0)
                dv = max(abs(v - k) - 1.0, 0.0)
                nearest = min(nearest, du * du + dv * dv)
    outside = max(0.0, min(min(u, columns - 1 - u), min(v, rows - 1 - v)))
    return float(min(nearest, outside * outside))


@numba.njit(cache=True, fastmath=True, inline="always")
def piece_square(a: float, b: float, gap: float) -> float:
    """Lower bound of the squared distance on a straight piece, from its ends'; gap squared."""
    if abs(a - b) >= gap:
        return min(a, b)
    return 0.5 * (a + b) - 0.25 * gap - 0.25 * (a - b) ** 2 / gap


@numba.njit(cache=True, fastmath=True)
def lookup(field: Any, x: float, y: float, ox: float, oy: float, scale: float) -> float:
    """Lower bound of the distance [m] at a point; 0 outside the grid."""
    return math.sqrt(max(0.0, square_at(field, (x - ox) * scale, (y - oy) * scale))) / scale


@numba.njit(cache=True, fastmath=True)
def lookups(field: Any, points: Any, ox: float, oy: float, scale: float) -> Any:
    """``(n,)`` lower bounds of the distance [m] at points ``(n, 2)``; 0 outside the grid."""
    found = np.empty(points.shape[0])
    for k in range(points.shape[0]):
        found[k] = lookup(field, points[k, 0], points[k, 1], ox, oy, scale)
    return found


@numba.njit(cache=True, fastmath=True)
def between_samples(least: float, gap: float) -> float:
    """Lower bound of the distance [m] on a straight piece whose ends have at least ``least``."""
    return math.sqrt(max(0.0, least * least - 0.25 * gap * gap))


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
    """Lower bound of the distance [m] of a body's closed outline ``(n, 2)`` at a pose.

    What lies between the points counts; what lies inside the outline without touching it does not.
    """
    c, s = scale * math.cos(theta), scale * math.sin(theta)
    x0, y0 = (x - ox) * scale, (y - oy) * scale
    rows, columns = field.shape
    n = points.shape[0]
    least, widest = 1e18, 0.0
    before_u = x0 + c * points[n - 1, 0] - s * points[n - 1, 1]
    before_v = y0 + s * points[n - 1, 0] + c * points[n - 1, 1]
    for k in range(n):
        u = x0 + c * points[k, 0] - s * points[k, 1]
        v = y0 + s * points[k, 0] + c * points[k, 1]
        if not (0.0 <= u < columns - 1 and 0.0 <= v < rows - 1):
            return 0.0
        least = min(least, _bilinear_square(field, u, v))
        widest = max(widest, (u - before_u) ** 2 + (v - before_v) ** 2)
        before_u, before_v = u, v
    if 8.0 * _FINENESS * math.sqrt(max(0.0, least)) < widest:
        least = _outline_square(field, points, x0, y0, c, s)
    else:  # far off it matters little where between two points the nearest one is
        least -= 0.25 * widest
    return math.sqrt(max(0.0, least)) / scale


@numba.njit(cache=True, fastmath=True)
def _outline_square(field: Any, points: Any, x0: float, y0: float, c: float, s: float) -> float:
    """Squared distance of a closed outline, side by side, each as fine as it needs to be."""
    n = points.shape[0]
    u = x0 + c * points[n - 1, 0] - s * points[n - 1, 1]
    v = y0 + s * points[n - 1, 0] + c * points[n - 1, 1]
    square = square_at(field, u, v)
    least = square
    for k in range(n):
        pu = x0 + c * points[k, 0] - s * points[k, 1]
        pv = y0 + s * points[k, 0] + c * points[k, 1]
        following = square_at(field, pu, pv)
        gap = (pu - u) ** 2 + (pv - v) ** 2
        lower = min(square, following)
        if lower - 0.25 * gap < least:
            low = piece_square(square, following, gap)
            # Beside a wall the piece loses gap / 8 d: parts of it lose less.
            coarse = gap * gap / (64.0 * _FINENESS**2 * max(0.25, lower))
            if coarse > 1.0 and low < least:
                parts = int(math.ceil(coarse**0.25))
                gap /= parts * parts
                low = 1e18
                before = square
                for m in range(1, parts + 1):
                    t = m / parts
                    here = following
                    if m < parts:
                        here = square_at(field, u + (pu - u) * t, v + (pv - v) * t)
                    low = min(low, piece_square(before, here, gap))
                    before = here
            least = min(least, low)
            if least <= 0.0:
                return 0.0
        u, v, square = pu, pv, following
    return float(least)


@numba.njit(cache=True, fastmath=True)
def holds_obstacle(field: Any, points: Any, pose: Any, ox: float, oy: float, scale: float) -> bool:
    """Whether an occupied corner of a cell lies inside a closed outline at a pose."""
    n = points.shape[0]
    c, s = math.cos(pose[2]), math.sin(pose[2])
    u, v = np.empty(n), np.empty(n)
    for k in range(n):
        u[k] = (pose[0] + c * points[k, 0] - s * points[k, 1] - ox) * scale
        v[k] = (pose[1] + s * points[k, 0] + c * points[k, 1] - oy) * scale
    middle_u, middle_v = 0.5 * (u.min() + u.max()), 0.5 * (v.min() + v.max())
    reach = 0.25 * ((u.max() - u.min()) ** 2 + (v.max() - v.min()) ** 2)
    if square_at(field, middle_u, middle_v) > reach:
        return False
    for i in range(max(0, math.ceil(v.min())), min(field.shape[0] - 1, math.floor(v.max())) + 1):
        for j in range(
            max(0, math.ceil(u.min())), min(field.shape[1] - 1, math.floor(u.max())) + 1
        ):
            if field[i, j] > 0.0:
                continue
            inside = False
            for k in range(n):
                m = k - 1
                if (v[k] > i) == (v[m] > i):
                    continue
                if j < u[k] + (i - v[k]) * (u[m] - u[k]) / (v[m] - v[k]):
                    inside = not inside
            if inside:
                return True
    return False


@numba.njit(cache=True, fastmath=True)
def _clearances(field: Any, poses: Any, points: Any, ox: float, oy: float, scale: float) -> Any:
    """Least clearance of a closed outline at each of the poses (n, 3); 0 on overlap."""
    result = np.zeros(poses.shape[0])
    for i in range(poses.shape[0]):
        x, y, theta = poses[i, 0], poses[i, 1], poses[i, 2]
        clearance = points_clearance(field, points, x, y, theta, ox, oy, scale)
        if clearance > 0.0 and not holds_obstacle(field, points, poses[i], ox, oy, scale):
            result[i] = clearance
    return result


@numba.njit(cache=True, fastmath=True)
def _segment_clearance(
    field: Any, u0: float, v0: float, u1: float, v1: float, enough: float
) -> float:
    """Lower bound along a segment, in lattice spacings; stops once it is below ``enough``."""
    length = math.hypot(u1 - u0, v1 - v0)
    square = square_at(field, u0, v0)
    least = min(square, square_at(field, u1, v1))
    way = 0.0
    while way < length and least >= enough * enough:
        # No distance falls faster than the way grows: what has more to spare is left out.
        spare = math.sqrt(square) - math.sqrt(least)
        step = min(max(0.5, spare), length - way)
        way += step
        t = way / length
        following = square_at(field, u0 + (u1 - u0) * t, v0 + (v1 - v0) * t)
        if step <= spare:
            least = min(least, following)
        else:
            least = min(least, max(0.0, piece_square(square, following, step * step)))
        square = following
    return math.sqrt(least)


class DistanceField:
    """Lower bound [m] of the Euclidean distance from a point to what is occupied or off the grid.

    values: ``(2 rows + 1, 2 columns + 1)`` float32, squared distances on the lattice of half cells,
    in lattice spacings; args: x and y [m] of its first point and lattice spacings a metre, as the
    compiled functions want them.
    """

    def __init__(self, grid: OccupancyGrid) -> None:
        self.grid = grid
        self.spacing = 0.5 * grid.resolution
        self.values = _squared_distances(grid.occupied)
        self.args = (float(grid.origin[0]), float(grid.origin[1]), 1.0 / self.spacing)

    def lattice(self, points: Array) -> Array:
        """Points ``(..., 2)`` [m] in lattice spacings from the first point of the lattice."""
        result: Array = (np.asarray(points, dtype=np.float64) - self.args[:2]) * self.args[2]
        return result

    def at(self, x: float, y: float) -> float:
        """[m] at a point; 0 outside the grid."""
        return float(lookup(self.values, x, y, *self.args))

    def clearance(self, outline: Array, pose: Array) -> float:
        """[m] of a body with a closed outline ``(n, 2)`` at a pose ``(3,)``; 0 on overlap."""
        pose = np.asarray(pose, dtype=np.float64)
        if holds_obstacle(self.values, outline, pose, *self.args):
            return 0.0
        return float(points_clearance(self.values, outline, pose[0], pose[1], pose[2], *self.args))

    def clearances(self, outline: Array, poses: Array) -> Array:
        """``(n,)`` [m] of a body with a closed outline at poses ``(n, 3)``; 0 on overlap."""
        result: Array = _clearances(self.values, poses, outline, *self.args)
        return result

    def segment(
        self, start: Sequence[float] | Array, end: Sequence[float] | Array, enough: float = -1.0
    ) -> float:
        """[m] least distance along a segment between points ``(2,)``.

        May stop early, with what it has found so far, once that is below ``enough``.
        """
        ox, oy, scale = self.args
        u0, v0, u1, v1 = (
            (float(start[0]) - ox) * scale,
            (float(start[1]) - oy) * scale,
            (float(end[0]) - ox) * scale,
            (float(end[1]) - oy) * scale,
        )
        least = _segment_clearance(self.values, u0, v0, u1, v1, max(0.0, enough) * scale)
        return float(least) * self.spacing
