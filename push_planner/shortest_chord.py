"""Minimum distance between the two ends of a push, given the headings at both ends.

The chord of a push is the straight line between the ends of its curve. Whether a push curve
(2.2)-(2.7) exists depends on the curvature limits and on three numbers: the length d of the chord,
the angle a from the first heading to the chord, and the angle b from the chord to the last heading.

A curve that is scaled by a factor k has a curvature that is k times smaller. For each pair (a, b)
there is therefore a minimum length d. It equals the smallest value, over all cubics with a chord of
length 1, of the greatest curvature relative to its limit. A curve that is mirrored and traversed
backward has the same curvature, and its angles a and b are exchanged. The table is therefore
symmetric.

Computing a table over a and b takes some hundredths of a second. Looking a value up takes less than
a thousandth of the time of a push curve.
"""

import math
from functools import lru_cache
from typing import Any

import numba
import numpy as np

from push_model.arrays import Array
from push_planner.push_curve import basis_rows

WIDEST = 2.0
"""[rad] Largest angle between a heading and the chord. With a larger one a push makes a loop."""
_TOP = math.tan(0.5 * WIDEST)  # of the table's axes, tangents of half angles
_NODES = 33  # on each axis
_SAMPLES = 25  # of a cubic
_GRID = 8  # values of k_i and of k_f from which a search for the least curvature begins
_LEAST_K, _MOST_K = 0.05, 7.0  # of the chord
_DIRECTIONS = 9  # of the compass search
_TWIST = 0.25  # [rad] by which they turn from round to round: the valley has a kink
_ROUNDS = 80  # of the compass search at most
_FINEST = 0.004  # last step of the compass search, in log(k)
_BASIS = basis_rows(_SAMPLES)


@numba.njit(cache=True, fastmath=True)
def _worst(
    ki: float, kf: float, x: float, y: float, c: float, s: float, low: float, basis: Any
) -> float:
    """Greatest curvature of a cubic relative to its limits.

    The limits are 1 to the left and ``low`` (negative) to the right.
    """
    worst = 0.0
    for i in range(basis.shape[1]):
        dx = basis[0, i] * x + basis[1, i] * kf * c + basis[2, i] * ki
        dy = basis[0, i] * y + basis[1, i] * kf * s
        ddx = basis[3, i] * x + basis[4, i] * kf * c + basis[5, i] * ki
        ddy = basis[3, i] * y + basis[4, i] * kf * s
        q = dx * dx + dy * dy
        kappa = (dx * ddy - dy * ddx) / (q * math.sqrt(q) + 1e-12)
        worst = max(worst, kappa, kappa / low)
    return worst


@numba.njit(cache=True, fastmath=True)
def _least_worst(a: float, b: float, low: float, basis: Any) -> float:
    """Smallest value of ``_worst`` over all cubics with a chord of length 1.

    A compass search begins at the best point of a grid, and another one at tangents as long as the
    chord.
    """
    x, y, c, s = math.cos(a), math.sin(a), math.cos(a + b), math.sin(a + b)
    ratio = math.log(_MOST_K / _LEAST_K) / (_GRID - 1)
    best, first_i, first_f = 1e18, 1.0, 1.0
    for i in range(_GRID):
        for j in range(_GRID):
            mi, mf = _LEAST_K * math.exp(ratio * i), _LEAST_K * math.exp(ratio * j)
            worst = _worst(mi, mf, x, y, c, s, low, basis)
            if worst < best:
                best, first_i, first_f = worst, mi, mf
    for ki, kf in ((first_i, first_f), (1.0, 1.0)):
        step, here = 0.5 * ratio, _worst(ki, kf, x, y, c, s, low, basis)
        for number in range(_ROUNDS):
            if step < _FINEST:
                break
            found = False
            for k in range(_DIRECTIONS):
                angle = 2.0 * math.pi * k / _DIRECTIONS + number * _TWIST
                mi = ki * math.exp(step * math.cos(angle))
                mf = kf * math.exp(step * math.sin(angle))
                worst = _worst(mi, mf, x, y, c, s, low, basis)
                if worst < here:
                    here, ki, kf = worst, mi, mf
                    found = True
            if not found:
                step *= 0.7
        best = min(best, here)
    return best


@numba.njit(cache=True)
def _table(low: float, basis: Any) -> Any:
    values = np.empty((_NODES, _NODES))
    for i in range(_NODES):
        a = 2.0 * math.atan(_TOP * (2.0 * i / (_NODES - 1) - 1.0))
        for j in range(i + 1):
            b = 2.0 * math.atan(_TOP * (2.0 * j / (_NODES - 1) - 1.0))
            values[i, j] = values[j, i] = _least_worst(a, b, low, basis)
    return values


@lru_cache(maxsize=64)
def _relative(right: float) -> Array:
    values: Array = _table(right, _BASIS)
    values.setflags(write=False)
    return values


def shortest_chords(curvature_min: float, curvature_max: float) -> Array:
    """Table of minimum chord lengths, to be read with ``chord``.

    Parameters
    ----------
    curvature_min, curvature_max: [1/m] curvature limits to the right (< 0) and to the left (> 0).

    Returns
    -------
    ``(n, n)`` [m]. The axes are the tangents of half the angles a and b.

    Raises
    ------
    ValueError: the limits do not enclose 0.
    """
    if not curvature_min < 0.0 < curvature_max:
        raise ValueError(
            "the curvature limits must enclose 0 (minimum < 0 < maximum), got "
            f"[{curvature_min}, {curvature_max}] 1/m"
        )
    return _relative(round(curvature_min / curvature_max, 2)) / curvature_max


@numba.njit(cache=True, fastmath=True, inline="always")
def chord(table: Any, start: float, end: float) -> float:
    """Minimum length [m] of the chord between two headings, interpolated in a table.

    Parameters
    ----------
    table: from ``shortest_chords``.
    start, end: tangents of half the angles a and b. Both angles are at most ``WIDEST``.
    """
    scale = 0.5 * (_NODES - 1)
    u, v = scale * (start / _TOP + 1.0), scale * (end / _TOP + 1.0)
    i, j = min(max(int(u), 0), _NODES - 2), min(max(int(v), 0), _NODES - 2)
    p, q = u - i, v - j
    # By triangles: along the diagonal, where arcs are, the table has a valley with a kink.
    if p >= q:
        value = (1.0 - p) * table[i, j] + (p - q) * table[i + 1, j] + q * table[i + 1, j + 1]
    else:
        value = (1.0 - q) * table[i, j] + (q - p) * table[i, j + 1] + p * table[i + 1, j + 1]
    return float(value)
