"""Configuration indices of 3.1.3, of many grasps at once.

points, normals: ``(..., n, 2)`` [m] about the centre of mass; unit, inward. Each returns ``(...)``.
"""

import math
from typing import Any

import numba
import numpy as np

from push_model.arrays import Array


def composed_quality(points: Array, normals: Array) -> Array:
    """I_D of (3.5), with the misprint mended: docs/errata.md. 1 where central vectors are spread
    evenly and normals point to the centre; inf where a factor vanishes; 1 contact: inf."""
    n = points.shape[-2]
    result = np.empty(points.shape[:-2])
    flat = result.reshape(-1)
    _composed(_flat(points), _flat(normals), flat)
    return np.asarray((2.0 * math.pi / n) ** n * flat.reshape(result.shape))


def extension(points: Array) -> Array:
    """I_E [m^2]: the area of the polygon of the contact points, in turn about their middle."""
    result = np.empty(points.shape[:-2])
    flat = result.reshape(-1)
    _areas(_flat(points), flat)
    return np.asarray(flat.reshape(result.shape))


def dexterity(points: Array, length: float) -> Array:
    """I_G of (3.6): ratio of the singular values of the grasp matrix, torques over ``length``."""
    # G G' is [[n, 0, -y], [0, n, x], [-y, x, s]]: its eigenvalues are n and two by a square root.
    n = points.shape[-2]
    x, y = points[..., 0].sum(-1) / length, points[..., 1].sum(-1) / length
    s = (points**2).sum(axis=(-1, -2)) / length**2
    middle, spread = 0.5 * (n + s), np.sqrt(0.25 * (n - s) ** 2 + x**2 + y**2)
    least = np.minimum(middle - spread, n)
    ratio: Array = np.sqrt(np.maximum(least, 0.0) / np.maximum(middle + spread, n))
    return ratio


def _flat(pairs: Array) -> Array:
    return np.ascontiguousarray(pairs).reshape(-1, *pairs.shape[-2:])


@numba.njit(cache=True)  # infinities: no fast mathematics
def _composed(points: Any, normals: Any, result: Any) -> None:
    n = points.shape[1]
    for g in range(points.shape[0]):
        product = 1.0
        for i in range(n):
            size = math.hypot(points[g, i, 0], points[g, i, 1])
            cx, cy = -points[g, i, 0] / size, -points[g, i, 1] / size
            near = math.inf
            for j in range(n):
                if j != i:
                    other = math.hypot(points[g, j, 0], points[g, j, 1])
                    d = -(cx * points[g, j, 0] + cy * points[g, j, 1]) / other
                    near = min(near, math.acos(min(1.0, max(-1.0, d))))
            d = cx * normals[g, i, 0] + cy * normals[g, i, 1]
            product *= abs(near - math.acos(min(1.0, max(-1.0, d))))
        result[g] = 1.0 / product if 0.0 < product < math.inf else math.inf


@numba.njit(cache=True)
def _areas(points: Any, result: Any) -> None:
    n = points.shape[1]
    for g in range(points.shape[0]):
        mx, my = points[g, :, 0].mean(), points[g, :, 1].mean()
        order = np.argsort(np.arctan2(points[g, :, 1] - my, points[g, :, 0] - mx))
        area = 0.0
        for k in range(n):
            a, b = order[k], order[(k + 1) % n]
            area += points[g, a, 0] * points[g, b, 1] - points[g, b, 0] * points[g, a, 1]
        result[g] = 0.5 * abs(area)


@numba.njit(cache=True, fastmath=True)
def _hausdorff(rays: Any, wrenches: Any, result: Any) -> None:
    grasps, m, q = rays.shape[0], rays.shape[1], wrenches.shape[0]
    best = np.empty(m)
    for g in range(grasps):
        best[:] = -1.0
        there = 0.0
        for i in range(q):
            most = -1.0
            for k in range(m):
                d = rays[g, k, 0] * wrenches[i, 0] + rays[g, k, 1] * wrenches[i, 1]
                d += rays[g, k, 2] * wrenches[i, 2]
                most, best[k] = max(most, d), max(best[k], d)
            there += most
        result[g] = max(best.mean(), there / q)


def modified_hausdorff(rays: Array, wrenches: Array) -> Array:
    """MHD of (3.7)-(3.8) between unit wrenches of grasps ``(k, m, 3)`` and of a task ``(q, 3)``.

    A mean of greatest cosines: the larger, the nearer the two sets are to each other.
    """
    result = np.empty(len(rays))
    _hausdorff(np.ascontiguousarray(rays), np.ascontiguousarray(wrenches), result)
    return result
