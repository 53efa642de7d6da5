"""Exact geometry of closed outlines ``(n, 2)`` [m]: hulls, containment, overlap, distance.

An outline is a simple polygon, convex or not, either way round; one that is called convex is convex
and counter-clockwise. Touching is not overlapping, as far as rounding lets one tell.
"""

import numpy as np
from numpy.typing import NDArray

from push_model.arrays import Array

Mask = NDArray[np.bool_]


def convex_hull(points: Array) -> Array:
    """``(m, 2)`` [m] corners of the convex hull of ``(n, 2)`` points, counter-clockwise."""
    ordered = np.unique(np.asarray(points, dtype=np.float64), axis=0)

    def chain(points: Array) -> list[Array]:
        corners: list[Array] = []
        for p in points:
            while len(corners) > 1 and _turn(corners[-2], corners[-1], p) <= 0.0:
                corners.pop()
            corners.append(p)
        return corners[:-1]

    return np.array([*chain(ordered), *chain(ordered[::-1])])


def inset(outline: Array, distance: float) -> Array:
    """An outline, counter-clockwise, with every edge moved inward [m]."""
    edge = np.roll(outline, -1, axis=0) - outline
    normal = np.column_stack([-edge[:, 1], edge[:, 0]]) / np.hypot(*edge.T)[:, None]
    before = np.roll(normal, 1, axis=0)
    bisector = normal + before
    scale = distance / np.maximum(0.5 * (bisector**2).sum(1), 0.2)
    moved: Array = outline + bisector * scale[:, None]
    return moved


def inside_convex(outline: Array, points: Array, margin: float = 0.0) -> Mask:
    """Which points ``(k, 2)`` lie in a convex outline and over ``margin`` [m] from its edges."""
    edge = np.roll(outline, -1, axis=0) - outline
    normal = np.column_stack([-edge[:, 1], edge[:, 0]]) / np.hypot(*edge.T)[:, None]
    depth = np.asarray(points) @ normal.T - (normal * outline).sum(axis=1)
    inside: Mask = (depth > margin).all(axis=1)
    return inside


def inside(outline: Array, points: Array) -> Mask:
    """Which points ``(k, 2)`` lie in an outline: an odd number of edges to their right."""
    x, y = np.asarray(points, dtype=np.float64).reshape(-1, 2).T[:, :, None]
    ax, ay = outline.T
    bx, by = np.roll(outline, -1, axis=0).T
    crosses = (ay > y) != (by > y)
    level = np.where(crosses, by - ay, 1.0)
    odd: Mask = (crosses & (x < ax + (y - ay) * (bx - ax) / level)).sum(axis=1) % 2 == 1
    return odd


def distance(outline: Array, points: Array) -> Array:
    """``(k,)`` [m] of points ``(k, 2)`` from the line of an outline, inside or outside."""
    edge = np.roll(outline, -1, axis=0) - outline
    to = np.asarray(points, dtype=np.float64).reshape(-1, 1, 2) - outline
    along = np.clip((to * edge).sum(axis=2) / (edge * edge).sum(axis=1), 0.0, 1.0)
    away = to - along[:, :, None] * edge
    least: Array = np.hypot(away[:, :, 0], away[:, :, 1]).min(axis=1)
    return least


def overlap(first: Array, second: Array) -> bool:
    """Whether two outlines have an area in common."""
    if (first.max(axis=0) <= second.min(axis=0)).any():
        return False
    if (second.max(axis=0) <= first.min(axis=0)).any():
        return False
    if _edges_cross(first, second):
        return True
    return _borders(first, second) or _borders(second, first)


def overlaps_disc(outline: Array, centre: Array, radius: float) -> bool:
    """Whether an outline and a disc have an area in common."""
    at = np.asarray(centre, dtype=np.float64)[None]
    return bool(inside(outline, at)[0] or distance(outline, at)[0] < radius)


def cells_hit(outline: Array, corners: Array, size: float) -> Mask:
    """Which square cells have an area in common with an outline.

    Parameters
    ----------
    corners: ``(k, 2)`` [m] the lower left of each cell. size: [m] of a cell's side.
    """
    hit = inside(outline, corners + 0.5 * size)
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        low, high = np.minimum(a, b), np.maximum(a, b)
        near = ((corners < high) & (corners + size > low)).all(axis=1)
        normal = np.array([a[1] - b[1], b[0] - a[0]])
        middle = (corners + 0.5 * size - a) @ normal
        hit |= near & (np.abs(middle) < 0.5 * size * np.abs(normal).sum())
    return hit


def _turn(a: Array, b: Array, c: Array) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _edges_cross(first: Array, second: Array) -> bool:
    a, b = first[:, None], np.roll(first, -1, axis=0)[:, None]
    c, d = second[None], np.roll(second, -1, axis=0)[None]

    def turn(p: Array, q: Array, r: Array) -> Array:
        left: Array = (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1])
        return left - (q[..., 1] - p[..., 1]) * (r[..., 0] - p[..., 0])

    # Corners on a line, but for rounding, touch it.
    small = 1e-12 * float(np.ptp(np.vstack([first, second]), axis=0).max()) ** 2

    def apart(one: Array, other: Array) -> Mask:
        return (np.minimum(one, other) < -small) & (np.maximum(one, other) > small)

    cross = apart(turn(a, b, c), turn(a, b, d)) & apart(turn(c, d, a), turn(c, d, b))
    return bool(cross.any())


def _borders(outline: Array, other: Array) -> bool:
    """Whether an edge of the second outline bounds what both have in common.

    For outlines whose edges do not cross: each edge is cut where a corner of the first lies on it,
    and it is asked whether a point just inside of each piece lies in the first.
    """
    small = 1e-9 * float(np.ptp(outline, axis=0).max())
    a, b = other, np.roll(other, -1, axis=0)
    edge = b - a
    length = np.hypot(*edge.T)
    turn = np.sign(a[:, 0] @ b[:, 1] - a[:, 1] @ b[:, 0])  # +1 counter-clockwise
    inward = turn * np.column_stack([-edge[:, 1], edge[:, 0]]) / length[:, None]
    to = outline[None] - a[:, None]
    along = (to * edge[:, None]).sum(axis=2) / length[:, None] ** 2
    on = np.abs((to * inward[:, None]).sum(axis=2)) <= small
    points = []
    for i in range(len(other)):
        cuts = along[i][on[i] & (along[i] > 0.0) & (along[i] < 1.0)]
        shares = np.array([0.0, *np.sort(cuts), 1.0])
        long = np.diff(shares) * length[i] > 10.0 * small  # pieces, not corners that coincide
        middles = (0.5 * (shares[1:] + shares[:-1]))[long]
        points.append(a[i] + middles[:, None] * edge[i] + 2.0 * small * inward[i])
    return bool(inside(outline, np.vstack(points)).any())
