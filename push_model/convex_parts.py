"""Convex decomposition of an outline, e.g. for collision shapes."""

import numpy as np

from push_model.arrays import Array

_STRAIGHT = 1e-12  # of the outline's size squared: a smaller turn counts as straight


def convex_parts(outline: Array) -> list[Array]:
    """Convex outlines without common area whose union is the outline.

    Parameters
    ----------
    outline: ``(n, 2)`` [m] simple polygon, counter-clockwise.

    Returns
    -------
    ``(m, 2)`` [m] each, counter-clockwise, corners of the outline only. A convex outline is its
    only part. The outline is triangulated by ear clipping; neighbours are then merged while they
    stay convex (Hertel and Mehlhorn 1983). The result has at most four times the least number.
    """
    points = np.asarray(outline, dtype=np.float64)
    flat = _STRAIGHT * float(np.ptp(points, axis=0).max()) ** 2
    if _is_convex(points, list(range(len(points))), flat):
        return [points]
    parts = _triangles(points, flat)
    diagonals = [edge for part in parts for edge in _edges(part) if edge[0] < edge[1]]
    for a, b in diagonals:
        first = next((p for p in parts if (a, b) in _edges(p)), None)
        second = next((p for p in parts if (b, a) in _edges(p)), None)
        if first is None or second is None:
            continue  # an edge of the outline
        whole = _from(first, b) + _from(second, a)[1:-1]
        if _is_convex(points, whole, flat):
            parts = [p for p in parts if p is not first and p is not second] + [whole]
    return [points[p] for p in parts]


def _triangles(points: Array, flat: float) -> list[list[int]]:
    """Corners of triangles that cover the outline, by ear clipping."""
    left = list(range(len(points)))
    triangles = []
    while len(left) > 3:
        best, quality = 0, -np.inf
        for k in range(len(left)):
            a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
            turn = _turn(points[a], points[b], points[c])
            if turn <= flat:
                if abs(turn) <= flat and quality == -np.inf:
                    best, quality = k, -1.0  # without an ear, remove a corner on a straight line
                continue
            rest = points[[i for i in left if i not in (a, b, c)]]
            if not _holds_any(points[a], points[b], points[c], rest):
                longest = max(
                    float(np.hypot(*(points[p] - points[q]))) for p, q in ((a, b), (b, c), (c, a))
                )
                if turn / longest**2 > quality:
                    best, quality = k, turn / longest**2  # the least acute ear
        a, b, c = left[best - 1], left[best], left[(best + 1) % len(left)]
        if quality > 0.0:
            triangles.append([a, b, c])
        del left[best]
    if _turn(points[left[0]], points[left[1]], points[left[2]]) > flat:
        triangles.append(left)
    return triangles


def _holds_any(a: Array, b: Array, c: Array, points: Array) -> bool:
    """Whether a point lies in a triangle or on its edges, other than in its corners."""
    inside = np.ones(len(points), dtype=bool)
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= (q[0] - p[0]) * (points[:, 1] - p[1]) >= (q[1] - p[1]) * (points[:, 0] - p[0])
    return bool(inside.any())


def _edges(part: list[int]) -> list[tuple[int, int]]:
    return list(zip(part, part[1:] + part[:1], strict=True))


def _from(part: list[int], corner: int) -> list[int]:
    """The same part, its corners counted from one of them."""
    k = part.index(corner)
    return part[k:] + part[:k]


def _is_convex(points: Array, corners: list[int], flat: float) -> bool:
    p = points[corners]
    edge = np.roll(p, -1, axis=0) - p
    after = np.roll(edge, -1, axis=0)
    turn = edge[:, 0] * after[:, 1] - edge[:, 1] * after[:, 0]
    return bool((turn >= -flat).all())


def _turn(a: Array, b: Array, c: Array) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
