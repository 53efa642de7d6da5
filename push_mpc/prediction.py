"""Prediction of the tracking error, (2.35)-(2.49), and its condensed quadratic programme, (2.50).

The error e = (e_x, e_y, e_theta, e_v, e_omega) is the robot's state in the reference frame, (2.37).
Its dynamics (2.38) are integrated along the previous solution; the deviation from that roll-out is
linear, discretised in closed form: with z = e_x + i e_y the homogeneous part turns z by
exp(-i omega_d t), so the integrals in (2.47)-(2.49) are short power series of -i omega_d T.

The reference may also slide sideways at w_d [m/s] (a frame fixed to a pushed object that sits off
its nominal place does), which adds -w_d to the second row of (2.38).
"""

import math
from typing import Any

import numba

SLACKS = 3
"""Softened families: wheel speeds, curvature, obstacles."""


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

    A ``(5, 5)`` and B ``(5, 2)`` are filled in.
    """
    A[:] = 0.0
    B[:] = 0.0
    # S_k = sum_n (-i od)^n h^(n+k) / (n+k)!
    m = complex(0.0, -od) * h
    turn = complex(math.cos(od * h), -math.sin(od * h))
    s1 = complex(0.0, 0.0)
    s2 = complex(0.0, 0.0)
    s3 = complex(0.0, 0.0)
    power = complex(1.0, 0.0)
    factorial = 1.0
    for n in range(14):
        f1 = factorial * (n + 1)
        f2 = f1 * (n + 2)
        s1 += power / f1
        s2 += power / f2
        s3 += power / (f2 * (n + 3))
        power *= m
        factorial *= n + 1
    s1 *= h
    s2 *= h * h
    s3 *= h * h * h
    c, s = math.cos(theta), math.sin(theta)
    by_theta = complex(-s * v, c * v)
    by_v = complex(c, s)
    A[0, 0] = turn.real
    A[0, 1] = -turn.imag
    A[1, 0] = turn.imag
    A[1, 1] = turn.real
    z = s1 * by_theta
    A[0, 2] = z.real
    A[1, 2] = z.imag
    z = s1 * by_v
    A[0, 3] = z.real
    A[1, 3] = z.imag
    z = s2 * by_theta
    A[0, 4] = z.real
    A[1, 4] = z.imag
    A[2, 2] = A[3, 3] = A[4, 4] = 1.0
    A[2, 4] = h
    z = s2 * by_v
    B[0, 0] = z.real
    B[1, 0] = z.imag
    z = s3 * by_theta
    B[0, 1] = z.real
    B[1, 1] = z.imag
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
    slack_linear: float,
    slack_quadratic: float,
    H: Any,
    f: Any,
    S: Any,
    g: Any,
    rollout: Any,
) -> None:
    """Cost (2.52) as 1/2 z'Hz + f'z with z = (u_0 .. u_{p-1}, slacks).

    Parameters
    ----------
    e0: ``(5,)`` error now. nominal: ``(p, 2)`` inputs to linearise about. previous: ``(2,)`` input
    before. ref: ``(p + 1, 3)`` v_d, w_d, omega_d. Q, P: ``(5,)``; R, Rd: ``(2,)`` diagonals.

    Filled in: H ``(n, n)``, f ``(n,)``, S ``(p, 5, 2p)`` and g ``(p, 5)`` such that
    e_{k+1} = g_k + S_k u, rollout ``(p + 1, 5)``.
    """
    p = nominal.shape[0]
    n = 2 * p
    H[:] = 0.0
    f[:] = 0.0
    S[:] = 0.0
    k4 = rollout.copy()[:4].copy()
    mid = e0.copy()
    A = H[:5, :5].copy()
    B = H[:5, :2].copy()
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
            k4,
            mid,
        )
        theta = 0.5 * (rollout[k, 2] + rollout[k + 1, 2])
        v = 0.5 * (rollout[k, 3] + rollout[k + 1, 3] + ref[k, 0] + ref[k + 1, 0])
        discretise(theta, v, 0.5 * (ref[k, 2] + ref[k + 1, 2]), h, A, B)
        for i in range(5):
            # affine part: the roll-out itself satisfies the recursion
            acc = rollout[k + 1, i] - B[i, 0] * nominal[k, 0] - B[i, 1] * nominal[k, 1]
            for j in range(5):
                before = e0[j] if k == 0 else g[k - 1, j]
                acc += A[i, j] * (before - rollout[k, j])
            g[k, i] = acc
            if k > 0:
                for c in range(2 * k):
                    total = 0.0
                    for j in range(5):
                        total += A[i, j] * S[k - 1, j, c]
                    S[k, i, c] = total
            S[k, i, 2 * k] = B[i, 0]
            S[k, i, 2 * k + 1] = B[i, 1]
        last = k == p - 1
        for i in range(5):
            weight = P[i] if last else Q[i]
            if weight == 0.0:
                continue
            for c in range(2 * k + 2):
                w = weight * S[k, i, c]
                f[c] += 2.0 * w * g[k, i]
                for d in range(c + 1):
                    H[c, d] += 2.0 * w * S[k, i, d]
    for k in range(p):
        for i in range(2):
            c = 2 * k + i
            H[c, c] += 2.0 * R[i] + 2.0 * Rd[i]
            if k > 0:
                H[c - 2, c - 2] += 2.0 * Rd[i]
                H[c, c - 2] -= 2.0 * Rd[i]
            else:
                f[c] -= 2.0 * Rd[i] * previous[i]
    for c in range(n):
        for d in range(c):
            H[d, c] = H[c, d]
    for i in range(SLACKS):
        H[n + i, n + i] = 2.0 * slack_quadratic
        f[n + i] = slack_linear


@numba.njit(cache=True, fastmath=True)
def constraint_rows(
    S: Any,
    g: Any,
    ref: Any,
    rollout: Any,
    poses: Any,
    previous: Any,
    change: Any,
    half_track: float,
    max_speed: float,
    push: bool,
    low: float,
    high: float,
    circles: Any,
    G: Any,
    b: Any,
) -> int:
    """Rows G z <= b (2.50b)-(2.50e); returns how many.

    Families in order: wheel speeds (4 a step; v >= 0 in a push replaces the reverse ones), changes
    of the input (4 a step), curvature (2.57) (2 a step, in a push), obstacles (2.61) (one a step
    and circle). Every family but the input changes has a slack of its own.

    poses: ``(p + 1, 3)`` of the reference; circles: ``(m, 3)`` x, y, least distance of the robot.
    """
    p = g.shape[0]
    n = 2 * p
    row = 0
    for k in range(p):
        end = 2 * k + 2
        for turn in (1.0, -1.0):
            for c in range(end):
                G[row, c] = S[k, 3, c] + turn * half_track * S[k, 4, c]
            b[row] = (
                max_speed
                - (g[k, 3] + ref[k + 1, 0])
                - turn * half_track * (g[k, 4] + ref[k + 1, 2])
            )
            for c in range(end, n):
                G[row, c] = 0.0
            G[row, n] = -1.0
            G[row, n + 1] = 0.0
            G[row, n + 2] = 0.0
            row += 1
            for c in range(end):
                G[row, c] = -S[k, 3, c] + (0.0 if push else turn * half_track * S[k, 4, c])
            b[row] = g[k, 3] + ref[k + 1, 0]
            if not push:
                b[row] += max_speed - turn * half_track * (g[k, 4] + ref[k + 1, 2])
            for c in range(end, n):
                G[row, c] = 0.0
            G[row, n] = -1.0
            G[row, n + 1] = 0.0
            G[row, n + 2] = 0.0
            row += 1
    for k in range(p):
        for i in range(2):
            for sign in (1.0, -1.0):
                for c in range(n + SLACKS):
                    G[row, c] = 0.0
                G[row, 2 * k + i] = sign
                b[row] = change[i]
                if k > 0:
                    G[row, 2 * k - 2 + i] = -sign
                else:
                    b[row] += sign * previous[i]
                row += 1
    if push:
        for k in range(p):
            v, omega = g[k, 3] + ref[k + 1, 0], g[k, 4] + ref[k + 1, 2]
            for sign in (1.0, -1.0):
                kappa = high if sign > 0.0 else low
                for c in range(2 * k + 2):
                    G[row, c] = sign * (S[k, 4, c] - kappa * S[k, 3, c])
                for c in range(2 * k + 2, n + SLACKS):
                    G[row, c] = 0.0
                G[row, n + 1] = -1.0
                b[row] = -sign * (omega - kappa * v)
                row += 1
    for m in range(circles.shape[0]):
        for k in range(p):
            x, y, theta = poses[k + 1, 0], poses[k + 1, 1], poses[k + 1, 2]
            ct, st = math.cos(theta), math.sin(theta)
            px = x + ct * rollout[k + 1, 0] - st * rollout[k + 1, 1]
            py = y + st * rollout[k + 1, 0] + ct * rollout[k + 1, 1]
            nx, ny = circles[m, 0] - px, circles[m, 1] - py
            gap = math.hypot(nx, ny)
            if gap < 1e-6:
                nx, ny, gap = 1.0, 0.0, 1.0
            nx /= gap
            ny /= gap
            # unit normal towards the obstacle, in the reference frame
            ax, ay = ct * nx + st * ny, -st * nx + ct * ny
            for c in range(2 * k + 2):
                G[row, c] = ax * S[k, 0, c] + ay * S[k, 1, c]
            for c in range(2 * k + 2, n + SLACKS):
                G[row, c] = 0.0
            G[row, n + 2] = -1.0
            b[row] = (
                nx * (circles[m, 0] - x)
                + ny * (circles[m, 1] - y)
                - circles[m, 2]
                - ax * g[k, 0]
                - ay * g[k, 1]
            )
            row += 1
    return row


@numba.njit(cache=True, fastmath=True)
def violated(G: Any, b: Any, rows: int, z: Any, tolerance: float, chosen: Any) -> int:
    """Marks the rows with G z > b + tolerance in ``chosen``; returns how many are new."""
    new = 0
    for r in range(rows):
        total = -b[r]
        for c in range(z.shape[0]):
            total += G[r, c] * z[c]
        if total > tolerance and not chosen[r]:
            chosen[r] = True
            new += 1
    return new
