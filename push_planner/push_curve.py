"""The shortest cubic push curve under asymmetric curvature limits, (2.2)-(2.8).

With beta corrected (docs/errata.md) the curve is the cubic whose end tangents are
k_i (cos theta_i, sin theta_i) and k_f (cos theta_f, sin theta_f), k_i and k_f being the unknowns.
The semi-infinite constraint kappa_min <= kappa(s) <= kappa_max is sampled; the answer is re-checked
on a dense sample and tightened where the coarse one missed a peak.
"""

import math
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np

from push_model.arrays import Array

_COARSE, _DENSE = 41, 321
_GRID = 10
_STARTS = 3
_ROUNDS = 100  # of a compass search; few need 40, but one can creep to k = infinity
_DIRECTIONS = 12  # of its steps
_TINY = 1e-12  # [m^3] keeps the curvature at a cusp finite
_SHORTEST = 0.02  # [m] least k_i, k_f; (2.6)


def basis_rows(n: int) -> Array:
    """``(6, n)``: the coefficients of the end point, k_f and k_i in s', then those in s'', at n
    places, with the start at the origin."""
    s = np.linspace(0.0, 1.0, n)
    f1, g1 = 3 * s**2 - 2 * s, (s - 1) ** 2 + 2 * s * (s - 1)
    f2, g2 = 6 * s - 2, 6 * s - 4
    return np.array([3 * s**2 - 3 * f1, f1, g1, 6 * s - 3 * f2, f2, g2])


BASIS_COARSE, BASIS_DENSE = basis_rows(_COARSE), basis_rows(_DENSE)
"""For ``solve_curve``: of the samples that it searches with, and of the final check."""


@numba.njit(cache=True, fastmath=True, error_model="numpy")
def _length(ki: float, kf: float, x: float, y: float, c: float, s: float, basis: Any) -> float:
    """Arc length [m] (2.5)."""
    n = basis.shape[1]
    fx, fy = kf * c, kf * s
    length = 0.0
    for i in range(n):
        dx = basis[0, i] * x + basis[1, i] * fx + basis[2, i] * ki
        dy = basis[0, i] * y + basis[1, i] * fy
        length += math.sqrt(dx * dx + dy * dy)
    return float((length - 0.5 * (ki + kf)) / (n - 1))


@numba.njit(cache=True, fastmath=True, error_model="numpy")
def _holds(
    ki: float,
    kf: float,
    x: float,
    y: float,
    c: float,
    s: float,
    low: float,
    high: float,
    basis: Any,
) -> bool:
    """Whether ``_violation`` is not positive. It counts samples because a compiler vectorises sums,
    but not maxima."""
    fx, fy = kf * c, kf * s
    beyond = 0
    for i in range(basis.shape[1]):
        dx = basis[0, i] * x + basis[1, i] * fx + basis[2, i] * ki
        dy = basis[0, i] * y + basis[1, i] * fy
        ddx = basis[3, i] * x + basis[4, i] * fx + basis[5, i] * ki
        ddy = basis[3, i] * y + basis[4, i] * fy
        q = dx * dx + dy * dy
        bend, cube = dx * ddy - dy * ddx, q * math.sqrt(q) + _TINY
        beyond += (bend > high * cube) | (bend < low * cube)
    return beyond == 0


@numba.njit(cache=True, fastmath=True, error_model="numpy")
def _violation(
    ki: float,
    kf: float,
    x: float,
    y: float,
    c: float,
    s: float,
    low: float,
    high: float,
    basis: Any,
    bends: Any,
) -> float:
    """Worst curvature violation [1/m] (2.7). bends: ``(n,)`` room for the curvatures."""
    fx, fy = kf * c, kf * s
    n = basis.shape[1]
    for i in range(n):
        dx = basis[0, i] * x + basis[1, i] * fx + basis[2, i] * ki
        dy = basis[0, i] * y + basis[1, i] * fy
        ddx = basis[3, i] * x + basis[4, i] * fx + basis[5, i] * ki
        ddy = basis[3, i] * y + basis[4, i] * fy
        q = dx * dx + dy * dy
        bends[i] = (dx * ddy - dy * ddx) / (q * math.sqrt(q) + _TINY)
    most, least = -1e9, 1e9
    for i in range(n):
        most = max(most, bends[i])
        least = min(least, bends[i])
    return max(most - high, low - least)


@numba.njit(cache=True)
def _compass(step: float, factors: Any) -> None:
    """``(n, 2)`` factors of k_i and k_f for steps of one size in n directions, in log(k)."""
    for k in range(len(factors)):
        angle = k * (2.0 * math.pi / len(factors))
        factors[k, 0] = math.exp(step * math.cos(angle))
        factors[k, 1] = math.exp(step * math.sin(angle))


