"""Iterations of our active set over many control steps, beside their cap: see bench solvers."""

from typing import Any

import numpy as np

from benchmarks.measure import supported
from benchmarks.mpc import LOOPS, TICKS
from push_qp import ActiveSetBackend, Qp, QpSolution
from push_qp.active_set import iteration_limit

_MANY = 20  # iterations of a solve whose cost is theirs, not that of setting up
_EDGES = (0, 1, 2, 3, 5, 9, 17, 33, 65, 129, 257, 513)


class Traced:
    """Our solver, with what each of its solves did."""

    def __init__(self) -> None:
        self._solver = ActiveSetBackend()
        self.cap = 0
        self.iterations: list[int] = []
        self.dropped: list[int] = []
        self.cold: list[bool] = []
        self.optimal: set[int] = set()
        """A hash of each working set that was optimal."""
        self.error = 0.0
        """Greatest deviation of an answer from the conditions of optimality, see ``deviation``."""

    def solve(self, qp: Qp) -> QpSolution:
        """See QpBackend. Each iteration adds a row to the working set, or drops one from it."""
        n, solver = len(qp.f), self._solver
        self.cap = iteration_limit(qp)
        self.cold.append(len(solver.working_set) == 0)
        result = solver.solve(qp)
        final = np.sort(solver.working_set)
        rows = final[final >= 2 * n] - 2 * n
        inequalities = len(final) - int(qp.equalities(rows).sum())
        self.iterations.append(solver.iterations)
        self.dropped.append((solver.iterations - inequalities) // 2 if result.solved else 0)
        if result.solved:
            self.optimal.add(hash(final.tobytes()))
            error = deviation(qp, result.z, solver.working_set, solver.multipliers)
            self.error = max(self.error, error)
        return result

    def reset(self) -> None:
        """See QpBackend."""
        self._solver.reset()


def deviation(qp: Qp, z: np.ndarray, working: np.ndarray, multipliers: np.ndarray) -> float:
    """From the conditions of Karush, Kuhn and Tucker, which prove that z is optimal.

    The greatest of: violation of a constraint, distance from a constraint of the working set (both
    in its own unit), and, as fractions of the largest entry of f, the gradient of the Lagrangian
    and the negative part of a multiplier of an inequality.
    """
    n, box = len(qp.f), working < 2 * len(qp.f)
    rows = working[~box] - 2 * n
    G, b = qp.rows(rows)
    gradient = qp.H @ z + qp.f
    gradient += multipliers[~box] @ G
    side, prices = working[box], multipliers[box]
    at, upper = side % n, side >= n
    np.add.at(gradient, at, np.where(upper, prices, -prices))
    apart = np.concatenate([G @ z - b, z[at] - np.where(upper, qp.high[at], qp.low[at])])
    signed = np.concatenate([multipliers[~box][~qp.equalities(rows)], prices])
    dual = max(np.abs(gradient).max(), -signed.min(initial=0.0)) / np.abs(qp.f).max()
    return float(max(qp.violation(z), np.abs(apart).max(initial=0.0), dual))


def summary(trace: Traced, alone: np.ndarray) -> tuple[dict[str, Any], str]:
    """Figures and text; alone: CPU time [s] of each solve, in the order of the trace."""
    iterations, dropped = np.array(trace.iterations), np.array(trace.dropped)
    cold = np.array(trace.cold)
    added = iterations - dropped
    longest = np.argsort(iterations)[-max(10, len(iterations) // 1000) :]
    each = float(alone[longest].sum() / max(1, iterations[longest].sum()))
    many = bool(iterations.max() >= _MANY)
    edges = [*_EDGES, np.inf]
    bins = {
        f"{a}" if b == a + 1 else f"{a}-{b - 1:.0f}": int(count)
        for a, b, count in zip(edges, edges[1:], np.histogram(iterations, edges)[0], strict=False)
        if count
    }
    figures = {
        "cap": trace.cap,
        "iterations": _quantiles(iterations),
        "added": _quantiles(added),
        "dropped": _quantiles(dropped),
        "iterations_cold": _quantiles(iterations[cold]),
        "iterations_warm": _quantiles(iterations[~cold]),
        "longest_at": _place(int(iterations.argmax())),
        "histogram": np.bincount(iterations).tolist(),
        "optimal_working_sets": len(trace.optimal),
        "error": trace.error,
        "iteration_s": each if many else None,
        "cap_s": each * trace.cap if many else None,
    }
    lines = [
        f"{name:24s} {_told(values)}"
        for name, values in (
            ("iterations", iterations),
            ("  without a warm start", iterations[cold]),
            ("  with a warm start", iterations[~cold]),
            ("rows added", added),
            ("rows dropped", dropped),
        )
    ]
    lines.append("steps by iterations      " + ", ".join(f"{k}: {v}" for k, v in bins.items()))
    cost = f": about {1e3 * each * trace.cap:.1f} ms, at {1e6 * each:.2f} us an iteration of the"
    lines.append(f"cap {trace.cap}{cost + ' longest solves' if many else ''}")
    lines.append(f"different working sets that were optimal: {len(trace.optimal)}")
    lines.append(f"conditions of optimality met to {trace.error:.1e}")
    return figures, "\n".join(f"    {line}" for line in lines)


def _place(step: int) -> dict[str, int]:
    """Of a step of the measurement: arguments of ``cases``, and which tick."""
    loop, tick = divmod(step, TICKS)
    return {"seed": loop // LOOPS, "loop": loop % LOOPS, "tick": tick}


def _quantiles(values: np.ndarray) -> dict[str, float]:
    found = {f"p{p:g}": float(np.percentile(values, p)) for p in supported(len(values))}
    return found | {"max": float(values.max(initial=0))}


def _told(values: np.ndarray) -> str:
    return "  ".join(f"{name} {value:.0f}" for name, value in _quantiles(values).items())
