"""Factors of the Hessian and of the working set, updated as rows enter and leave.

With H = L L', the rows of JT = Q' L^-1 are turned by an orthogonal Q such that the normals N of the
q rows of the working set satisfy JT N = (R; 0), R upper triangular.
"""

import math
from typing import Any

import numba


@numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def dot(a: Any, b: Any) -> float:
    """The inner product."""
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] * b[i]
    return float(total)


@numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def inverse_factor(H: Any, L: Any, JT: Any) -> bool:
    """JT = L^-1 with H = L L'; False when H is not positive definite (or not finite)."""
    n = H.shape[0]
    for i in range(n):
        for j in range(i):
            total = H[i, j]
            for c in range(j):
                total -= L[i, c] * L[j, c]
            L[i, j] = total * L[j, j]  # the diagonal holds reciprocals
        total = H[i, i]
        for c in range(i):
            total -= L[i, c] * L[i, c]
        if not (total > 1e-14 * H[i, i] and total < math.inf):
            return False
        L[i, i] = 1.0 / math.sqrt(total)
    JT[:] = 0.0
    for i in range(n):
        for j in range(i):
            factor = L[i, j]
            if factor != 0.0:
                for c in range(j + 1):
                    JT[i, c] -= factor * JT[j, c]
        for c in range(i):
            JT[i, c] *= L[i, i]
        JT[i, i] = L[i, i]
    return True


@numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def add_column(JT: Any, R: Any, d: Any, q: int, norm: float, w: Any) -> None:
    """Turn the rows q.. of JT so that d becomes (d_1, norm, 0 ..); d_1, norm: column q of R."""
    n = JT.shape[0]
    for i in range(q):
        R[i, q] = d[i]
    # Householder: v = d_2 - s |d_2| e_1, with the sign that does not cancel
    s = -norm if d[q] > 0.0 else norm
    R[q, q] = s
    first = d[q] - s
    half = norm * (norm + abs(d[q]))  # v'v / 2
    w[:] = 0.0
    for i in range(q, n):
        v = first if i == q else d[i]
        if v != 0.0:
            for c in range(n):
                w[c] += v * JT[i, c]
    for i in range(q, n):
        v = (first if i == q else d[i]) / half
        if v != 0.0:
            for c in range(n):
                JT[i, c] -= v * w[c]


@numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def drop_column(JT: Any, R: Any, d: Any, q: int, at: int) -> None:
    """Take column ``at`` out of R (q columns); keep R triangular by rotations, of JT and d too."""
    n = JT.shape[0]
    for column in range(at, q - 1):
        for i in range(column + 2):
            R[i, column] = R[i, column + 1]
        a, b = R[column, column], R[column + 1, column]
        h = math.hypot(a, b)
        if b == 0.0:
            continue
        c, s = a / h, b / h
        R[column, column], R[column + 1, column] = h, 0.0
        for j in range(column + 2, q):
            x, y = R[column, j], R[column + 1, j]
            R[column, j], R[column + 1, j] = c * x + s * y, c * y - s * x
        for j in range(n):
            x, y = JT[column, j], JT[column + 1, j]
            JT[column, j], JT[column + 1, j] = c * x + s * y, c * y - s * x
        x, y = d[column], d[column + 1]
        d[column], d[column + 1] = c * x + s * y, c * y - s * x
