"""Keeps robots apart: pairwise velocity constraints, and the projection of velocities on them.

Two robots i and j with a gap g between them, and n the unit vector from i to j, may close the gap
at most in proportion to what exceeds the gap g0 that is kept:

    (v_i - v_j) . n <= rate (g - g0)

This is the constraint of a control barrier function h = g - g0 with dh/dt >= -rate h, for robots
whose velocity is the input; with it, h >= 0 stays true. Wang, Ames and Egerstedt, "Safety barrier
certificates for collisions-free multirobot systems" (T-RO 2017), share a constraint between the two
robots of a pair likewise, there on accelerations. Unlike a (reciprocal) velocity obstacle, which
excludes all relative velocities that collide within a time horizon, it bounds one component of the
relative velocity, is linear, and does not affect robots that move side by side at equal velocities.

The velocities are changed by cyclic projection: each violated constraint in turn is met by the
least change of the velocities in it, half by each robot, or all of it by the one that moves. Sweeps
end when no constraint is violated by more than 0.1 mm/s, or after eight. The result is close to,
but not exactly, the nearest feasible velocities; what is left over is small, and corrected at the
next tick. Walls and the object bound single velocities in the same way. Compiled.
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
    """Velocities ``(n, 2)`` [m/s] of the robots that meet the constraints, or nearly so.

    Parameters
    ----------
    velocities: ``(n, 2)`` [m/s] that are wanted, of the first n bodies; the other bodies stand.
    points: ``(m, 2)`` [m] of all bodies; radii: ``(m,)`` [m].
    gap: [m] g0. rate: [1/s].
    reach: [m] of gaps beyond which a pair is left out.
    bounds: ``(b, n, 3)`` unit vectors, and the highest speed [m/s] of each robot along them.
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
