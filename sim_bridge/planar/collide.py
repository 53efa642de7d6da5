"""Contacts between convex parts: discs and polygons. Compiled.

A contact is a row of ``ints (m, 5)``: body a, body b (-1: fixed), part a, part b, feature; and of
``reals (m, 6)``: normal from b to a, point, gap [m] (negative: overlap), friction. All contacts
nearer than ``margin`` are found, so that a step can stop bodies that would meet within it.

Everything that the kernels work on is in named tuples of arrays, which numba knows.
"""

import math
from typing import Any, NamedTuple

import numba

_FAR = 1e18


class Parts(NamedTuple):
    """Convex parts: ``moving`` ones first, then the fixed ones, whose body is -1.

    body, first, count, radius, friction ``(p,)``; local ``(p, 2)``; vertices ``(v, 2)``: see
    PartTable. middles ``(p, 2)``, corners ``(v, 2)`` [m]: circles and vertices in the world.
    large, small: numbers of the moving parts by size.
    """

    moving: int
    body: Any
    first: Any
    count: Any
    local: Any
    radius: Any
    friction: Any
    vertices: Any
    middles: Any
    corners: Any
    large: Any
    small: Any


class Neighbours(NamedTuple):
    """How parts that may touch are found.

    heads, following, cells ``(p, 2)``: a hashed grid of cells of ``spacing`` [m], the greatest
    diameter of the small parts; low, size, start, items, box, cell: the fixed parts' Buckets;
    stamp: which part asked.
    """

    heads: Any
    following: Any
    cells: Any
    spacing: float
    low: Any
    size: Any
    start: Any
    items: Any
    box: Any
    cell: float
    stamp: Any


@numba.njit(cache=True, error_model="numpy")
def _add(
    ints: Any, reals: Any, n: int, body: Any, friction: Any, pa: int, pb: int, feature: int,
    nx: float, ny: float, px: float, py: float, gap: float,
) -> int:  # fmt: skip
    if n >= ints.shape[0]:
        return n
    ints[n, 0], ints[n, 1], ints[n, 2], ints[n, 3], ints[n, 4] = body[pa], body[pb], pa, pb, feature
    reals[n, 0], reals[n, 1], reals[n, 2], reals[n, 3] = nx, ny, px, py
    among = friction[pa, 1] > 0.0 and friction[pb, 1] > 0.0  # both are robots
    column = 1 if among else 0
    reals[n, 4], reals[n, 5] = gap, friction[pa, column] * friction[pb, column]
    return n + 1


@numba.njit(cache=True, error_model="numpy")
def _discs(pa: int, pb: int, middles: Any, radius: Any, margin: float) -> Any:
    """Normal, point and gap of two discs; the gap is far where there is no contact."""
    dx, dy = middles[pa, 0] - middles[pb, 0], middles[pa, 1] - middles[pb, 1]
    far = radius[pa] + radius[pb] + margin
    square = dx * dx + dy * dy
    if square > far * far:
        return 1.0, 0.0, 0.0, 0.0, _FAR
    d = math.sqrt(square)
    nx, ny = (dx / d, dy / d) if d > 1e-9 else (1.0, 0.0)
    gap = d - radius[pa] - radius[pb]
    reach = radius[pb] + 0.5 * gap
    return nx, ny, middles[pb, 0] + reach * nx, middles[pb, 1] + reach * ny, gap


@numba.njit(cache=True, error_model="numpy")
def _disc_polygon(
    x: float, y: float, r: float, corners: Any, first: int, count: int, margin: float
) -> Any:
    """A disc on a convex polygon: the normal points from the polygon to the disc."""
    inside, best, deepest = True, _FAR, -_FAR
    bx, by, nx, ny, ix, iy = 0.0, 0.0, 1.0, 0.0, 1.0, 0.0
    ax, ay = corners[first + count - 1, 0], corners[first + count - 1, 1]
    for k in range(count):
        cx, cy = corners[first + k, 0], corners[first + k, 1]
        ex, ey = cx - ax, cy - ay
        px, py = x - ax, y - ay
        outward = ey * px - ex * py  # times the edge's length
        if outward > 0.0:
            inside = False
        if outward > 0.0 or inside:
            square = ex * ex + ey * ey
            t = (px * ex + py * ey) / square
            if inside:
                depth = outward / math.sqrt(square)
                if depth > deepest:
                    deepest, ix, iy = depth, ey, -ex
            if outward > 0.0:
                t = min(1.0, max(0.0, t))
                qx, qy = ax + t * ex, ay + t * ey
                d = (x - qx) ** 2 + (y - qy) ** 2
                if d < best:
                    best, bx, by = d, qx, qy
        ax, ay = cx, cy
    if inside:
        size = math.hypot(ix, iy)
        nx, ny = ix / size, iy / size
        return nx, ny, x - deepest * nx, y - deepest * ny, deepest - r
    d = math.sqrt(best)
    if d - r > margin:
        return 1.0, 0.0, 0.0, 0.0, _FAR
    if d > 1e-12:
        nx, ny = (x - bx) / d, (y - by) / d
    return nx, ny, bx, by, d - r


