"""Prediction of the tracking error, (2.35)-(2.38) and (2.43)-(2.49), and its condensed programme,
the quadratic one of (2.50).

The error e = (e_x, e_y, e_theta, e_v, e_omega) is the robot's state in the reference frame, (2.37).
Its dynamics (2.38) are integrated along the previous solution; the deviation from that roll-out is
linear, discretised in closed form: with z = e_x + i e_y the homogeneous part turns z by
exp(-i omega_d t), so the integrals in (2.47)-(2.49) are Stumpff's functions of omega_d T.

The reference may also move sideways at w_d [m/s], as a frame fixed to an off-centre object does.
That adds -w_d to the second row of (2.38).

All constraints are rows on the outputs of a step, y_k = (e_{k+1}, u_k - u_{k-1}) = g_k + S_k u:
normal . y_k <= bound + slack. Nothing wider than an output is written per row.
"""

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from push_model.arrays import Array

SOFTENED = (("wheel speed", "m/s"), ("stable curvature", "rad/s"), ("obstacle", "m"))
"""Families of rows with a slack in common, and its unit."""

SLACKS = len(SOFTENED)

OUTPUTS = 7
"""e_x, e_y, e_theta, e_v, e_omega after the step, and the change of the two inputs before it."""

WHEELS, CHANGES, CURVATURES = 4, 4, 2
"""Rows of a step, in this order; then one for each obstacle."""


@numba.njit(cache=True, fastmath=True)
def _rates(
    e: Any, a: float, eps: float, vd: float, wd: float, od: float, va: float, oa: float, out: Any
) -> None:
    """(2.38)."""
    v = e[3] + vd
    out[0] = math.cos(e[2]) * v - vd + e[1] * od
    out[1] = math.sin(e[2]) * v - e[0] * od - wd
    out[2] = e[4]
    out[3] = a - va
    out[4] = eps - oa


@numba.njit(cache=True, fastmath=True)
def _integrate(
    e: Any,
    a: float,
    eps: float,
    vd0: float,
    vd1: float,
    wd: float,
    od0: float,
    od1: float,
    h: float,
    out: Any,
    k: Any,
    mid: Any,
) -> None:
    """One RK4 step with a reference that changes linearly."""
    va, oa = (vd1 - vd0) / h, (od1 - od0) / h
    vm, om = 0.5 * (vd0 + vd1), 0.5 * (od0 + od1)
    _rates(e, a, eps, vd0, wd, od0, va, oa, k[0])
    for i in range(5):
        mid[i] = e[i] + 0.5 * h * k[0, i]
    _rates(mid, a, eps, vm, wd, om, va, oa, k[1])
    for i in range(5):
        mid[i] = e[i] + 0.5 * h * k[1, i]
    _rates(mid, a, eps, vm, wd, om, va, oa, k[2])
    for i in range(5):
        mid[i] = e[i] + h * k[2, i]
    _rates(mid, a, eps, vd1, wd, od1, va, oa, k[3])
    for i in range(5):
        out[i] = e[i] + h / 6.0 * (k[0, i] + 2.0 * k[1, i] + 2.0 * k[2, i] + k[3, i])


@numba.njit(cache=True, fastmath=True)
def discretise(theta: float, v: float, od: float, h: float, A: Any, B: Any) -> None:
    """(2.47)-(2.48) in closed form, at heading error theta and speed v = e_v + v_d.

    A ``(5, 5)`` and B ``(5, 2)`` are filled in. Valid for |od h| < pi.
    """
    A[:] = 0.0
    B[:] = 0.0
    # Stumpff's c_k = sum_n (-x)^n / (2n + k)! of x = (od h)^2; the higher two by Horner's rule
    phi = od * h
    x = phi * phi
    c3, c4 = 1.0, 1.0
    for n in range(9, 0, -1):
        c3 = 1.0 - x * c3 / ((2.0 * n + 2.0) * (2.0 * n + 3.0))
        c4 = 1.0 - x * c4 / ((2.0 * n + 3.0) * (2.0 * n + 4.0))
    c3 /= 6.0
    c4 /= 24.0
    c1, c2 = 1.0 - x * c3, 0.5 - x * c4
    # iterated integrals of exp(-i od t) over the step
    s1r, s1i = h * c1, -h * phi * c2
    s2r, s2i = h * h * c2, -h * h * phi * c3
    s3r, s3i = h * h * h * c3, -h * h * h * phi * c4
    c, s = math.cos(theta), math.sin(theta)
    tr, ti = -s * v, c * v  # how a turn moves z
    A[0, 0] = A[1, 1] = 1.0 - x * c2
    A[0, 1] = phi * c1
    A[1, 0] = -phi * c1
    A[0, 2], A[1, 2] = s1r * tr - s1i * ti, s1r * ti + s1i * tr
    A[0, 3], A[1, 3] = s1r * c - s1i * s, s1r * s + s1i * c
    A[0, 4], A[1, 4] = s2r * tr - s2i * ti, s2r * ti + s2i * tr
    A[2, 2] = A[3, 3] = A[4, 4] = 1.0
    A[2, 4] = h
    B[0, 0], B[1, 0] = s2r * c - s2i * s, s2r * s + s2i * c
    B[0, 1], B[1, 1] = s3r * tr - s3i * ti, s3r * ti + s3i * tr
    B[2, 1] = 0.5 * h * h
    B[3, 0] = h
    B[4, 1] = h


