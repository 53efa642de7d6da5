"""Timing by thread CPU time; medians, p99, and bounds."""

import sys
import time
from collections.abc import Callable
from typing import Any, TextIO

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


def supported(count: int) -> list[float]:
    """Those of p50, p99, p99.9 and p99.99 that at least ten of so many values exceed."""
    return [p for p in (50.0, 99.0, 99.9, 99.99) if round(count * (100.0 - p)) >= 1000]


def at_most(value: float, limit: float) -> Bound:
    """Check an upper bound."""
    return float(value), f"<= {limit:g}", bool(value <= limit)


def at_least(value: float, limit: float) -> Bound:
    """Check a lower bound."""
    return float(value), f">= {limit:g}", bool(value >= limit)


class Progress:
    """How far a long measurement is: one line on a terminal, some lines elsewhere."""

    def __init__(self, total: int, out: TextIO | None = None) -> None:
        """total: parts of the measurement."""
        self._total, self._out = total, sys.stdout if out is None else out
        self._every = 0.5 if self._out.isatty() else 20.0  # [s] between lines
        self._started, self._first = time.monotonic(), 0
        self._next = self._started + min(2.0, self._every)

    def tell(self, done: int, what: str) -> None:
        """So many parts are done."""
        now = time.monotonic()
        if self._first == 0:  # which took longer: what it needed was loaded
            self._started, self._first = now, done
        if now < self._next or done <= self._first:
            return
        self._next = now + self._every
        left = (now - self._started) * (self._total - done) / (done - self._first)
        line = f"  {what}: {done} of {self._total} steps, about {left:.0f} s to go"
        self._out.write(f"\r\033[K{line}" if self._out.isatty() else f"{line}\n")
        self._out.flush()

    def clear(self) -> None:
        """Before other output."""
        if self._out.isatty():
            self._out.write("\r\033[K")
