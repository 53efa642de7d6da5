"""Bounded Voronoi cells and their centroids under a density, for Lloyd's control (4.1). Compiled.

Cells are half-plane clippings of a convex region, neighbours from a grid, near ones first, until no
further one can cut. The integrals of a Gaussian over a cell are exact across slices of it (error
functions) and Gauss-Legendre sums along them, relative to the greatest value in the cell: a cell
far out in the tail, whose mass is less than the least number, has as good a centroid as any.
"""

import math
from typing import Any

import numba
import numpy as np

from push_model.arrays import Array
from swarm_push.density import Density

_MOST = 64  # vertices of a cell while it is cut
_FAR = 7.0  # standard deviations beyond which a Gaussian is nothing, beside its greatest value
_LEFT = 30.0  # of the exponent likewise
_PIECE = 2.5  # standard deviations, or of the exponent, that one sum spans
_SAME = 1e-6  # [m] within which robots stand at one place
_TURN = 2.399963229728653  # [rad] golden angle, by which those are told apart
_NODES6, _WEIGHTS6 = np.polynomial.legendre.leggauss(6)
_NODES3, _WEIGHTS3 = np.polynomial.legendre.leggauss(3)
_ROOT2, _ROOT_PI_2 = math.sqrt(2.0), math.sqrt(0.5 * math.pi)


class Coverage:
    """Coverage of a convex region by robots that count as points."""

    def __init__(self, region: Array) -> None:
        """region: ``(m, 2)`` [m] corners of a convex polygon, counter-clockwise.

        Raises
        ------
        ValueError: it is not convex and counter-clockwise, or has too many corners.
        """
        region = np.ascontiguousarray(region, dtype=np.float64)
        edge = np.roll(region, -1, axis=0) - region
        after = np.roll(edge, -1, axis=0)
        turns = edge[:, 0] * after[:, 1] - edge[:, 1] * after[:, 0]
        if len(region) < 3 or not (turns > 0.0).all():
            raise ValueError("the region must be a convex polygon, its corners counter-clockwise")
        if len(region) > _MOST // 2:
            raise ValueError(
                f"at most {_MOST // 2} corners are taken, the region has {len(region)}"
            )
        self.region = region

    def inside(self, points: Array) -> Array:
        """``(n, 2)`` [m] the points, those outside moved to the nearest one of the region."""
        found: Array = _into(np.ascontiguousarray(points, dtype=np.float64), self.region)
        return found

    def centroids(self, points: Array, density: Density) -> Array:
        """``(n, 2)`` [m] centroids under a density of the cells of robots at ``(n, 2)`` [m].

        Robots outside count where they would come in; those at one place share its cell.
        """
        if len(points) == 0:
            return np.zeros((0, 2))
        seeds = _told_apart(self.inside(points))
        logs = np.log(density.weights)
        found: Array = _centroids(seeds, self.region, logs, density.means, density.roots)
        return found

    def cells(self, points: Array) -> list[Array]:
        """The cells, ``(k, 2)`` [m] each, counter-clockwise."""
        seeds = _told_apart(self.inside(points))
        table, counts = _cells(seeds, self.region)
        return [cell[:k] for cell, k in zip(table, counts, strict=True)]


@numba.njit(cache=True, error_model="numpy")
def _into(points: Any, region: Any) -> Any:
    found = points.copy()
    m = region.shape[0]
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        inside, best = True, math.inf
        for k in range(m):
            ax, ay = region[k, 0], region[k, 1]
            ex, ey = region[(k + 1) % m, 0] - ax, region[(k + 1) % m, 1] - ay
            inside &= ex * (y - ay) - ey * (x - ax) >= 0.0
            part = min(max(((x - ax) * ex + (y - ay) * ey) / (ex * ex + ey * ey), 0.0), 1.0)
            px, py = ax + part * ex, ay + part * ey
            away = (x - px) ** 2 + (y - py) ** 2
            if away < best:
                best = away
                found[i, 0], found[i, 1] = px, py
        if inside:
            found[i, 0], found[i, 1] = x, y
    return found


