"""Robots that keep apart: velocities changed as little as need be. Compiled.

Two robots may come closer by so much of the gap between them in a second; what they lack of that,
each of both gives half, or the one that moves all of it. Robots that push side by side move alike
and are not touched by it.
"""

import math
from typing import Any

import numba
import numpy as np

from push_model.arrays import Array

_SWEEPS = 8


def keep_apart(
    velocities: Array,
    points: Array,
    radii: Array,
    gap: float,
    rate: float,
    reach: float,
    bounds: Array | None = None,
) -> Array:
    """Velocities ``(n, 2)`` [m/s] of the first n bodies at ``(m, 2)`` [m], changed; further bodies
    stand.

    radii: ``(m,)`` [m]. gap: [m] between bodies that is kept. rate: [1/s] of the gap beyond it that
    may close. reach: [m] of gaps up to which pairs are looked at. bounds: ``(b, n, 3)`` unit
    vectors for each robot and how fast [m/s] it may go along them.
    """
    moved = np.zeros((len(points), 2))
    moved[: len(velocities)] = velocities
    if bounds is None:
        bounds = np.zeros((0, len(velocities), 3))
    if len(velocities):
        order = np.argsort(points[:, 0], kind="stable")
        points, radii = np.ascontiguousarray(points), np.ascontiguousarray(radii)
        _part(moved, len(velocities), points, radii, order, gap, rate, reach, bounds)
    return moved[: len(velocities)]


@numba.njit(cache=True, error_model="numpy")
def _part(
    moved: Any, count: int, points: Any, radii: Any, order: Any, gap: float, rate: float,
    reach: float, bounds: Any,
) -> None:  # fmt: skip
    n, widest = order.shape[0], radii.max()
    for _ in range(_SWEEPS):
        most = 0.0
        for a in range(n):
            i = order[a]
            for b in range(a + 1, n):
                j = order[b]
                dx = points[j, 0] - points[i, 0]
                if dx > radii[i] + widest + reach:
                    break
                if i >= count and j >= count:
                    continue
                dy = points[j, 1] - points[i, 1]
                away = math.hypot(dx, dy)
                room = away - radii[i] - radii[j]
                if room > reach or away < 1e-9:
                    continue
                ux, uy = dx / away, dy / away
                closing = (moved[i, 0] - moved[j, 0]) * ux + (moved[i, 1] - moved[j, 1]) * uy
                excess = closing - rate * (room - gap)
                if excess <= 0.0:
                    continue
                most = max(most, excess)
                part = 0.5 if i < count and j < count else 1.0
                if i < count:
                    moved[i, 0] -= part * excess * ux
                    moved[i, 1] -= part * excess * uy
                if j < count:
                    moved[j, 0] += part * excess * ux
                    moved[j, 1] += part * excess * uy
        for k in range(bounds.shape[0]):
            for i in range(count):
                ux, uy = bounds[k, i, 0], bounds[k, i, 1]
                excess = moved[i, 0] * ux + moved[i, 1] * uy - bounds[k, i, 2]
                if excess > 0.0:
                    most = max(most, excess)
                    moved[i, 0] -= excess * ux
                    moved[i, 1] -= excess * uy
        if most < 1e-4:
            break
