"""Timing by thread CPU time; medians, p99, and bounds."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

Bound = tuple[float, str, bool]


def thread_times(call: Callable[[Any], Any], inputs: list[Any]) -> tuple[np.ndarray, list[Any]]:
    """CPU time [s] of each call in this thread, and what each returned."""
    times, results = [], []
    for item in inputs:
        started = time.thread_time()
        results.append(call(item))
        times.append(time.thread_time() - started)
    return np.array(times), results


def quantiles(times: np.ndarray) -> str:
    """Median and p99 [us] as text."""
    return f"median {1e6 * np.median(times):8.1f} us   p99 {1e6 * np.percentile(times, 99):9.1f} us"


def at_most(value: float, limit: float) -> Bound:
    """Check an upper bound."""
    return float(value), f"<= {limit:g}", bool(value <= limit)


def at_least(value: float, limit: float) -> Bound:
    """Check a lower bound."""
    return float(value), f">= {limit:g}", bool(value >= limit)