@numba.njit(cache=True, error_model="numpy")
def _grid(points: Any) -> Any:
    """Buckets of points: corner, side [m], numbers of buckets, starts and the points by bucket."""
    n = points.shape[0]
    x0, y0 = points[:, 0].min(), points[:, 1].min()
    width, height = points[:, 0].max() - x0, points[:, 1].max() - y0
    side = max(math.sqrt(max(width * height, 1e-12) * 2.0 / n), max(width, height) * 2.0 / n, 1e-9)
    nx, ny = int(width / side) + 1, int(height / side) + 1
    starts = np.zeros(nx * ny + 1, np.int64)
    which = np.empty(n, np.int64)
    for i in range(n):
        a = min(int((points[i, 0] - x0) / side), nx - 1)
        b = min(int((points[i, 1] - y0) / side), ny - 1)
        which[i] = a * ny + b
        starts[which[i] + 1] += 1
    for k in range(nx * ny):
        starts[k + 1] += starts[k]
    filled = starts[:-1].copy()
    order = np.empty(n, np.int64)
    for i in range(n):
        order[filled[which[i]]] = i
        filled[which[i]] += 1
    return x0, y0, side, nx, ny, starts, order


@numba.njit(cache=True, error_model="numpy")
def _told_apart(points: Any) -> Any:
    """The points, with equal ones moved apart by a micrometre in different directions."""
    n = points.shape[0]
    found = points.copy()
    x0, y0, side, nx, ny, starts, order = _grid(points)
    for i in range(n):
        a = min(int((points[i, 0] - x0) / side), nx - 1)
        b = min(int((points[i, 1] - y0) / side), ny - 1)
        twin = False
        for aa in range(max(a - 1, 0), min(a + 2, nx)):
            for bb in range(max(b - 1, 0), min(b + 2, ny)):
                for k in range(starts[aa * ny + bb], starts[aa * ny + bb + 1]):
                    j = order[k]
                    if j != i:
                        dx, dy = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
                        twin |= dx * dx + dy * dy < _SAME * _SAME
        if twin:
            found[i, 0] += _SAME * (1.0 + i / n) * math.cos(_TURN * i)
            found[i, 1] += _SAME * (1.0 + i / n) * math.sin(_TURN * i)
    return found


@numba.njit(cache=True, error_model="numpy")
def _cut(px: Any, py: Any, k: int, nx: float, ny: float, c: float, qx: Any, qy: Any) -> int:
    """Clip a polygon to n q <= c, in place; its number of vertices."""
    count, cut = 0, False
    for t in range(k):
        if nx * px[t] + ny * py[t] > c:
            cut = True
            break
    if not cut:
        return k
    for t in range(k):
        u = t + 1 if t + 1 < k else 0
        s0, s1 = nx * px[t] + ny * py[t] - c, nx * px[u] + ny * py[u] - c
        if s0 <= 0.0:
            qx[count], qy[count] = px[t], py[t]
            count += 1
        if (s0 < 0.0 < s1) or (s1 < 0.0 < s0):
            r = s0 / (s0 - s1)
            qx[count], qy[count] = px[t] + r * (px[u] - px[t]), py[t] + r * (py[u] - py[t])
            count += 1
    for t in range(count):
        px[t], py[t] = qx[t], qy[t]
    return count