@numba.njit(cache=True, fastmath=True)
def _refine(
    ki: float,
    kf: float,
    best: float,
    step: float,
    x: float,
    y: float,
    c: float,
    s: float,
    low: float,
    high: float,
    basis: Any,
) -> tuple[float, float, float]:
    """Compass search for the shortest feasible curve, in log(k)."""
    factors = np.empty((_DIRECTIONS, 2))
    _compass(step, factors)
    for _ in range(_ROUNDS):
        if step <= 1e-3:
            break
        found = False
        for k in range(_DIRECTIONS):
            mi = max(_SHORTEST, ki * factors[k, 0])
            mf = max(_SHORTEST, kf * factors[k, 1])
            length = _length(mi, mf, x, y, c, s, basis)
            if length < best - 1e-9 and _holds(mi, mf, x, y, c, s, low, high, basis):
                best, ki, kf = length, mi, mf
                found = True
        if not found:
            step *= 0.4
            _compass(step, factors)
    return ki, kf, best


@numba.njit(cache=True, fastmath=True)
def _reduce_violation(
    ki: float,
    kf: float,
    worst: float,
    step: float,
    x: float,
    y: float,
    c: float,
    s: float,
    low: float,
    high: float,
    basis: Any,
) -> tuple[float, float, float]:
    """Compass search for a feasible curve; ends as soon as there is one."""
    factors, bends = np.empty((_DIRECTIONS, 2)), np.empty(basis.shape[1])
    _compass(step, factors)
    for _ in range(_ROUNDS):
        if step <= 1e-3 or worst <= 0.0:
            break
        found = False
        for k in range(_DIRECTIONS):
            mi = max(_SHORTEST, ki * factors[k, 0])
            mf = max(_SHORTEST, kf * factors[k, 1])
            violation = _violation(mi, mf, x, y, c, s, low, high, basis, bends)
            if violation < worst:
                worst, ki, kf = violation, mi, mf
                found = True
        if not found:
            step *= 0.4
            _compass(step, factors)
    return ki, kf, worst


@numba.njit(cache=True)
def _lowest_minimum(values: Any) -> tuple[int, int]:
    """Where the lowest of the local minima is; (-1, -1) when all are infinite."""
    n, m = values.shape
    lowest, at = math.inf, (-1, -1)
    for i in range(n):
        for j in range(m):
            v = values[i, j]
            if v < lowest:
                minimum = True
                for p in range(max(0, i - 1), min(n, i + 2)):
                    for q in range(max(0, j - 1), min(m, j + 2)):
                        if values[p, q] < v:
                            minimum = False
                if minimum:
                    lowest, at = v, (i, j)
    return at


@numba.njit(cache=True, fastmath=True)
def _in_a_valley(
    ratio: float,
    step: float,
    x: float,
    y: float,
    c: float,
    s: float,
    low: float,
    high: float,
    basis: Any,
) -> tuple[float, float, float]:
    """A feasible curve where no point of the grid is: the valley is narrower than a cell. Descends
    from the lowest local minima of the violation. The length is 1e18 if there is none."""
    violations, bends = np.empty((_GRID, _GRID)), np.empty(basis.shape[1])
    mi = _SHORTEST
    for i in range(_GRID):
        mf = _SHORTEST
        for j in range(_GRID):
            violations[i, j] = _violation(mi, mf, x, y, c, s, low, high, basis, bends)
            mf *= ratio
        mi *= ratio
    ki, kf = _SHORTEST, _SHORTEST
    for _ in range(_STARTS):
        i, j = _lowest_minimum(violations)
        if i < 0:
            break
        least = violations[i, j]
        violations[i, j] = math.inf
        ki, kf = _SHORTEST * ratio**i, _SHORTEST * ratio**j
        ki, kf, least = _reduce_violation(ki, kf, least, step, x, y, c, s, low, high, basis)
        if least <= 0.0:
            return ki, kf, _length(ki, kf, x, y, c, s, basis)
    return ki, kf, 1e18


@numba.njit(cache=True, fastmath=True)
def solve_curve(
    x: float, y: float, c: float, s: float, low: float, high: float, coarse: Any, dense: Any
) -> tuple[float, float, float, bool]:
    """k_i, k_f, length and whether the curve is feasible; start at the origin, heading 0."""
    distance = math.hypot(x, y)
    top = 6.0 * distance + 1.0
    ratio = (top / _SHORTEST) ** (1.0 / (_GRID - 1))
    best, ki, kf = 1e18, _SHORTEST, _SHORTEST
    mi = _SHORTEST
    for _ in range(_GRID):
        mf = _SHORTEST
        for _ in range(_GRID):
            if _holds(mi, mf, x, y, c, s, low, high, coarse):
                length = _length(mi, mf, x, y, c, s, coarse)
                if length < best:
                    best, ki, kf = length, mi, mf
            mf *= ratio
        mi *= ratio
    step = 0.5 * math.log(ratio)
    if best > 1e17:
        ki, kf, best = _in_a_valley(ratio, step, x, y, c, s, low, high, coarse)
    if best > 1e17:
        return ki, kf, 0.0, False
    ki, kf, best = _refine(ki, kf, best, step, x, y, c, s, low, high, coarse)
    # Peaks between the coarse samples: tighten by what they exceed the limits, solve again.
    tight_low, tight_high = low, high
    bends = np.empty(dense.shape[1])
    for _ in range(6):
        if _holds(ki, kf, x, y, c, s, low, high, dense):
            return ki, kf, _length(ki, kf, x, y, c, s, dense), True
        violation = _violation(ki, kf, x, y, c, s, low, high, dense, bends)
        tight_low += 1.2 * violation + 1e-4 * high
        tight_high -= 1.2 * violation + 1e-4 * high
        if tight_low >= 0.0 or tight_high <= 0.0:
            break
        worst = _violation(ki, kf, x, y, c, s, tight_low, tight_high, coarse, bends)
        ki, kf, worst = _reduce_violation(
            ki, kf, worst, 0.2, x, y, c, s, tight_low, tight_high, coarse
        )
        if worst > 0.0:
            break
        best = _length(ki, kf, x, y, c, s, coarse)
        ki, kf, best = _refine(ki, kf, best, 0.05, x, y, c, s, tight_low, tight_high, coarse)
    feasible = _holds(ki, kf, x, y, c, s, low, high, dense)
    return ki, kf, _length(ki, kf, x, y, c, s, dense), feasible