@numba.njit(cache=True, fastmath=True)
def condense(
    e0: Any,
    nominal: Any,
    previous: Any,
    ref: Any,
    h: float,
    Q: Any,
    P: Any,
    R: Any,
    Rd: Any,
    forward: bool,
    wanted: Any,
    H: Any,
    f: Any,
    S: Any,
    g: Any,
    rollout: Any,
) -> None:
    """Cost (2.52) as 1/2 z'Hz + f'z with z = (u_0 .. u_{p-1}, slacks), and the outputs.

    The Hessian comes from the adjoint of the recursion, in O(p^2) products of blocks.

    Parameters
    ----------
    e0: ``(5,)`` error now. nominal: ``(p, 2)`` inputs to linearise about. previous: ``(2,)`` input
    before. ref: ``(p + 1, 3)`` v_d, w_d, omega_d. Q, P: ``(5,)``; R, Rd: ``(2,)`` diagonals.
    forward: whether R and Rd weigh the inputs less the accelerations of the reference, so that
    following it costs nothing; otherwise the inputs, as printed. wanted: ``(2,)`` acceleration of
    the reference at the previous input.

    Filled in: the part of H ``(n, n)`` and f ``(n,)`` that belongs to the inputs; the state part of
    S ``(p, 7, 2p)`` and of g ``(p, 7)`` such that e_{k+1} = g_k + S_k u, and the part of g that the
    previous input moves; rollout ``(p + 1, 5)``. S is zero where it is not filled in.
    """
    p = nominal.shape[0]
    A, B = np.empty((p, 5, 5)), np.empty((p, 5, 2))
    work, mid = np.empty((4, 5)), np.empty(5)
    rollout[0] = e0
    for k in range(p):
        _integrate(
            rollout[k],
            nominal[k, 0],
            nominal[k, 1],
            ref[k, 0],
            ref[k + 1, 0],
            0.5 * (ref[k, 1] + ref[k + 1, 1]),
            ref[k, 2],
            ref[k + 1, 2],
            h,
            rollout[k + 1],
            work,
            mid,
        )
        theta = 0.5 * (rollout[k, 2] + rollout[k + 1, 2])
        v = 0.5 * (rollout[k, 3] + rollout[k + 1, 3] + ref[k, 0] + ref[k + 1, 0])
        discretise(theta, v, 0.5 * (ref[k, 2] + ref[k + 1, 2]), h, A[k], B[k])
        for i in range(5):
            # affine part: the roll-out itself satisfies the recursion
            acc = rollout[k + 1, i] - B[k, i, 0] * nominal[k, 0] - B[k, i, 1] * nominal[k, 1]
            for c in range(2 * k):
                S[k, i, c] = 0.0
            if k > 0:
                for j in range(5):
                    a = A[k, i, j]
                    if a != 0.0:
                        acc += a * (g[k - 1, j] - rollout[k, j])
                        for c in range(2 * k):
                            S[k, i, c] += a * S[k - 1, j, c]
            g[k, i] = acc
            S[k, i, 2 * k] = B[k, i, 0]
            S[k, i, 2 * k + 1] = B[k, i, 1]
    # W_k = 2 Q S_k + A_{k+1}' W_{k+1}, and the same for g: H_k = B_k' W_k
    W, before = np.zeros((5, 2 * p)), np.zeros((5, 2 * p))
    w, w_before = np.zeros(5), np.zeros(5)
    for k in range(p - 1, -1, -1):
        columns = 2 * k + 2
        for j in range(5):
            weight = 2.0 * (P[j] if k == p - 1 else Q[j])
            w[j] = weight * g[k, j]
            for c in range(columns):
                W[j, c] = weight * S[k, j, c]
            if k < p - 1:
                for i in range(5):
                    a = A[k + 1, i, j]
                    if a != 0.0:
                        w[j] += a * w_before[i]
                        for c in range(columns):
                            W[j, c] += a * before[i, c]
        for i in range(2):
            row = 2 * k + i
            f[row] = 0.0
            for c in range(columns):
                H[row, c] = 0.0
            for j in range(5):
                b = B[k, j, i]
                if b != 0.0:
                    f[row] += b * w[j]
                    for c in range(columns):
                        H[row, c] += b * W[j, c]
        W, before = before, W
        w, w_before = w_before, w
    for k in range(p):
        for i in range(2):
            c = 2 * k + i
            H[c, c] += 2.0 * R[i] + 2.0 * Rd[i]
            if k > 0:
                H[c - 2, c - 2] += 2.0 * Rd[i]
                H[c, c - 2] -= 2.0 * Rd[i]
            else:
                f[c] -= 2.0 * Rd[i] * previous[i]
                g[0, 5 + i] = -previous[i]
            if forward:
                j = 2 * i  # of v_d, omega_d
                now = (ref[k + 1, j] - ref[k, j]) / h
                change = now - (wanted[i] if k == 0 else (ref[k, j] - ref[k - 1, j]) / h)
                f[c] -= 2.0 * R[i] * now + 2.0 * Rd[i] * change
                if k > 0:
                    f[c - 2] += 2.0 * Rd[i] * change
    for c in range(2 * p):
        for d in range(c):
            H[d, c] = H[c, d]


