"""What a placement of robots costs on a task: (3.16)-(3.19) with the places held fixed. Compiled.

With the contacts given, the problem in the forces is a linear-quadratic one with u >= 0:

    min  sum_k 1/2 e_k' Q e_k + 1/2 u_k' R u_k,   e_(k+1) = e_k + B_k u_k - d_k,   u_k >= 0,

The motion of the object under contact forces is (3.13), of which each step is one of (3.17).
e being the error of the object's pose, u the lambdas of all friction cones' edges, d the task's
steps. An interior-point method makes a linear-quadratic regulator of each of its iterations: with
D = (R + z/u)^-1 and S = B D B' everything but u is three-dimensional, and a step of the horizon
costs a few hundred operations however many robots there are.
"""

import math
from typing import Any

import numba
import numpy as np

_SHRINK = 0.15  # of the complementarity that an iteration aims at
_BACK = 0.995  # of the way to the nearest bound
_MOST = 60  # iterations


@numba.njit(cache=True, error_model="numpy")
def _solve3(a: Any, b: Any, columns: int) -> None:
    """b := a^-1 b of a 3 x 3 matrix, by elimination with pivots; a is used up."""
    for i in range(3):
        p = i
        for r in range(i + 1, 3):
            if abs(a[r, i]) > abs(a[p, i]):
                p = r
        if p != i:
            for j in range(3):
                a[i, j], a[p, j] = a[p, j], a[i, j]
            for j in range(columns):
                b[i, j], b[p, j] = b[p, j], b[i, j]
        for r in range(i + 1, 3):
            f = a[r, i] / a[i, i]
            for j in range(i, 3):
                a[r, j] -= f * a[i, j]
            for j in range(columns):
                b[r, j] -= f * b[i, j]
    for i in range(2, -1, -1):
        for j in range(columns):
            v = b[i, j]
            for k in range(i + 1, 3):
                v -= a[i, k] * b[k, j]
            b[i, j] = v / a[i, i]


