"""Intervals of 95 % from repeated trials."""

import math

import numpy as np
from scipy.stats import t as student

from push_model.arrays import Array
from push_model.belief import Interval


class TooLittle(ValueError):
    """Raised when there is not enough data for an estimate; says what was missing."""


def interval_of_mean(values: Array, systematic: float = 0.0) -> Interval:
    """The mean of independent trials ``(n,)`` with Student's 95 % interval.

    systematic: half width that is added, of errors that all trials share.

    Raises
    ------
    TooLittle: fewer than three trials.
    """
    values = np.asarray(values, dtype=np.float64)
    if len(values) < 3:
        raise TooLittle(f"{len(values)} good trials, at least 3 are needed")
    mean = float(values.mean())
    error = float(values.std(ddof=1)) / math.sqrt(len(values))
    half = float(student.ppf(0.975, len(values) - 1)) * error + systematic
    return Interval(mean, mean - half, mean + half)


def solve_with_intervals(
    rows: Array, values: Array, systematic: Array | float = 0.0
) -> list[Interval]:
    """Least squares: ``rows @ x = values``, each unknown with Student's 95 % interval.

    rows: ``(n, k)``. values: ``(n,)``. systematic: half widths ``(k,)`` that are added.

    Raises
    ------
    TooLittle: not more equations than unknowns, or some unknown is not determined.
    """
    n, k = rows.shape
    if n <= k or np.linalg.matrix_rank(rows) < k:
        raise TooLittle(f"{n} measurements do not determine {k} unknowns")
    inverse = np.linalg.inv(rows.T @ rows)
    x = inverse @ rows.T @ values
    variance = float(((values - rows @ x) ** 2).sum()) / (n - k)
    half = student.ppf(0.975, n - k) * np.sqrt(variance * np.diag(inverse)) + systematic
    half = np.broadcast_to(half, k)
    return [Interval(float(v), float(v - h), float(v + h)) for v, h in zip(x, half, strict=True)]
