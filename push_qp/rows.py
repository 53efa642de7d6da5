"""Rows of a programme as combinations of the outputs of its steps: checked, and written out."""

import math
from typing import Any

import numba
import numpy as np


@numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def outputs(S: Any, g: Any, width: Any, z: Any, y: Any) -> None:
    """y_k = g_k + S_k u; only the first ``width[k]`` inputs move output k."""
    for k in range(g.shape[0]):
        w = width[k]
        for i in range(g.shape[1]):
            total = 0.0
            for c in range(w):
                total += S[k, i, c] * z[c]
            y[k, i] = g[k, i] + total


@numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def rooms(normal: Any, bound: Any, y: Any, slack: Any, room: Any) -> None:
    """room_kj = bound_kj + slack_j - normal_kj . y_k; ``slack`` is ``(rows of a step,)``."""
    for k in range(y.shape[0]):
        for j in range(bound.shape[1]):
            room[k, j] = bound[k, j] + slack[j]
        for i in range(y.shape[1]):
            value = y[k, i]
            for j in range(bound.shape[1]):
                room[k, j] -= normal[k, i, j] * value


@numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def write_row(
    S: Any, g: Any, width: Any, normal: Any, bound: Any, family: Any, k: int, j: int, row: Any
) -> float:
    """Row (k, j) as row . z <= the value returned."""
    inputs = S.shape[2]
    right = bound[k, j]
    row[:] = 0.0
    for i in range(g.shape[1]):
        a = normal[k, i, j]
        if a != 0.0:
            right -= a * g[k, i]
            for c in range(width[k]):
                row[c] += a * S[k, i, c]
    if family[j] >= 0:
        row[inputs + family[j]] = -1.0
    return float(right)


@numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def write_rows(
    S: Any, g: Any, width: Any, normal: Any, bound: Any, family: Any, numbers: Any, G: Any, b: Any
) -> None:
    """Rows k r + j as G z <= b, from the first row of G ``(>= m, n)`` and b ``(>= m,)`` on."""
    for i in range(numbers.shape[0]):
        k, j = divmod(numbers[i], bound.shape[1])
        b[i] = write_row(S, g, width, normal, bound, family, k, j, G[i])


@numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def violated(
    S: Any,
    g: Any,
    width: Any,
    normal: Any,
    bound: Any,
    family: Any,
    z: Any,
    tolerance: float,
    chosen: Any,
    room: Any,
    numbers: Any,
) -> int:
    """Number of rows beyond those ``chosen`` ``(K r,)`` that are violated at z; -1: not finite.

    Their numbers are written into ``numbers`` ``(K r,)``, and they are marked in ``chosen``. room
    ``(K, r)`` is filled in.
    """
    y, slack = np.empty(g.shape), np.empty(bound.shape[1])
    outputs(S, g, width, z, y)
    for j in range(family.shape[0]):
        slack[j] = z[S.shape[2] + family[j]] if family[j] >= 0 else 0.0
    rooms(normal, bound, y, slack, room)
    count = 0
    for k in range(bound.shape[0]):
        for j in range(bound.shape[1]):
            if math.isnan(room[k, j]):
                return -1
            number = k * bound.shape[1] + j
            if room[k, j] < -tolerance and not chosen[number]:
                numbers[count] = number
                chosen[number] = True
                count += 1
    return count