@numba.njit(cache=True, error_model="numpy")
def _apart(corners: Any, fa: int, na: int, fb: int, nb: int, margin: float) -> Any:
    """The edge of a from which b is farthest, and how far [m]."""
    best, edge = -_FAR, -1
    for k in range(na):
        j = fa + (k + 1) % na
        ax, ay = corners[fa + k, 0], corners[fa + k, 1]
        ex, ey = corners[j, 0] - ax, corners[j, 1] - ay
        size = math.sqrt(ex * ex + ey * ey)
        nx, ny = ey / size, -ex / size
        least = _FAR
        for i in range(nb):
            d = nx * (corners[fb + i, 0] - ax) + ny * (corners[fb + i, 1] - ay)
            least = min(least, d)
            if least < best:
                break
        if least > best:
            best, edge = least, k
            if best > margin:
                break
    return best, edge


@numba.njit(cache=True, error_model="numpy")
def _polygons(
    ints: Any, reals: Any, n: int, body: Any, friction: Any, first: Any, count: Any, corners: Any,
    pa: int, pb: int, margin: float,
) -> int:  # fmt: skip
    """Up to two contacts of two convex polygons: an edge of one, clipped by the other's."""
    gap_a, edge_a = _apart(corners, first[pa], count[pa], first[pb], count[pb], margin)
    if gap_a > margin:
        return n
    gap_b, edge_b = _apart(corners, first[pb], count[pb], first[pa], count[pa], margin)
    if gap_b > margin:
        return n
    flip = gap_b > gap_a + 1e-6
    ref, other, edge = (pb, pa, edge_b) if flip else (pa, pb, edge_a)
    f, m = first[ref], count[ref]
    ax, ay = corners[f + edge, 0], corners[f + edge, 1]
    j = f + (edge + 1) % m
    ex, ey = corners[j, 0] - ax, corners[j, 1] - ay
    length = math.sqrt(ex * ex + ey * ey)
    ex, ey = ex / length, ey / length
    nx, ny = ey, -ex  # out of the reference
    g, w = first[other], count[other]
    facing, least = 0, _FAR
    for k in range(w):
        i = g + (k + 1) % w
        dx, dy = corners[i, 0] - corners[g + k, 0], corners[i, 1] - corners[g + k, 1]
        d = (nx * dy - ny * dx) / math.sqrt(dx * dx + dy * dy)
        if d < least:
            facing, least = k, d
    k0, k1 = g + facing, g + (facing + 1) % w
    x0, y0, x1, y1 = corners[k0, 0], corners[k0, 1], corners[k1, 0], corners[k1, 1]
    s0, s1 = (x0 - ax) * ex + (y0 - ay) * ey, (x1 - ax) * ex + (y1 - ay) * ey
    points = 1 if abs(s1 - s0) < 1e-12 else 2
    low, high = 0.0, length
    t0 = t1 = 0.0
    if points == 2:
        # the incident edge runs against the reference edge: s0 > s1
        t0 = min(1.0, max(0.0, (high - s0) / (s1 - s0) if s0 > high else 0.0))
        t1 = max(0.0, min(1.0, (low - s0) / (s1 - s0) if s1 < low else 1.0))
        if t1 - t0 < 1e-9:  # beside each other: one corner
            points = 1
    sign = 1.0 if flip else -1.0  # normal from b to a; n points out of the reference
    for which in range(points):
        t = t0 if which == 0 else t1
        px, py = x0 + t * (x1 - x0), y0 + t * (y1 - y0)
        gap = nx * (px - ax) + ny * (py - ay)
        if gap <= margin:
            feature = 4 * (facing if which == 0 else (facing + 1) % w) + 2 * flip + which
            n = _add(
                ints, reals, n, body, friction, pa, pb, feature, sign * nx, sign * ny,
                px - 0.5 * gap * nx, py - 0.5 * gap * ny, gap,
            )  # fmt: skip
    return n


@numba.njit(cache=True, error_model="numpy", inline="always")
def _near(middles: Any, radius: Any, pa: int, pb: int, margin: float) -> bool:
    """Whether the circles of two parts come near: asked of many, so in line."""
    dx, dy = middles[pa, 0] - middles[pb, 0], middles[pa, 1] - middles[pb, 1]
    far = radius[pa] + radius[pb] + margin
    return bool(dx * dx + dy * dy <= far * far)


@numba.njit(cache=True, error_model="numpy")
def _pair(
    ints: Any, reals: Any, n: int, body: Any, friction: Any, first: Any, count: Any, radius: Any,
    middles: Any, corners: Any, pa: int, pb: int, margin: float,
) -> int:  # fmt: skip
    """Add the contacts of two parts; how many contacts there are then."""
    if count[pa] and count[pb]:
        return int(_polygons(ints, reals, n, body, friction, first, count, corners, pa, pb, margin))
    if not count[pa] and not count[pb]:
        nx, ny, px, py, gap = _discs(pa, pb, middles, radius, margin)
    elif count[pb]:
        nx, ny, px, py, gap = _disc_polygon(
            middles[pa, 0], middles[pa, 1], radius[pa], corners, first[pb], count[pb], margin
        )
    else:
        nx, ny, px, py, gap = _disc_polygon(
            middles[pb, 0], middles[pb, 1], radius[pb], corners, first[pa], count[pa], margin
        )
        nx, ny = -nx, -ny
    if gap > margin:
        return n
    return int(_add(ints, reals, n, body, friction, pa, pb, 0, nx, ny, px, py, gap))


