"""Dual active-set method for strictly convex quadratic programmes (Goldfarb and Idnani, 1983).

Compiled, and specialised for a condensed MPC. A row is a combination of the outputs of one step, so
all rows are checked through the outputs, and only rows that enter the working set are written out.
Equalities come first and are never dropped. A solve starts from the working set of the previous
tick. After that the dual steepest edge rule chooses the constraint to add: the one with the largest
violation in the metric of H on the free subspace. That takes about as many iterations as there are
active rows at the optimum.

    D. Goldfarb and A. Idnani, A numerically stable dual method for solving strictly convex
    quadratic programs, Mathematical Programming 27, 1-33, 1983.
"""

import math
from typing import Any

import numba
import numpy as np

from push_qp.factors import add_column, dot, drop_column, inverse_factor
from push_qp.rows import outputs, rooms, write_row

OPTIMAL = 0
INFEASIBLE = 1
TOO_MANY_ITERATIONS = 2
NOT_CONVEX = 3
NOT_FINITE = 4
INACCURATE = 5
WORDS = (
    "optimal",
    "infeasible",
    "too many iterations",
    "not convex",
    "not finite",
    "equalities not met",
)
DEPENDENT = 1e-20
"""Square of the sine, in the metric of H, of the angle below which a row depends on others."""


@numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def _rooms_of(
    z: Any,
    S: Any,
    g: Any,
    width: Any,
    normal: Any,
    bound: Any,
    family: Any,
    y: Any,
    slack: Any,
    room: Any,
) -> None:
    """Room of each row at z; with g and bound zero, the change of the room along z."""
    outputs(S, g, width, z, y)
    for j in range(family.shape[0]):
        slack[j] = z[S.shape[2] + family[j]] if family[j] >= 0 else 0.0
    rooms(normal, bound, y, slack, room)


@numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def _weigh(sign: float, v: Any, change: Any, box_weight: Any, row_weight: Any) -> None:
    """Add sign (n'v)^2 to the weight of each constraint n; change ``(K, r)``: their -n'v."""
    for c in range(v.shape[0]):
        box_weight[c] += sign * v[c] * v[c]
    for k in range(change.shape[0]):
        for j in range(change.shape[1]):
            row_weight[k, j] += sign * change[k, j] * change[k, j]


@numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def _select(
    z: Any,
    low: Any,
    high: Any,
    room: Any,
    tolerance: float,
    box_weight: Any,
    row_weight: Any,
    floor: float,
    equal: Any,
) -> int:
    """Number of the inequality with the greatest violation^2 / weight.

    -1: none is violated; -2: a value is not finite.
    """
    n, per_step = z.shape[0], room.shape[1]
    chosen, best = -1, 0.0
    for i in range(n):
        over = max(low[i] - z[i], z[i] - high[i])
        if over > tolerance and over * over > best * max(box_weight[i], floor):
            best = over * over / max(box_weight[i], floor)
            chosen = i if low[i] > z[i] else n + i
        if math.isnan(over):
            return -2
    for k in range(room.shape[0]):
        for j in range(per_step):
            over = -room[k, j]
            if over > tolerance and over * over > best * max(row_weight[k, j], floor):
                if equal[j]:  # they are in the working set
                    continue
                best = over * over / max(row_weight[k, j], floor)
                chosen = 2 * n + k * per_step + j
            if math.isnan(over):
                return -2
    return chosen


@numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def _equalities_hold(room: Any, bound: Any, equal: Any, tolerance: float) -> bool:
    for j in range(equal.shape[0]):
        if equal[j]:
            for k in range(room.shape[0]):
                if bound[k, j] != math.inf and not abs(room[k, j]) <= tolerance:
                    return False
    return True


@numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def _add_equalities(
    S: Any,
    g: Any,
    width: Any,
    normal: Any,
    bound: Any,
    family: Any,
    equal: Any,
    tolerance: float,
    JT: Any,
    R: Any,
    d: Any,
    r: Any,
    step: Any,
    row: Any,
    z: Any,
    active: Any,
    multiplier: Any,
) -> tuple[int, int]:
    """Onto the equalities, one after the other; returns status and how many there are.

    One that depends on earlier ones is skipped if it is consistent with them.
    """
    n, q = z.shape[0], 0
    for k in range(bound.shape[0]):
        for j in range(bound.shape[1]):
            if not equal[j] or bound[k, j] == math.inf:
                continue
            violation = -write_row(S, g, width, normal, bound, family, k, j, row)
            violation += dot(row, z)
            if not math.isfinite(violation):
                return NOT_FINITE, q
            for i in range(n):
                d[i] = -dot(JT[i], row)
            fixed, free = dot(d[:q], d[:q]), dot(d[q:], d[q:])
            if free <= DEPENDENT * (free + fixed):
                if abs(violation) > tolerance:
                    return INFEASIBLE, q
                continue
            length = violation / free  # of either sign, as the multiplier of an equality
            for i in range(q - 1, -1, -1):
                r[i] = (d[i] - dot(R[i, i + 1 : q], r[i + 1 : q])) / R[i, i]
            for i in range(q):
                multiplier[i] -= length * r[i]
            add_column(JT, R, d, q, math.sqrt(free), step)
            for c in range(n):
                z[c] += length * R[q, q] * JT[q, c]
            active[q] = 2 * n + k * bound.shape[1] + j
            multiplier[q] = length
            q += 1
    return OPTIMAL, q


@numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def solve(
    H: Any,
    f: Any,
    low: Any,
    high: Any,
    S: Any,
    g: Any,
    width: Any,
    normal: Any,
    bound: Any,
    family: Any,
    equal: Any,
    tolerance: float,
    limit: int,
    z: Any,
    active: Any,
    multiplier: Any,
    guessed: int,
) -> tuple[int, int, int]:
    """Solve; returns status, iterations and the size of the final working set.

    Parameters
    ----------
    H ``(n, n)``, f, low, high ``(n,)``: z = (u, slacks), u of length S.shape[2].
    S ``(K, o, nu)``, g ``(K, o)``, width ``(K,)``: see outputs.
    normal ``(K, o, r)``, bound ``(K, r)``, family ``(r,)``: rows normal . y - slack <= bound; the
    slack of a row is z[nu + family], none where family < 0. A bound of inf switches a row off.
    equal ``(r,)`` bool: those rows hold with equality, and have no slack.
    tolerance: of a row, in its own unit. limit: of iterations.
    active ``(n,)`` int: in, ``guessed`` constraints to try first; out, the working set. Numbers:
    i: z_i >= low_i; n + i: z_i <= high_i; 2n + k r + j: row j of step k.

    Filled in: z ``(n,)``, multiplier ``(n,)`` of the working set.
    """
    n = H.shape[0]
    L, JT, R = np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    d, r, step, row = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    y, slack = np.empty(g.shape), np.empty(bound.shape[1])
    room, change = np.empty(bound.shape), np.empty(bound.shape)
    zero_g, zero_bound = np.zeros(g.shape), np.zeros(bound.shape)
    box_weight, row_weight, floor = np.zeros(n), np.zeros(bound.shape), 1.0
    if not inverse_factor(H, L, JT):
        return NOT_CONVEX, 0, 0
    for i in range(n):  # z = -J J' f
        total = 0.0
        for c in range(i + 1):
            total += JT[i, c] * f[c]
        d[i] = total
    z[:] = 0.0
    for i in range(n):
        for c in range(i + 1):
            z[c] -= JT[i, c] * d[i]
    guess = active[:guessed].copy()
    tried, iterations, q = 0, 0, 0
    if equal.any():
        status, q = _add_equalities(
            S,
            g,
            width,
            normal,
            bound,
            family,
            equal,
            tolerance,
            JT,
            R,
            d,
            r,
            step,
            row,
            z,
            active,
            multiplier,
        )
        if status != OPTIMAL:
            return status, iterations, q
    equalities = q  # first in the working set, never dropped
    weighed = False  # weights are updated from the first constraint on that was not guessed
    exact = False  # whether room is computed from z, not updated incrementally
    stale = True  # whether room is outdated
    while True:
        # 1. a violated constraint: first those guessed, then the steepest
        chosen = -1
        while chosen < 0 and tried < guessed:
            candidate = guess[tried]
            tried += 1
            if not _contains(active, q, candidate) and not _is_equality(candidate, n, equal):
                right = _normal_form(
                    candidate, n, low, high, S, g, width, normal, bound, family, row
                )
                if dot(row, z) - right > tolerance:
                    chosen = candidate
        while chosen < 0:
            if stale:
                _rooms_of(z, S, g, width, normal, bound, family, y, slack, room)
                stale, exact = False, True
            chosen = _select(z, low, high, room, tolerance, box_weight, row_weight, floor, equal)
            if chosen == -2:
                return NOT_FINITE, iterations, q
            if chosen < 0 and exact:
                good = _equalities_hold(room, bound, equal, tolerance)
                return OPTIMAL if good else INACCURATE, iterations, q
            if chosen < 0:
                stale = True
            elif not weighed:
                for i in range(q, n):
                    _rooms_of(JT[i], S, zero_g, width, normal, zero_bound, family, y, slack, change)
                    _weigh(1.0, JT[i], change, box_weight, row_weight)
                floor = 1e-10 * box_weight.max()
                if floor == 0.0:  # the guess filled the space: no free direction is left
                    for c in range(n):
                        floor = max(floor, 1e-10 * dot(JT[:, c], JT[:, c]))
                weighed, chosen = True, -1
        right = _normal_form(chosen, n, low, high, S, g, width, normal, bound, family, row)
        violation = dot(row, z) - right
        if violation <= tolerance and not exact:  # it seemed violated: room has gathered errors
            stale = True
            continue
        # 2. towards it, dropping constraints whose multipliers would turn negative
        for i in range(n):
            d[i] = -dot(JT[i], row)
        added = 0.0
        while True:
            iterations += 1
            if iterations > limit:
                return TOO_MANY_ITERATIONS, iterations, q
            fixed, free = dot(d[:q], d[:q]), dot(d[q:], d[q:])
            for i in range(q - 1, -1, -1):
                r[i] = (d[i] - dot(R[i, i + 1 : q], r[i + 1 : q])) / R[i, i]
            dual, blocking = math.inf, -1
            for i in range(equalities, q):
                if r[i] > 0.0 and multiplier[i] < dual * r[i]:
                    dual, blocking = multiplier[i] / r[i], i
            dependent = free <= DEPENDENT * (free + fixed)
            if dependent and blocking < 0:
                return INFEASIBLE, iterations, q
            whole = not dependent and violation <= dual * free
            length = violation / free if whole else dual
            added += length
            for i in range(q):
                multiplier[i] -= length * r[i]
            if whole:
                add_column(JT, R, d, q, math.sqrt(free), step)
                # the row of JT that was turned into the new one is the direction of the step
                move = length * R[q, q]
                for c in range(n):
                    z[c] += move * JT[q, c]
                active[q], multiplier[q] = chosen, added
                if weighed:
                    _rooms_of(JT[q], S, zero_g, width, normal, zero_bound, family, y, slack, change)
                    _weigh(-1.0, JT[q], change, box_weight, row_weight)
                    for k in range(room.shape[0]):
                        for j in range(room.shape[1]):
                            room[k, j] += move * change[k, j]
                    exact = False
                q += 1
                break
            if not dependent:
                for i in range(q, n):
                    for c in range(n):
                        z[c] += length * d[i] * JT[i, c]
                stale = True
                violation = dot(row, z) - right
            drop_column(JT, R, d, q, blocking)
            for i in range(blocking, q - 1):
                active[i], multiplier[i] = active[i + 1], multiplier[i + 1]
            q -= 1
            if weighed:
                _rooms_of(JT[q], S, zero_g, width, normal, zero_bound, family, y, slack, change)
                _weigh(1.0, JT[q], change, box_weight, row_weight)


@numba.njit(cache=True)
def _is_equality(number: int, n: int, equal: Any) -> bool:
    return number >= 2 * n and bool(equal[(number - 2 * n) % equal.shape[0]])


@numba.njit(cache=True)
def _contains(active: Any, count: int, number: int) -> bool:
    for i in range(count):  # noqa: SIM110 - a generator is slow here
        if active[i] == number:
            return True
    return False


@numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def _normal_form(
    number: int,
    n: int,
    low: Any,
    high: Any,
    S: Any,
    g: Any,
    width: Any,
    normal: Any,
    bound: Any,
    family: Any,
    row: Any,
) -> float:
    """The constraint of this number as row . z <= the value returned."""
    if number < 2 * n:
        row[:] = 0.0
        if number < n:
            row[number] = -1.0
            return -float(low[number])
        row[number - n] = 1.0
        return float(high[number - n])
    k, j = divmod(number - 2 * n, bound.shape[1])
    return float(write_row(S, g, width, normal, bound, family, k, j, row))
