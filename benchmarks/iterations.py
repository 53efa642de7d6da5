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
        return result

    def reset(self) -> None:
        """See QpBackend."""
        self._solver.reset()


def summary(trace: Traced, alone: np.ndarray) -> tuple[dict[str, Any], str]:
    """Figures and text; alone: CPU time [s] of each solve, in the order of the trace."""
    iterations, dropped = np.array(trace.iterations), np.array(trace.dropped)
    cold = np.array(trace.cold)
    added = iterations - dropped
    longest = np.argsort(iterations)[-max(10, len(iterations) // 1000) :]
    each = float(alone[longest].sum() / max(1, iterations[longest].sum()))
    each = each if iterations.max() >= _MANY else float("nan")
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
        "iteration_s": each,
        "cap_s": each * trace.cap,
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
    lines.append(
        f"cap {trace.cap}: about {1e3 * figures['cap_s']:.1f} ms, at the {1e6 * each:.2f} us an "
        "iteration of the longest solves"
    )
    lines.append(f"different working sets that were optimal: {len(trace.optimal)}")
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