@numba.njit(cache=True, error_model="numpy")
def _regulate(
    columns: Any, turn: Any, steps: Any, q: Any, r: float, u: Any, z: Any, aim: float, new: Any,
    work: Any,
) -> None:  # fmt: skip
    """The forces ``new (N, m)`` that solve the linearised problem about u, z."""
    n, m = u.shape
    gain, shift, slope, lam = work[0], work[1], work[2], work[3]
    P = np.zeros((3, 3))
    p = np.zeros(3)
    a = np.empty((3, 3))
    b = np.empty((3, 4))
    B = np.empty((3, m))
    for i in range(3):
        P[i, i] = q[i]
    for k in range(n - 1, -1, -1):
        c, s = turn[k, 0], turn[k, 1]
        S00 = S01 = S02 = S11 = S12 = S22 = 0.0
        a0 = a1 = a2 = 0.0
        for j in range(m):
            B[0, j] = c * columns[0, j] - s * columns[1, j]
            B[1, j] = s * columns[0, j] + c * columns[1, j]
            B[2, j] = turn[k, 2] * columns[2, j]
            d = 1.0 / (r + z[k, j] / u[k, j])
            g = d * (aim / u[k, j] + z[k, j])
            b0, b1, b2 = B[0, j], B[1, j], B[2, j]
            S00 += d * b0 * b0
            S01 += d * b0 * b1
            S02 += d * b0 * b2
            S11 += d * b1 * b1
            S12 += d * b1 * b2
            S22 += d * b2 * b2
            a0 += b0 * g
            a1 += b1 * g
            a2 += b2 * g
        slope[k, 0], slope[k, 1], slope[k, 2], slope[k, 3] = S00, S01, S02, S11
        slope[k, 4], slope[k, 5] = S12, S22
        y0, y1, y2 = a0 - steps[k, 0], a1 - steps[k, 1], a2 - steps[k, 2]
        shift[k, 0], shift[k, 1], shift[k, 2] = y0, y1, y2
        # (I + P S) X = [P, P y + p]
        for i in range(3):
            a[i, 0] = P[i, 0] * S00 + P[i, 1] * S01 + P[i, 2] * S02
            a[i, 1] = P[i, 0] * S01 + P[i, 1] * S11 + P[i, 2] * S12
            a[i, 2] = P[i, 0] * S02 + P[i, 1] * S12 + P[i, 2] * S22
            a[i, i] += 1.0
            for j in range(3):
                b[i, j] = P[i, j]
            b[i, 3] = P[i, 0] * y0 + P[i, 1] * y1 + P[i, 2] * y2 + p[i]
        _solve3(a, b, 4)
        for i in range(3):
            for j in range(3):
                gain[k, 3 * i + j] = b[i, j]
            lam[k, i] = b[i, 3]
        for i in range(3):
            for j in range(3):
                P[i, j] = 0.5 * (b[i, j] + b[j, i])
            p[i] = b[i, 3]
        for i in range(3):
            P[i, i] += q[i]
    e0 = e1 = e2 = 0.0
    for k in range(n):
        g = gain[k]
        l0 = g[0] * e0 + g[1] * e1 + g[2] * e2 + lam[k, 0]
        l1 = g[3] * e0 + g[4] * e1 + g[5] * e2 + lam[k, 1]
        l2 = g[6] * e0 + g[7] * e1 + g[8] * e2 + lam[k, 2]
        S = slope[k]
        e0 += shift[k, 0] - (S[0] * l0 + S[1] * l1 + S[2] * l2)
        e1 += shift[k, 1] - (S[1] * l0 + S[3] * l1 + S[4] * l2)
        e2 += shift[k, 2] - (S[2] * l0 + S[4] * l1 + S[5] * l2)
        c, s = turn[k, 0], turn[k, 1]
        for j in range(m):
            b0 = c * columns[0, j] - s * columns[1, j]
            b1 = s * columns[0, j] + c * columns[1, j]
            d = 1.0 / (r + z[k, j] / u[k, j])
            pull = aim / u[k, j] + z[k, j] - (b0 * l0 + b1 * l1 + turn[k, 2] * columns[2, j] * l2)
            new[k, j] = d * pull


@numba.njit(cache=True, error_model="numpy")
def tracking_cost(
    columns: Any, turn: Any, steps: Any, q: Any, r: float, size: float, tolerance: float,
    u: Any, z: Any, new: Any, work: Any,
) -> float:  # fmt: skip
    """The least cost of a placement; forces are left in ``u (N, m)``.

    Parameters
    ----------
    columns: ``(3, m)`` motion of the object, in its frame, of a unit of each lambda; a step makes
    so much of it as its pace says. turn: ``(N, 3)`` cosine and sine of the object's heading times
    the pace, and the pace. steps: ``(N, 3)`` the task's steps.
    q: ``(3,)`` weights of the pose's error. r: weight of lambdas. size: of lambdas, roughly.
    tolerance: relative gap to the optimum. z, new ``(N, m)``, work ``(4, N, 9)``: room to work.
    """
    n, m = u.shape
    u[:, :] = size
    z[:, :] = r * size
    before = math.inf
    for _ in range(_MOST):
        gap = 0.0
        for k in range(n):
            for j in range(m):
                gap += u[k, j] * z[k, j]
        aim = _SHRINK * gap / (n * m)
        _regulate(columns, turn, steps, q, r, u, z, aim, new, work)
        primal = dual = 1.0
        for k in range(n):
            for j in range(m):
                du = new[k, j] - u[k, j]
                dz = aim / u[k, j] - z[k, j] - z[k, j] / u[k, j] * du
                if du < 0.0:
                    primal = min(primal, -_BACK * u[k, j] / du)
                if dz < 0.0:
                    dual = min(dual, -_BACK * z[k, j] / dz)
        gap = 0.0
        for k in range(n):
            for j in range(m):
                du = new[k, j] - u[k, j]
                dz = aim / u[k, j] - z[k, j] - z[k, j] / u[k, j] * du
                u[k, j] += primal * du
                z[k, j] += dual * dz
                gap += u[k, j] * z[k, j]
        cost = _cost(columns, turn, steps, q, r, u)
        settled = abs(before - cost) <= 3.0 * tolerance * cost and min(primal, dual) > 0.9
        if settled and gap <= tolerance * cost:
            return float(cost)
        before = cost
    return float(cost)