def constant_rows(
    p: int, obstacles: int, half_track: float, change: Array
) -> tuple[Array, Array, NDArray[np.int64]]:
    """The constant parts of the rows: normal ``(p, 7, r)``, bound ``(p, r)``, family ``(r,)``.

    Wheel speeds (2.50c), changes of the input (2.50b) no greater than change ``(2,)``, curvature
    (2.55)-(2.57), obstacles (2.58)-(2.62). Bounds and normals that depend on the tick are left to
    ``tick_rows``.
    family: index of the slack of the row, -1 for none.
    """
    first = WHEELS + CHANGES + CURVATURES
    normal = np.zeros((p, OUTPUTS, first + obstacles))
    bound = np.full((p, first + obstacles), np.inf)
    for j, (forward, turn) in enumerate([(1, 1), (1, -1), (-1, 1), (-1, -1)]):
        normal[:, 3, j], normal[:, 4, j] = forward, turn * half_track
    for i in range(2):
        for sign in (0, 1):
            j = WHEELS + 2 * i + sign
            normal[:, 5 + i, j] = 1 - 2 * sign
            bound[:, j] = change[i]
    family = np.array(
        [0] * WHEELS + [-1] * CHANGES + [1] * CURVATURES + [2] * obstacles, dtype=np.int64
    )
    return normal, bound, family


@numba.njit(cache=True, fastmath=True)
def tick_rows(
    ref: Any,
    rollout: Any,
    poses: Any,
    half_track: float,
    max_speed: float,
    push: bool,
    low: float,
    high: float,
    circles: Any,
    normal: Any,
    bound: Any,
) -> None:
    """Rows of this tick, into normal and bound of ``constant_rows``.

    Curvature: low v <= omega <= high v, (2.55)-(2.56). Obstacles: the half-plane of (2.60) through
    the nearest point (2.59) of each circle, so that its distance (2.58) is kept.

    In a push, v >= 0 replaces the backward wheel limits. Unused rows get the bound inf.

    poses: ``(p + 1, 3)`` of the reference; circles: ``(m, 3)`` x, y, least distance of the robot.
    """
    first = WHEELS + CHANGES
    for k in range(bound.shape[0]):
        v, omega = ref[k + 1, 0], ref[k + 1, 2]
        turn = half_track * omega
        bound[k, 0] = max_speed - v - turn
        bound[k, 1] = max_speed - v + turn
        normal[k, 4, 2] = 0.0 if push else half_track
        bound[k, 2] = v if push else max_speed + v - turn
        bound[k, 3] = math.inf if push else max_speed + v + turn
        normal[k, 4, first], normal[k, 3, first] = 1.0, -high
        normal[k, 4, first + 1], normal[k, 3, first + 1] = -1.0, low
        bound[k, first] = high * v - omega if push else math.inf
        bound[k, first + 1] = omega - low * v if push else math.inf
        x, y, theta = poses[k + 1, 0], poses[k + 1, 1], poses[k + 1, 2]
        ct, st = math.cos(theta), math.sin(theta)
        px = x + ct * rollout[k + 1, 0] - st * rollout[k + 1, 1]
        py = y + st * rollout[k + 1, 0] + ct * rollout[k + 1, 1]
        for m in range(circles.shape[0]):
            j = first + CURVATURES + m
            nx, ny = circles[m, 0] - px, circles[m, 1] - py
            gap = math.hypot(nx, ny)
            if gap < 1e-6:
                nx, ny, gap = 1.0, 0.0, 1.0
            nx /= gap
            ny /= gap
            # unit normal towards the obstacle, in the reference frame
            normal[k, 0, j] = ct * nx + st * ny
            normal[k, 1, j] = -st * nx + ct * ny
            bound[k, j] = nx * (circles[m, 0] - x) + ny * (circles[m, 1] - y) - circles[m, 2]
        for j in range(first + CURVATURES + circles.shape[0], bound.shape[1]):
            bound[k, j] = math.inf
