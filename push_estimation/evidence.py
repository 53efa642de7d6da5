"""What the estimators on a grid share: a verdict on a window, and the test for contradictions."""

from dataclasses import dataclass

import numpy as np

from push_model.arrays import Array

_CONTRADICTED = 7.0  # log of the odds of prior against posterior at which a belief is given up


@dataclass(frozen=True)
class Verdict:
    """What a window did. used: whether it counts. contradicted: whether the interval was widened.
    sentence: what there is to tell of it; empty for an ordinary window."""

    used: bool
    contradicted: bool = False
    sentence: str = ""


class Contradiction:
    """Whether new windows speak for the prior and against what was learned from earlier ones.

    The log of the odds is summed up over the windows and never falls below zero (a CUSUM test), so
    that many windows which agree do not hide a change.
    """

    def __init__(self) -> None:
        self._odds = 0.0

    def add(self, by_prior: float, by_posterior: float) -> bool:
        """Add a window, by the log of its density under both; whether they contradict now."""
        self._odds = max(0.0, self._odds + by_prior - by_posterior)
        return self._odds > _CONTRADICTED


def log_mean(log: Array, density: Array) -> float:
    """Log of the mean of a density under a distribution; both logs, ``(n,)``."""
    return log_total(log + density) - log_total(log)


def log_total(log: Array) -> float:
    """Log of the sum of numbers ``(n,)`` that are given by their logs."""
    most = float(log.max())
    return most + float(np.log(np.exp(log - most).sum()))