@dataclass(frozen=True)
class PushCurve:
    """A cubic of (2.2)-(2.4). start, end: ``(3,)`` robot poses; k_start, k_end, length [m]."""

    start: Array
    end: Array
    k_start: float
    k_end: float
    length: float

    def sample(self, count: int) -> tuple[Array, Array, Array]:
        """Points ``(count, 2)`` [m], headings ``(count,)`` [rad], curvatures ``(count,)`` [1/m]."""
        s = np.linspace(0.0, 1.0, count)[:, None]
        (pi, ti), (pf, tf) = ((p[:2], p[2]) for p in (self.start, self.end))
        direction_i = np.array([math.cos(ti), math.sin(ti)])
        direction_f = np.array([math.cos(tf), math.sin(tf)])
        alpha = self.k_end * direction_f - 3.0 * pf
        beta = self.k_start * direction_i + 3.0 * pi
        points = s**3 * pf - (s - 1) ** 3 * pi + alpha * s**2 * (s - 1) + beta * s * (s - 1) ** 2
        first = (
            3 * s**2 * pf
            - 3 * (s - 1) ** 2 * pi
            + alpha * (3 * s**2 - 2 * s)
            + beta * ((s - 1) ** 2 + 2 * s * (s - 1))
        )
        second = 6 * s * pf - 6 * (s - 1) * pi + alpha * (6 * s - 2) + beta * (6 * s - 4)
        speed = np.hypot(*first.T)
        kappa = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / speed**3
        heading = np.unwrap(np.arctan2(first[:, 1], first[:, 0]))
        return points, heading, kappa

    def split(self, length: float) -> "tuple[PushCurve, PushCurve]":
        """What comes before and after ``length`` [m], which is less than the curve's; to a
        hundredth of the curve's. Parts of a cubic are cubics."""
        points, heading, _ = self.sample(_DENSE)
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        k = min(max(1, int(np.searchsorted(way, length))), _DENSE - 2)
        s = k / (_DENSE - 1)
        middle = np.array([*points[k], heading[k]])
        slope = (self.end[:2] - self.start[:2]) * (6.0 * s * (1.0 - s))
        for factor, size, angle in (
            ((s - 1.0) * (3.0 * s - 1.0), self.k_start, self.start[2]),
            (s * (3.0 * s - 2.0), self.k_end, self.end[2]),
        ):
            slope += factor * size * np.array([math.cos(angle), math.sin(angle)])
        speed = float(np.hypot(*slope))
        return (
            PushCurve(self.start, middle, s * self.k_start, s * speed, float(way[k])),
            PushCurve(
                middle,
                self.end,
                (1.0 - s) * speed,
                (1.0 - s) * self.k_end,
                float(way[-1] - way[k]),
            ),
        )


def shortest_push_curve(
    start: Array, end: Array, curvature_min: float, curvature_max: float
) -> PushCurve | None:
    """Solve (2.5)-(2.7).

    Parameters
    ----------
    start, end: ``(3,)`` poses of the robot's axle midpoint.
    curvature_min, curvature_max: [1/m] 1/r_lim- < 0 < 1/r_lim+.

    Returns
    -------
    The shortest curve found, feasible on 321 samples, or None when none was found.
    """
    if not curvature_min < 0.0 < curvature_max:
        raise ValueError(
            "the curvature limits must enclose 0 (minimum < 0 < maximum), got "
            f"[{curvature_min}, {curvature_max}] 1/m"
        )
    c, s = math.cos(start[2]), math.sin(start[2])
    dx, dy = end[0] - start[0], end[1] - start[1]
    turn = end[2] - start[2]
    ki, kf, length, feasible = solve_curve(
        c * dx + s * dy,
        -s * dx + c * dy,
        math.cos(turn),
        math.sin(turn),
        curvature_min,
        curvature_max,
        BASIS_COARSE,
        BASIS_DENSE,
    )
    return PushCurve(start, end, ki, kf, length) if feasible else None