@numba.njit(cache=True, error_model="numpy")
def _cell(i: int, points: Any, region: Any, grid: Any, px: Any, py: Any, qx: Any, qy: Any) -> int:
    """Fill px, py with the cell of a point; its number of vertices."""
    x0, y0, side, nx, ny, starts, order = grid
    x, y = points[i, 0], points[i, 1]
    k = region.shape[0]
    for t in range(k):
        px[t], py[t] = region[t, 0], region[t, 1]
    a, b = min(int((x - x0) / side), nx - 1), min(int((y - y0) / side), ny - 1)
    for ring in range(max(nx, ny)):
        far = 0.0
        for t in range(k):
            far = max(far, (px[t] - x) ** 2 + (py[t] - y) ** 2)
        near = (ring - 1) * side  # of whoever is in this ring, at least
        if near > 0.0 and near * near > 4.0 * far:
            break
        for aa in range(max(a - ring, 0), min(a + ring, nx - 1) + 1):
            step = 1 if aa == a - ring or aa == a + ring else max(2 * ring, 1)
            for bb in range(b - ring, b + ring + 1, step):
                if bb < 0 or bb >= ny:
                    continue
                for s in range(starts[aa * ny + bb], starts[aa * ny + bb + 1]):
                    j = order[s]
                    if j == i or k < 3 or k > _MOST - 4:
                        continue
                    ex, ey = points[j, 0] - x, points[j, 1] - y
                    c = 0.5 * (ex * (points[j, 0] + x) + ey * (points[j, 1] + y))
                    k = _cut(px, py, k, ex, ey, c, qx, qy)
    return int(k)


@numba.njit(cache=True, error_model="numpy")
def _cells(points: Any, region: Any) -> Any:
    n = points.shape[0]
    table, counts = np.zeros((n, _MOST, 2)), np.zeros(n, np.int64)
    px, py, qx, qy = np.empty(_MOST), np.empty(_MOST), np.empty(_MOST), np.empty(_MOST)
    grid = _grid(points)
    for i in range(n):
        counts[i] = _cell(i, points, region, grid, px, py, qx, qy)
        for t in range(counts[i]):
            table[i, t, 0], table[i, t, 1] = px[t], py[t]
    return table, counts


@numba.njit(cache=True, error_model="numpy")
def _nearest(px: Any, py: Any, k: int) -> Any:
    """The point of a convex polygon, counter-clockwise, that is nearest to the origin."""
    inside, best = True, math.inf
    bx = by = 0.0
    for t in range(k):
        u = t + 1 if t + 1 < k else 0
        ex, ey = px[u] - px[t], py[u] - py[t]
        length = ex * ex + ey * ey
        inside &= px[t] * ey - py[t] * ex >= 0.0
        part = 0.0 if length == 0.0 else min(max(-(px[t] * ex + py[t] * ey) / length, 0.0), 1.0)
        x, y = px[t] + part * ex, py[t] + part * ey
        if x * x + y * y < best:
            best, bx, by = x * x + y * y, x, y
    if inside:
        return 0.0, 0.0
    return bx, by


@numba.njit(cache=True, error_model="numpy")
def _moments(px: Any, py: Any, k: int, r: float, qx: Any, qy: Any) -> Any:
    """Mass and first moments of exp(-(r x + (x^2 + y^2) / 2)) over a convex polygon, which is used
    up. Where r > 0, the polygon lies in x >= 0 and touches the origin."""
    high = math.sqrt(r * r + 2.0 * _LEFT) - r
    k = _cut(px, py, k, 1.0, 0.0, high, qx, qy)
    k = _cut(px, py, k, -1.0, 0.0, high if r == 0.0 else 1e-9, qx, qy)
    k = _cut(px, py, k, 0.0, 1.0, _FAR, qx, qy)
    k = _cut(px, py, k, 0.0, -1.0, _FAR, qx, qy)
    m0 = m1 = m2 = 0.0
    if k < 3:
        return m0, m1, m2
    breaks = np.sort(px[:k])
    for b in range(k - 1):
        x0, x1 = breaks[b], breaks[b + 1]
        if x1 - x0 < 1e-12:
            continue
        middle = 0.5 * (x0 + x1)
        ya = sa = yb = sb = 0.0  # at x0 and slopes: below and above
        found = 0
        for t in range(k):
            u = t + 1 if t + 1 < k else 0
            ax, bx = px[t], px[u]
            if (ax <= middle) != (bx <= middle):
                slope = (py[u] - py[t]) / (bx - ax)
                y = py[t] + slope * (x0 - ax)
                if bx > ax:  # counter-clockwise: to the right is below
                    ya, sa = y, slope
                else:
                    yb, sb = y, slope
                found += 1
        if found < 2:
            continue
        span = x1 - x0
        size = max((r + max(abs(x0), abs(x1))) * span, abs(sa) * span, abs(sb) * span)
        size = max(size, span)
        pieces = int(size / _PIECE) + 1
        few = size < 0.6
        nodes, weights = (_NODES3, _WEIGHTS3) if few else (_NODES6, _WEIGHTS6)
        half = 0.5 * span / pieces
        for p in range(pieces):
            centre = x0 + (2 * p + 1) * half
            for g in range(nodes.shape[0]):
                x = centre + half * nodes[g]
                low, top = ya + sa * (x - x0), yb + sb * (x - x0)
                f = weights[g] * half * math.exp(-(r * x + 0.5 * x * x))
                across = f * _ROOT_PI_2 * (math.erf(top / _ROOT2) - math.erf(low / _ROOT2))
                m0 += across
                m1 += x * across
                m2 += f * (math.exp(-0.5 * low * low) - math.exp(-0.5 * top * top))
    return m0, m1, m2