@numba.njit(cache=True, error_model="numpy")
def _cost(columns: Any, turn: Any, steps: Any, q: Any, r: float, u: Any) -> float:
    n, m = u.shape
    e0 = e1 = e2 = 0.0
    cost = 0.0
    for k in range(n):
        x = y = w = 0.0
        for j in range(m):
            x += columns[0, j] * u[k, j]
            y += columns[1, j] * u[k, j]
            w += columns[2, j] * u[k, j]
            cost += 0.5 * r * u[k, j] * u[k, j]
        c, s = turn[k, 0], turn[k, 1]
        e0 += c * x - s * y - steps[k, 0]
        e1 += s * x + c * y - steps[k, 1]
        e2 += turn[k, 2] * w - steps[k, 2]
        cost += 0.5 * (q[0] * e0 * e0 + q[1] * e1 * e1 + q[2] * e2 * e2)
    return float(cost)


@numba.njit(cache=True, error_model="numpy")
def contact_at(way: float, starts: Any, edges: Any, ways: Any, first: Any, last: Any) -> Any:
    """Point and inward normal so far [m] along an outline; see ContactOutline."""
    total = ways[-1]
    way = way - total * math.floor(way / total)
    low, high = 0, starts.shape[0] - 1
    while low < high:
        middle = (low + high + 1) // 2
        if ways[middle] <= way:
            low = middle
        else:
            high = middle - 1
    part = (way - ways[low]) / (ways[low + 1] - ways[low])
    angle = first[low] + part * (last[low] - first[low])
    x = starts[low, 0] + part * edges[low, 0]
    y = starts[low, 1] + part * edges[low, 1]
    return x, y, math.cos(angle), math.sin(angle)


@numba.njit(cache=True, error_model="numpy")
def cone_columns(contacts: Any, sine: float, cosine: float, scale: Any, columns: Any) -> None:
    """Fill ``columns (3, 2n)``: the motion that a unit along each friction cone's edge makes.

    contacts ``(n, 4)``: point and normal. scale ``(3,)``: motion of a wrench's components.
    """
    for i in range(contacts.shape[0]):
        x, y, nx, ny = contacts[i, 0], contacts[i, 1], contacts[i, 2], contacts[i, 3]
        for side in range(2):
            s = -sine if side == 0 else sine
            fx, fy = cosine * nx - s * ny, s * nx + cosine * ny
            j = 2 * i + side
            columns[0, j], columns[1, j] = scale[0] * fx, scale[1] * fy
            columns[2, j] = scale[2] * (x * fy - y * fx)


@numba.njit(cache=True, error_model="numpy")
def placement_cost(
    way: Any, starts: Any, edges: Any, ways: Any, first: Any, last: Any, sine: float,
    cosine: float, scale: Any, turn: Any, steps: Any, q: Any, r: float, size: float,
    tolerance: float, contacts: Any, columns: Any, u: Any, z: Any, new: Any, work: Any,
) -> float:  # fmt: skip
    """``tracking_cost`` of places ``way (n,)`` [m] along an outline; contacts ``(n, 4)``, columns
    ``(3, 2n)``: room to work."""
    for i in range(way.shape[0]):
        x, y, nx, ny = contact_at(way[i], starts, edges, ways, first, last)
        contacts[i, 0], contacts[i, 1], contacts[i, 2], contacts[i, 3] = x, y, nx, ny
    cone_columns(contacts, sine, cosine, scale, columns)
    return float(tracking_cost(columns, turn, steps, q, r, size, tolerance, u, z, new, work))
