"""Sequential quadratic programming for the programme (2.14), compiled.

Each quadratic programme has the torques' step and the greatest violation as unknowns, and always
the same rows, so that the working set of one is a good guess for the next, within a solve and from
tick to tick.
"""

import math
from typing import Any

import numba
import numpy as np

from push_mpc.torque_prediction import ROWS, predict
from push_qp import goldfarb_idnani

SOLVED = goldfarb_idnani.OPTIMAL
WORDS = goldfarb_idnani.WORDS

_DAMPING = 1e-6  # of the Hessian's diagonal: without weights on torques it may be singular
_SHORTEST = 1.0 / 64.0  # step of a line search
_ARMIJO = 1e-4
_ROW_TOLERANCE = 1e-8


@numba.njit(cache=True)
def worst(c: Any, rows: int) -> float:
    """Greatest violation of the first ``rows`` constraints; zero where all hold."""
    most = 0.0
    for i in range(rows):
        # a NaN is the worst that there is
        if not c[i] <= most:
            most = c[i]
    return most


@numba.njit(cache=True)
def minimise(
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
    most: float,
    penalty: float,
    penalty_square: float,
    tolerance: float,
    limit: int,
    price: Any,
    active: Any,
    multiplier: Any,
    guessed: int,
    H: Any,
    g: Any,
    c: Any,
    G: Any,
) -> tuple[int, int, int, float, float]:
    """Improve z ``(n,)`` in place; status, iterations, size of the working set, merit, violation.

    The merit is the cost (2.15) and ``penalty s + penalty_square s^2`` for the greatest violation
    s. The status is that of the last quadratic programme; where it is not ``SOLVED``, z is of no
    use. The solve ends when no torque changes by more than the tolerance [Nm], when no way down is
    found, or after ``limit`` quadratic programmes.

    Parameters
    ----------
    most: [Nm] greatest torque. price ``(N, 2)``: multipliers of the slip rows; in and out. active,
    multiplier ``(n + 1,)``: working set; its first ``guessed`` numbers are tried first.
    H, g, c, G: room for what ``predict`` finds; it explains the other parameters, too.
    """
    n, rows = z.shape[0], G.shape[0]
    counted = ROWS * price.shape[0]
    unknowns = n + 1
    hessian, linear = np.zeros((unknowns, unknowns)), np.zeros(unknowns)
    low, high, answer = np.zeros(unknowns), np.empty(unknowns), np.empty(unknowns)
    outputs, offset = np.eye(unknowns).reshape(1, unknowns, unknowns), np.zeros((1, unknowns))
    width = np.full(1, unknowns, dtype=np.int64)
    normal, bound = np.empty((1, unknowns, rows)), np.empty((1, rows))
    family, equal = np.full(rows, -1, dtype=np.int64), np.zeros(rows, dtype=np.bool_)
    trial = np.empty(n)

    cost = predict(
        z,
        state,
        reference,
        step,
        robot,
        load,
        weight,
        terminal,
        friction,
        share,
        limits,
        price,
        H,
        g,
        c,
        G,
    )
    violation = worst(c, counted)
    value = cost + penalty * violation + penalty_square * violation**2
    size, count = guessed, 0
    while count < limit:
        count += 1
        diagonal = 0.0
        for i in range(n):
            diagonal = max(diagonal, H[i, i])
        for i in range(n):
            for q in range(n):
                hessian[i, q] = H[i, q]
            hessian[i, i] += _DAMPING * max(1.0, diagonal)
            linear[i], low[i], high[i] = g[i], -most - z[i], most - z[i]
        hessian[n, n], linear[n], high[n] = 2.0 * penalty_square, penalty, 1e6
        # a constraint that no step can bring near zero needs no row
        reach = 0.0
        for row in range(rows):
            total = 0.0
            for i in range(n):
                total += abs(G[row, i])
            reach = max(reach, 2.0 * most * total)
        for row in range(rows):
            bound[0, row] = -c[row] if c[row] > -reach else math.inf
            for i in range(n):
                normal[0, i, row] = G[row, i]
            normal[0, n, row] = -1.0
        status, _, size = goldfarb_idnani.solve(
            hessian,
            linear,
            low,
            high,
            outputs,
            offset,
            width,
            normal,
            bound,
            family,
            equal,
            _ROW_TOLERANCE,
            10 * unknowns + rows,
            answer,
            active,
            multiplier,
            size,
        )
        if status != SOLVED:
            return status, count, 0, value, violation
        price[:] = 0.0
        for i in range(size):
            row = active[i] - 2 * unknowns
            if 0 <= row < counted and row % ROWS < 2:
                price[row // ROWS, row % ROWS] = multiplier[i]
        longest, slope, slack = 0.0, 0.0, answer[n]
        for i in range(n):
            longest = max(longest, abs(answer[i]))
            slope += g[i] * answer[i]
        if longest < tolerance:
            break
        slope += penalty * (slack - violation) + penalty_square * (slack**2 - violation**2)
        part = 1.0
        while True:
            for i in range(n):
                trial[i] = z[i] + part * answer[i]
            cost = predict(
                trial,
                state,
                reference,
                step,
                robot,
                load,
                weight,
                terminal,
                friction,
                share,
                limits,
                price,
                H,
                g,
                c,
                G,
            )
            violation = worst(c, counted)
            after = cost + penalty * violation + penalty_square * violation**2
            if after <= value + _ARMIJO * part * min(slope, 0.0) or part < _SHORTEST:
                break
            part *= 0.5
        if not after <= value:  # no way down: as good as it gets
            cost = predict(
                z,
                state,
                reference,
                step,
                robot,
                load,
                weight,
                terminal,
                friction,
                share,
                limits,
                price,
                H,
                g,
                c,
                G,
            )
            violation = worst(c, counted)
            break
        z[:] = trial
        value = after
    return SOLVED, count, size, value, violation
