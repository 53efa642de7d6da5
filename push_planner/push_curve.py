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
_SHORTEST = 0.02  # [m] least k_i, k_f; (2.6)


def basis_rows(n: int) -> Array:
    """Rows: s' and s'' coefficients of (end point, k_f, k_i) with the start at the origin."""
    s = np.linspace(0.0, 1.0, n)
    f1, g1 = 3 * s**2 - 2 * s, (s - 1) ** 2 + 2 * s * (s - 1)
    f2, g2 = 6 * s - 2, 6 * s - 4
    return np.ascontiguousarray(np.array([3 * s**2 - 3 * f1, f1, g1, 6 * s - 3 * f2, f2, g2]).T)


BASIS_COARSE, BASIS_DENSE = basis_rows(_COARSE), basis_rows(_DENSE)
"""Rows for ``solve_curve``: of the samples that it searches with, and of the final check."""


@numba.njit(cache=True, fastmath=True)
def _evaluate(
    ki: float,
    kf: float,
    x: float,
    y: float,
    c: float,
    s: float,
    low: float,
    high: float,
    basis: Any,
) -> tuple[float, float]:
    """Arc length [m] (2.5) and worst curvature violation [1/m] (2.7)."""
    n = basis.shape[0]
    length = 0.0
    worst = -1e9
    before = 0.0
    for i in range(n):
        dx = basis[i, 0] * x + basis[i, 1] * kf * c + basis[i, 2] * ki
        dy = basis[i, 0] * y + basis[i, 1] * kf * s
        ddx = basis[i, 3] * x + basis[i, 4] * kf * c + basis[i, 5] * ki
        ddy = basis[i, 3] * y + basis[i, 4] * kf * s
        q = dx * dx + dy * dy
        speed = math.sqrt(q)
        kappa = (dx * ddy - dy * ddx) / (q * speed + 1e-12)
        violation = max(kappa - high, low - kappa)
        if violation > worst:
            worst = violation
        if i > 0:
            length += 0.5 * (before + speed)
        before = speed
    return length / (n - 1), worst


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
    for _ in range(_ROUNDS):
        if step <= 1e-3:
            break
        found = False
        for k in range(12):
            a = k * 0.5235987755982988
            mi = max(_SHORTEST, ki * math.exp(step * math.cos(a)))
            mf = max(_SHORTEST, kf * math.exp(step * math.sin(a)))
            length, violation = _evaluate(mi, mf, x, y, c, s, low, high, basis)
            if violation <= 0.0 and length < best - 1e-9:
                best, ki, kf = length, mi, mf
                found = True
        if not found:
            step *= 0.4
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
    for _ in range(_ROUNDS):
        if step <= 1e-3 or worst <= 0.0:
            break
        found = False
        for k in range(12):
            a = k * 0.5235987755982988
            mi = max(_SHORTEST, ki * math.exp(step * math.cos(a)))
            mf = max(_SHORTEST, kf * math.exp(step * math.sin(a)))
            _, violation = _evaluate(mi, mf, x, y, c, s, low, high, basis)
            if violation < worst:
                worst, ki, kf = violation, mi, mf
                found = True
        if not found:
            step *= 0.4
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
def solve_curve(
    x: float, y: float, c: float, s: float, low: float, high: float, coarse: Any, dense: Any
) -> tuple[float, float, float, bool]:
    """k_i, k_f, length and whether the curve is feasible; start at the origin, heading 0."""
    distance = math.hypot(x, y)
    top = 6.0 * distance + 1.0
    ratio = (top / _SHORTEST) ** (1.0 / (_GRID - 1))
    best, ki, kf = 1e18, _SHORTEST, _SHORTEST
    violations = np.empty((_GRID, _GRID))
    mi = _SHORTEST
    for i in range(_GRID):
        mf = _SHORTEST
        for j in range(_GRID):
            length, violation = _evaluate(mi, mf, x, y, c, s, low, high, coarse)
            violations[i, j] = violation
            if violation <= 0.0 and length < best:
                best, ki, kf = length, mi, mf
            mf *= ratio
        mi *= ratio
    step = 0.5 * math.log(ratio)
    # No cell is feasible: the valley is narrower than a cell; go down from the lowest local minima.
    for _ in range(_STARTS):
        if best < 1e17:
            break
        i, j = _lowest_minimum(violations)
        if i < 0:
            break
        least = violations[i, j]
        violations[i, j] = math.inf
        ki, kf = _SHORTEST * ratio**i, _SHORTEST * ratio**j
        ki, kf, least = _reduce_violation(ki, kf, least, step, x, y, c, s, low, high, coarse)
        if least <= 0.0:
            best, _ = _evaluate(ki, kf, x, y, c, s, low, high, coarse)
    if best > 1e17:
        return ki, kf, 0.0, False
    ki, kf, best = _refine(ki, kf, best, step, x, y, c, s, low, high, coarse)
    # Peaks between the coarse samples: tighten by what they exceed the limits, solve again.
    tight_low, tight_high = low, high
    for _ in range(6):
        length, violation = _evaluate(ki, kf, x, y, c, s, low, high, dense)
        if violation <= 0.0:
            return ki, kf, length, True
        tight_low += 1.2 * violation + 1e-4 * high
        tight_high -= 1.2 * violation + 1e-4 * high
        if tight_low >= 0.0 or tight_high <= 0.0:
            break
        _, worst = _evaluate(ki, kf, x, y, c, s, tight_low, tight_high, coarse)
        ki, kf, worst = _reduce_violation(
            ki, kf, worst, 0.2, x, y, c, s, tight_low, tight_high, coarse
        )
        if worst > 0.0:
            break
        best, _ = _evaluate(ki, kf, x, y, c, s, low, high, coarse)
        ki, kf, best = _refine(ki, kf, best, 0.05, x, y, c, s, tight_low, tight_high, coarse)
    length, violation = _evaluate(ki, kf, x, y, c, s, low, high, dense)
    return ki, kf, length, violation <= 0.0


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
