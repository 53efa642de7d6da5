"""Prediction of a torque-driven robot over a horizon, (2.16)-(2.19) and (2.31)-(2.33), with slopes.

Single shooting: the states are functions of the torques z = (right_0, left_0, right_1, ..), and
their slopes are carried along. Everything that the nonlinear programme (2.14) needs is found in one
pass: cost, gradient, Gauss-Newton Hessian, constraints c(z) <= 0 and their Jacobian.
"""

import math
from typing import Any

import numba
import numpy as np

ROWS = 13
"""Constraints of a step: slip right, left; loads right, left, caster; wheel speeds; position."""
NEWTON = 0.1
"""[1/N] of the rows that are forces, so that all violations are of like size."""
CUTS = 16
"""Further rows of a step: tractions in eight directions, right and left. They never ask for more
than the slip rows, and keep a linearised step from running off where a traction is zero."""
_DIRECTIONS = np.array(
    [[math.cos(0.25 * math.pi * i), math.sin(0.25 * math.pi * i)] for i in range(CUTS // 2)]
)
_SMOOTH = 0.1  # [N] at which the norm of a traction is rounded off


@numba.njit(cache=True, fastmath=True)
def predict(
    z: Any,
    state: Any,
    reference: Any,
    step: float,
    robot: Any,
    load: Any,
    weight: Any,
    terminal: Any,
    friction: float,
    share: float,
    limits: Any,
    price: Any,
    H: Any,
    g: Any,
    c: Any,
    G: Any,
) -> float:
    """Fill in H ``(n, n)``, g ``(n,)``, c ``(29 N,)``, G ``(29 N, n)``; returns the cost (2.15).

    The first 13 N rows are the constraints, the others cuts.

    Parameters
    ----------
    z: ``(2 M,)`` [Nm]. state: ``(5,)`` x, y, theta, v, omega. reference: ``(N + 1, 5)``, its
    headings continuous and of the turn that the state's is in.
    robot: the fields of ``TorqueRobot`` in their order, and g. weight, terminal: ``(5,)``.
    load: ``(2,)`` [N], [Nm], as of ``TorqueRobot``: what the robot meets, over the whole horizon.
    price: ``(N, 2)`` multipliers of the slip rows, whose curvature H takes in, too: without it a
    step along an active slip row is far too long. friction: mu; no slip rows where it is not
    positive. share: of the sideways traction that either wheel bears. limits: [m], [m], [rad/s].
    """
    n, steps = z.shape[0], reference.shape[0] - 1
    r, lever, body, wheel, ahead, height, turning, rolling, caster, met, gravity = robot
    drag, moment = load
    mass = body + 2.0 * wheel
    along_mass = mass + 2.0 * rolling / r**2
    about = turning + 2.0 * lever**2 / r**2 * rolling
    lag = body * ahead
    roll = 2.0 * (wheel * r + rolling / r)
    x, y, theta, v, omega = state
    dx, dy, dt, dv, do = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    da, de, e, bend = np.zeros(n), np.zeros(n), np.zeros((5, n)), np.zeros((2, n))
    value = np.zeros(5)
    H[:] = 0.0
    g[:] = 0.0
    cost = 0.0
    for k in range(steps):
        j = 2 * min(k, n // 2 - 1)
        right, left = z[j], z[j + 1]
        a = ((right + left) / r + lag * omega * omega - drag) / along_mass
        eps = (lever / r * (right - left) - lag * v * omega + moment) / about
        for i in range(n):
            ir, il = (1.0 if i == j else 0.0), (1.0 if i == j + 1 else 0.0)
            da[i] = ((ir + il) / r + 2.0 * lag * omega * do[i]) / along_mass
            de[i] = (lever / r * (ir - il) - lag * (v * do[i] + omega * dv[i])) / about
        spin = rolling / r
        f_right = (right - spin * (a + lever * eps)) / r
        f_left = (left - spin * (a - lever * eps)) / r
        aside = share * (mass * v * omega + lag * eps)
        held = body * (ahead * gravity - height * (a - ahead * omega * omega)) - roll * a
        held -= met * drag
        n_caster = held / caster
        tilt = body * height * (v * omega + ahead * eps) + 2.0 * wheel * r * v * omega
        both, apart = mass * gravity - n_caster, tilt / lever
        n_right, n_left = 0.5 * (both + apart), 0.5 * (both - apart)
        t_right = math.sqrt(f_right * f_right + aside * aside + _SMOOTH * _SMOOTH)
        t_left = math.sqrt(f_left * f_left + aside * aside + _SMOOTH * _SMOOTH)
        row = ROWS * k
        slip = friction > 0.0
        c[row] = NEWTON * (t_right - friction * n_right) if slip else -1.0
        c[row + 1] = NEWTON * (t_left - friction * n_left) if slip else -1.0
        c[row + 2] = -NEWTON * n_right if slip else -1.0
        c[row + 3] = -NEWTON * n_left if slip else -1.0
        c[row + 4] = -NEWTON * n_caster if slip else -1.0
        cut = ROWS * steps + CUTS * k
        half = CUTS // 2
        for m in range(half):
            u, w = _DIRECTIONS[m]
            if slip:
                c[cut + m] = NEWTON * (u * f_right + w * aside - friction * n_right)
                c[cut + half + m] = NEWTON * (u * f_left + w * aside - friction * n_left)
            else:
                c[cut + m] = c[cut + half + m] = -1.0
        for i in range(n):
            ir, il = (1.0 if i == j else 0.0), (1.0 if i == j + 1 else 0.0)
            df_right = (ir - spin * (da[i] + lever * de[i])) / r
            df_left = (il - spin * (da[i] - lever * de[i])) / r
            vo = v * do[i] + omega * dv[i]
            d_aside = share * (mass * vo + lag * de[i])
            d_held = -body * height * (da[i] - 2.0 * ahead * omega * do[i]) - roll * da[i]
            d_caster = d_held / caster
            d_tilt = body * height * (vo + ahead * de[i]) + 2.0 * wheel * r * vo
            dn_right = 0.5 * (-d_caster + d_tilt / lever)
            dn_left = 0.5 * (-d_caster - d_tilt / lever)
            if slip:
                bend[0, i] = (f_right * d_aside - aside * df_right) / t_right
                bend[1, i] = (f_left * d_aside - aside * df_left) / t_left
                pulled = (f_right * df_right + aside * d_aside) / t_right
                G[row, i] = NEWTON * (pulled - friction * dn_right)
                pulled = (f_left * df_left + aside * d_aside) / t_left
                G[row + 1, i] = NEWTON * (pulled - friction * dn_left)
                G[row + 2, i] = -NEWTON * dn_right
                G[row + 3, i] = -NEWTON * dn_left
                G[row + 4, i] = -NEWTON * d_caster
                for m in range(half):
                    u, w = _DIRECTIONS[m]
                    G[cut + m, i] = NEWTON * (u * df_right + w * d_aside - friction * dn_right)
                    G[cut + half + m, i] = NEWTON * (u * df_left + w * d_aside - friction * dn_left)
            else:
                for m in range(CUTS):
                    G[cut + m, i] = 0.0
                for m in range(5):
                    G[row + m, i] = 0.0
        if slip:
            for m in range(2):
                w = NEWTON * price[k, m] / (t_right if m == 0 else t_left)
                if w > 0.0:
                    for i in range(n):
                        for q in range(i + 1):
                            H[i, q] += w * bend[m, i] * bend[m, q]
        # Euler's step, (2.18)
        co, si = math.cos(theta), math.sin(theta)
        for i in range(n):
            dx[i] += step * (co * dv[i] - si * v * dt[i])
            dy[i] += step * (si * dv[i] + co * v * dt[i])
            dt[i] += step * do[i]
            dv[i] += step * da[i]
            do[i] += step * de[i]
        x += step * co * v
        y += step * si * v
        theta += step * omega
        v += step * a
        omega += step * eps
        row += 5
        for m in range(4):
            sign = 1.0 if m < 2 else -1.0
            side = 1.0 if m % 2 == 0 else -1.0
            c[row + m] = sign * (v + side * lever * omega) / r - limits[2]
            for i in range(n):
                G[row + m, i] = sign * (dv[i] + side * lever * do[i]) / r
        c[row + 4], c[row + 5] = x - limits[0], -x - limits[0]
        c[row + 6], c[row + 7] = y - limits[1], -y - limits[1]
        for i in range(n):
            G[row + 4, i], G[row + 5, i] = dx[i], -dx[i]
            G[row + 6, i], G[row + 7, i] = dy[i], -dy[i]
        # (2.16)-(2.17)
        co, si = math.cos(theta), math.sin(theta)
        ex, ey = x - reference[k + 1, 0], y - reference[k + 1, 1]
        value[0], value[1] = co * ex + si * ey, -si * ex + co * ey
        value[2] = theta - reference[k + 1, 2]
        value[3], value[4] = v - reference[k + 1, 3], omega - reference[k + 1, 4]
        for i in range(n):
            e[0, i] = co * dx[i] + si * dy[i] + value[1] * dt[i]
            e[1, i] = -si * dx[i] + co * dy[i] - value[0] * dt[i]
            e[2, i], e[3, i], e[4, i] = dt[i], dv[i], do[i]
        for m in range(5):
            w = terminal[m] if k == steps - 1 else weight[m]
            cost += w * value[m] * value[m]
            for i in range(n):
                s = 2.0 * w * e[m, i]
                g[i] += s * value[m]
                for q in range(i + 1):
                    H[i, q] += s * e[m, q]
    for i in range(n):
        for q in range(i):
            H[q, i] = H[i, q]
    return cost
