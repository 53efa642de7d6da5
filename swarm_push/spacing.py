"""Robots that keep apart: velocities changed as little as need be. Compiled.

Two robots may come closer by so much of the gap between them in a second; what they lack of that,
each of both gives half. Robots that push side by side move alike and are not touched by it.
"""

import math
from typing import Any

import numba
import numpy as np

from push_model.arrays import Array

_SWEEPS = 8


def keep_apart(
    velocities: Array, points: Array, distance: float, rate: float, reach: float
) -> Array:
    """Velocities ``(n, 2)`` [m/s] of robots at ``(n, 2)`` [m], changed.

    distance: [m] between centres that is kept. rate: [1/s] of the gap that may close. reach: [m]
    beyond ``distance`` up to which pairs are looked at.
    """
    moved = np.array(velocities, dtype=np.float64)
    if len(points) > 1:
        order = np.argsort(points[:, 0], kind="stable")
        _part(moved, np.ascontiguousarray(points), order, distance, rate, reach)
    return moved


@numba.njit(cache=True, error_model="numpy")
def _part(moved: Any, points: Any, order: Any, distance: float, rate: float, reach: float) -> None:
    n = order.shape[0]
    for _ in range(_SWEEPS):
        most = 0.0
        for a in range(n):
            i = order[a]
            for b in range(a + 1, n):
                j = order[b]
                dx = points[j, 0] - points[i, 0]
                if dx > distance + reach:
                    break
                dy = points[j, 1] - points[i, 1]
                away = math.hypot(dx, dy)
                if away > distance + reach or away < 1e-9:
                    continue
                ux, uy = dx / away, dy / away
                closing = (moved[i, 0] - moved[j, 0]) * ux + (moved[i, 1] - moved[j, 1]) * uy
                excess = closing - rate * (away - distance)
                if excess > 0.0:
                    most = max(most, excess)
                    moved[i, 0] -= 0.5 * excess * ux
                    moved[i, 1] -= 0.5 * excess * uy
                    moved[j, 0] += 0.5 * excess * ux
                    moved[j, 1] += 0.5 * excess * uy
        if most < 1e-4:
            break