@numba.njit(cache=True, error_model="numpy")
def _centroids(points: Any, region: Any, logs: Any, means: Any, roots: Any) -> Any:
    n, parts = points.shape[0], means.shape[0]
    found = np.empty((n, 2))
    px, py, qx, qy = np.empty(_MOST), np.empty(_MOST), np.empty(_MOST), np.empty(_MOST)
    sx, sy = np.empty(_MOST), np.empty(_MOST)
    near, level = np.empty((parts, 2)), np.empty(parts)
    grid = _grid(points)
    for i in range(n):
        k = _cell(i, points, region, grid, px, py, qx, qy)
        found[i, 0], found[i, 1] = points[i, 0], points[i, 1]
        if k < 3:
            continue
        top = -math.inf
        for c in range(parts):
            R = roots[c]
            for t in range(k):
                dx, dy = px[t] - means[c, 0], py[t] - means[c, 1]
                sx[t], sy[t] = R[0, 0] * dx + R[0, 1] * dy, R[1, 0] * dx + R[1, 1] * dy
            near[c, 0], near[c, 1] = _nearest(sx, sy, k)
            level[c] = logs[c] - 0.5 * (near[c, 0] ** 2 + near[c, 1] ** 2)
            top = max(top, level[c])
        mass = mx = my = 0.0
        for c in range(parts):
            if level[c] < top - _LEFT:
                continue
            R = roots[c]
            r = math.hypot(near[c, 0], near[c, 1])
            ux, uy = (near[c, 0] / r, near[c, 1] / r) if r > 1e-9 else (1.0, 0.0)
            r = r if r > 1e-9 else 0.0
            for t in range(k):
                dx, dy = px[t] - means[c, 0], py[t] - means[c, 1]
                ax, ay = R[0, 0] * dx + R[0, 1] * dy, R[1, 0] * dx + R[1, 1] * dy
                sx[t], sy[t] = ux * ax + uy * ay - r, -uy * ax + ux * ay
            m0, m1, m2 = _moments(sx, sy, k, r, qx, qy)
            det = R[0, 0] * R[1, 1] - R[0, 1] * R[1, 0]
            w = math.exp(level[c] - top) / det
            ax, ay = (m1 + r * m0) * ux - m2 * uy, (m1 + r * m0) * uy + m2 * ux
            mass += w * m0
            mx += w * (means[c, 0] * m0 + (R[1, 1] * ax - R[0, 1] * ay) / det)
            my += w * (means[c, 1] * m0 + (-R[1, 0] * ax + R[0, 0] * ay) / det)
        if mass > 0.0:
            found[i, 0], found[i, 1] = mx / mass, my / mass
    return found
