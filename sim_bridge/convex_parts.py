"""Convex parts of an outline, for engines that collide nothing else."""

import math

import numpy as np

from push_model.arrays import Array

_FLAT = 1e-12  # [m^2] of a corner that counts as straight


def inset(outline: Array, distance: float) -> Array:
    """The outline ``(n, 2)``, counter-clockwise, with every edge moved inward [m]."""
    edge = np.roll(outline, -1, axis=0) - outline
    normal = np.column_stack([-edge[:, 1], edge[:, 0]]) / np.hypot(*edge.T)[:, None]
    before = np.roll(normal, 1, axis=0)
    bisector = normal + before
    scale = distance / np.maximum(0.5 * (bisector**2).sum(1), 0.2)
    moved: Array = outline + bisector * scale[:, None]
    return moved


def convex_parts(outline: Array) -> list[Array]:
    """Convex polygons whose union is a simple polygon ``(n, 2)``, counter-clockwise.

    Triangles by cutting off ears, then joined over each diagonal that convexity does not need
    (Hertel & Mehlhorn 1983): at most four times as many parts as possible.
    """
    parts = _triangles(outline)
    joined = True
    while joined:
        joined = False
        owner: dict[tuple[int, int], int] = {}
        for i, part in enumerate(parts):
            for edge in _edges(part):
                owner[edge] = i
        for (a, b), i in owner.items():
            j = owner.get((b, a))
            if j is None:
                continue
            whole = _joined(parts[i], parts[j], a, b)
            if _convex(outline[whole]):
                parts = [p for k, p in enumerate(parts) if k not in (i, j)] + [whole]
                joined = True
                break
    return [outline[part] for part in parts]


def _edges(part: list[int]) -> list[tuple[int, int]]:
    return list(zip(part, [*part[1:], part[0]], strict=True))


def _joined(first: list[int], second: list[int], a: int, b: int) -> list[int]:
    """Two parts as one: the first has the edge a to b, the second b to a."""
    i, j = first.index(b), second.index(a)
    return [*first[i:], *first[:i], *(second[j:] + second[:j])[1:-1]]


def _triangles(outline: Array) -> list[list[int]]:
    left = list(range(len(outline)))
    result: list[list[int]] = []
    while len(left) > 3:
        ear = max(range(len(left)), key=lambda k: _ear(outline, left, k))
        if _ear(outline, left, ear) == -math.inf:
            raise ValueError("an outline that crosses itself has no convex parts")
        result.append([left[ear - 1], left[ear], left[(ear + 1) % len(left)]])
        del left[ear]
    return [*result, left]


def _ear(outline: Array, left: list[int], k: int) -> float:
    """How good it is to cut off a corner: the least angle of the ear; -inf when it is none."""
    i, j, m = left[k - 1], left[k], left[(k + 1) % len(left)]
    a, b, c = outline[i], outline[j], outline[m]
    turn = _cross(b - a, c - b)
    if turn < -_FLAT:
        return -math.inf
    others = outline[[v for v in left if v not in (i, j, m)]]
    inside = (
        (_cross(b - a, others - a) >= 0.0)
        & (_cross(c - b, others - b) >= 0.0)
        & (_cross(a - c, others - c) >= 0.0)
    )
    if turn > _FLAT and inside.any():
        return -math.inf
    sides = [float(np.hypot(*(q - p))) for p, q in ((a, b), (b, c), (c, a))]
    return 2.0 * float(turn) / (sides[0] * sides[1] * sides[2]) * min(sides)


def _cross(u: Array, v: Array) -> Array:
    result: Array = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    return result


def _convex(points: Array) -> bool:
    edge = np.roll(points, -1, axis=0) - points
    return bool((_cross(edge, np.roll(edge, -1, axis=0)) >= -_FLAT).all())
