"""Statistics of studies: contingency tables, correlations, and how well something is predicted."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest, fisher_exact, pearsonr, ranksums
from scipy.stats import t as student

from push_model.arrays import Array, Mask

_FOLDS = 10
_INTERVAL = 1.959964  # standard deviations of a 95 % interval


@dataclass(frozen=True)
class Correlation:
    """r with its p-value, and its 95 % interval (Fisher's z) of ``count`` samples."""

    r: float
    p: float
    low: float
    high: float
    count: int


def correlation(x: Array, y: Array) -> Correlation:
    """Pearson's, of the pairs ``(n,)`` that are finite; nan where there is no spread."""
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    n = len(x)
    if n < 4 or np.ptp(x) <= 1e-12 * (1.0 + np.abs(x).max()) or np.ptp(y) == 0.0:
        return Correlation(math.nan, math.nan, math.nan, math.nan, n)
    found = pearsonr(x, y)
    r = min(1.0 - 1e-15, max(-1.0 + 1e-15, float(found.statistic)))
    z, spread = math.atanh(r), _INTERVAL / math.sqrt(n - 3)
    return Correlation(r, float(found.pvalue), math.tanh(z - spread), math.tanh(z + spread), n)


def contingency(test: Mask, success: Mask) -> Array:
    """``(2, 2)`` counts: rows failed and succeeded, columns test failed and passed; Table 3.1."""
    table = [[np.sum((success == s) & (test == t)) for t in (False, True)] for s in (False, True)]
    return np.array(table, dtype=np.float64)


def fisher(table: Array) -> float:
    """p of Fisher's exact test of a table of counts ``(2, 2)``."""
    return float(fisher_exact(table.astype(int))[1])


def rank_sum(first: Array, second: Array) -> float:
    """p of Wilcoxon's rank-sum test of two samples ``(n,)``, ``(m,)``; nan when one is empty."""
    if not len(first) or not len(second):
        return math.nan
    return float(ranksums(first, second).pvalue)


def cross_validated(features: Array, target: Array, seed: int = 1) -> Correlation:
    """Between a target ``(n,)`` and what linear regressions on features ``(n, k)`` predict of it.

    Each tenth of the samples is predicted from the nine others.
    """
    n = len(target)
    if n < 4 * _FOLDS:
        return Correlation(math.nan, math.nan, math.nan, math.nan, n)
    order = np.random.default_rng(seed).permutation(n)
    predicted = np.empty(n)
    for fold in np.array_split(order, _FOLDS):
        rest = np.setdiff1d(order, fold)
        mean, spread = features[rest].mean(axis=0), features[rest].std(axis=0) + 1e-12
        A = np.column_stack([np.ones(len(rest)), (features[rest] - mean) / spread])
        weights = np.linalg.lstsq(A, target[rest], rcond=None)[0]
        scaled = (features[fold] - mean) / spread
        predicted[fold] = np.column_stack([np.ones(len(fold)), scaled]) @ weights
    return correlation(predicted, target)


def sign_test(lower: int, count: int) -> float:
    """Two-sided p-value of one thing being lower than another in so many of ``count`` pairs."""
    return float(binomtest(lower, count).pvalue) if count else 1.0


def wilson(hits: int, count: int) -> tuple[float, float]:
    """95 % interval of a probability by so many hits in ``count`` trials (Wilson 1927)."""
    if not count:
        return 0.0, 1.0
    interval = binomtest(hits, count).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)


def mean_interval(values: Array, level: float = 0.95) -> tuple[float, float]:
    """Interval of the mean of values ``(k,)`` (Student's t); no bounds if k is below 3."""
    if len(values) < 3:
        return -math.inf, math.inf
    half = float(
        student.ppf(0.5 + level / 2.0, len(values) - 1)
        * values.std(ddof=1)
        / math.sqrt(len(values))
    )
    return float(values.mean()) - half, float(values.mean()) + half
