"""Exact geometry of closed outlines ``(n, 2)`` [m]: hulls, containment, overlap, distance.

Outlines are simple polygons; those called convex are convex and counter-clockwise. Comparisons are
free of tolerances unless one is asked for.
"""

import numpy as np
from numpy.typing import NDArray

from push_model.arrays import Array


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


def inside_convex(outline: Array, points: Array, margin: float = 0.0) -> NDArray[np.bool_]:
    """Which points ``(k, 2)`` lie in a convex outline and over ``margin`` [m] from its edges."""
    edge = np.roll(outline, -1, axis=0) - outline
    normal = np.column_stack([-edge[:, 1], edge[:, 0]]) / np.hypot(*edge.T)[:, None]
    depth = np.asarray(points) @ normal.T - (normal * outline).sum(axis=1)
    inside: NDArray[np.bool_] = (depth > margin).all(axis=1)
    return inside


def _turn(a: Array, b: Array, c: Array) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