@numba.njit(cache=True, error_model="numpy")
def place_parts(pose: Any, parts: Parts) -> None:
    """Put circles and vertices of the moving parts where their bodies' centres of mass are."""
    body, first, count, local = parts.body, parts.first, parts.count, parts.local
    vertices, middles, corners = parts.vertices, parts.middles, parts.corners
    for p in range(parts.moving):
        b = body[p]
        x, y = pose[b, 0], pose[b, 1]
        if count[p] == 0 and local[p, 0] == 0.0 and local[p, 1] == 0.0:
            middles[p, 0], middles[p, 1] = x, y
            continue
        c, s = math.cos(pose[b, 2]), math.sin(pose[b, 2])
        middles[p, 0] = x + c * local[p, 0] - s * local[p, 1]
        middles[p, 1] = y + s * local[p, 0] + c * local[p, 1]
        for k in range(first[p], first[p] + count[p]):
            u, v = vertices[k, 0], vertices[k, 1]
            corners[k, 0], corners[k, 1] = x + c * u - s * v, y + s * u + c * v


@numba.njit(cache=True, error_model="numpy")
def _cell(x: float, spacing: float) -> int:
    return int(math.floor(x / spacing))


@numba.njit(cache=True, error_model="numpy")
def find_contacts(
    ints: Any, reals: Any, parts: Parts, near: Neighbours, there: Any, margin: float
) -> int:
    """All contacts of bodies that are ``there (n,)``; their number."""
    body, friction, first, count = parts.body, parts.friction, parts.first, parts.count
    radius, middles, corners = parts.radius, parts.middles, parts.corners
    small, large, moving = parts.small, parts.large, parts.moving
    n = 0
    # Small parts among each other, through the hashed grid.
    heads, following, cells, spacing = near.heads, near.following, near.cells, near.spacing
    mask = heads.shape[0] - 1
    heads[:] = -1
    for m in range(small.shape[0]):
        p = small[m]
        if not there[body[p]]:
            continue
        u, v = _cell(middles[p, 0], spacing), _cell(middles[p, 1], spacing)
        cells[p, 0], cells[p, 1] = u, v
        for i in range(u - 1, u + 2):
            for j in range(v - 1, v + 2):
                q = heads[(i * 73856093 ^ j * 19349663) & mask]
                while q >= 0:
                    here = cells[q, 0] == i and cells[q, 1] == j and body[q] != body[p]
                    if here and _near(middles, radius, p, q, margin):
                        n = _pair(
                            ints, reals, n, body, friction, first, count, radius, middles, corners,
                            p, q, margin,
                        )  # fmt: skip
                    q = following[q]
        slot = (u * 73856093 ^ v * 19349663) & mask
        following[p] = heads[slot]
        heads[slot] = p
    # Large ones with everything that moves.
    for k in range(large.shape[0]):
        p = large[k]
        if not there[body[p]]:
            continue
        for m in range(small.shape[0] + k):
            q = small[m] if m < small.shape[0] else large[m - small.shape[0]]
            if there[body[q]] and body[q] != body[p] and _near(middles, radius, q, p, margin):
                n = _pair(
                    ints, reals, n, body, friction, first, count, radius, middles, corners, q, p,
                    margin,
                )  # fmt: skip
    # Everything with what stands, through its buckets.
    low, size, box, stamp, cell = near.low, near.size, near.box, near.stamp, near.cell
    start, items = near.start, near.items
    stamp[:] = -1
    for p in range(moving):
        if not there[body[p]]:
            continue
        reach = radius[p] + margin
        x0, x1 = middles[p, 0] - reach, middles[p, 0] + reach
        y0, y1 = middles[p, 1] - reach, middles[p, 1] + reach
        i0, i1 = max(0, _cell(x0 - low[0], cell)), min(size[0] - 1, _cell(x1 - low[0], cell))
        j0, j1 = max(0, _cell(y0 - low[1], cell)), min(size[1] - 1, _cell(y1 - low[1], cell))
        for j in range(j0, j1 + 1):
            for i in range(i0, i1 + 1):
                at = j * size[0] + i
                for k in range(start[at], start[at + 1]):
                    w = items[k]
                    if stamp[w] == p:
                        continue
                    stamp[w] = p
                    over = box[w, 0] < x1 and box[w, 2] > x0 and box[w, 1] < y1 and box[w, 3] > y0
                    if over and _near(middles, radius, p, moving + w, margin):
                        n = _pair(
                            ints, reals, n, body, friction, first, count, radius, middles, corners,
                            p, moving + w, margin,
                        )  # fmt: skip
    return n
