"""Rows of a programme as combinations of the outputs of its steps: checked, and written out."""

from typing import Any

import numba


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
