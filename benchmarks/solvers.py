"""The programmes of bench mpc by seven solvers, with the same rows and warm starts, many steps.

Closed loops of 50 ticks are drawn without end; the solvers get each of them in turn. ``steps``
counts those of ours. Every other solver gets as much CPU time as ours, spread over the whole
measurement, so that a slow one takes fewer steps. It is compared with ours on the steps that both
took.
"""

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks.iterations import Traced, summary
from benchmarks.measure import Bound, Progress, at_least, at_most, supported, thread_times
from benchmarks.mpc import LOOPS, TICKS, Kind, cases, kinds, solve_fresh
from benchmarks.qp_rivals import RIVALS, backend
from push_mpc import LtvMpc
from push_qp import ActiveSetBackend, DaqpBackend, OsqpBackend, Qp, QpSolution

STEPS = 40_000
PART = {"easy": 0.3, "hard": 0.6, "forces": 0.1}
"""Of the steps that are of a kind."""


def makers() -> dict[str, Callable[[], Any]]:
    """Of the solvers that are installed."""
    found: dict[str, Callable[[], Any]] = {"active set": ActiveSetBackend, "daqp": DaqpBackend}
    for name in RIVALS:
        try:
            backend(name)
        except ImportError:
            print(f'  {name} is not installed; pip install -c constraints.txt -e ".[rivals]"')
            continue
        found[name] = lambda name=name: backend(name)
    found["osqp"] = lambda: OsqpBackend(1e-5)
    return found


class Clocked:
    """A solver, with the CPU time [s] of each solve, and its rounds of row generation."""

    def __init__(self, solver: Any) -> None:
        self._solver = solver
        self.spent: list[float] = []
        self.rounds: list[int] = []

    def solve(self, qp: Qp) -> QpSolution:
        """See QpBackend."""
        started = time.thread_time()
        result: QpSolution = self._solver.solve(qp)
        self.spent.append(time.thread_time() - started)
        self.rounds.append(getattr(self._solver, "rounds", 0))
        return result

    def reset(self) -> None:
        """See QpBackend."""
        self._solver.reset()


@dataclass
class Taken:
    """The steps that a solver took: CPU times [s], loops they belong to, and failures."""

    solver: Clocked
    mpc: LtvMpc
    whole: list[float] = field(default_factory=list)
    loops: list[int] = field(default_factory=list)
    failed: list[tuple[int, int, str]] = field(default_factory=list)
    """Loop, tick and reason."""
    spent: float = 0.0

    def take(self, kind: Kind, loop: list[Any], number: int) -> None:
        """Every step of a closed loop."""

        def step(case: Any) -> Any:
            if case[3]:
                self.mpc.reset()
            return self.mpc.solve(case[0], case[1], kind.contact, case[2])

        if not self.loops:
            step(loop[0])  # compiled, imported
            self.solver.spent.clear()
            self.solver.rounds.clear()
        times, answers = thread_times(step, loop)
        self.whole += times.tolist()
        self.spent += float(times.sum())
        self.loops.append(number)
        self.failed += [(number, i, a.reason) for i, a in enumerate(answers) if not a.solved]

    def times(self) -> dict[str, np.ndarray]:
        """Of whole steps, and of the solver alone."""
        return {"step": np.array(self.whole), "solve": np.array(self.solver.spent)}

    def steps(self) -> np.ndarray:
        """Their numbers."""
        return (TICKS * np.array(self.loops)[:, None] + np.arange(TICKS)).ravel()


def run(steps: int = STEPS) -> dict[str, Any]:
    """CPU times of steps and solves by solver, iterations of ours, failures.

    steps: of ours, of all kinds together.
    """
    result: dict[str, Any] = {}
    bounds: dict[str, Bound] = {}
    for label, part in PART.items():
        kind = kinds()[label]
        taken, trace = _measured(kind, label, max(1, round(part * steps / TICKS)))
        ours = taken["active set"]
        for name, found in taken.items():
            row = _row(found, ours)
            result[f"{label} {name}"] = row
            print(f"  {label:6s} {name:11s} {_text(row)}", flush=True)
            if found is not ours:
                bounds[f"{label}: {name} / ours, median"] = at_least(row["ours_p50"], 1.0)
        figures, text = summary(trace, np.array(ours.solver.spent))
        print(f"  {label:6s} iterations of ours\n{text}", flush=True)
        for number, tick, reason in ours.failed:
            where = f"seed {number // LOOPS}, loop {number % LOOPS}, tick {tick}"
            print(f"    ours failed: {where}: {reason}")
        result[f"{label} iterations"] = figures
        bounds[f"{label}: failed solves of ours"] = at_most(len(ours.failed), 0)
        bounds[f"{label}: optimality of ours, deviation"] = at_most(trace.error, 1e-7)
        bounds[f"{label}: iterations of ours / their cap"] = at_most(
            figures["iterations"]["max"] / trace.cap, 0.5
        )
    return result | {"bounds": bounds}


def _measured(kind: Kind, label: str, loops: int) -> tuple[dict[str, Taken], Traced]:
    """Closed loops, which our solver closes once with a trace and then all take by the clock."""
    taken = {}
    for name, make in makers().items():
        solver = Clocked(make())
        taken[name] = Taken(solver, kind.make(solver))
    trace, progress, ours = Traced(), Progress(loops * TICKS), taken["active set"]
    for number in range(loops):
        if number % LOOPS == 0:
            inputs = cases(kind, number // LOOPS, trace, min(LOOPS, loops - number))
        first = number % LOOPS * TICKS
        for found in taken.values():
            if found.spent <= ours.spent:
                found.take(kind, inputs[first : first + TICKS], number)
        progress.tell((number + 1) * TICKS, label)
    progress.clear()
    return taken, trace


def _row(found: Taken, ours: Taken) -> dict[str, Any]:
    """Quantiles as far as the number of steps supports them, also over ours on the same steps."""
    row: dict[str, Any] = {"steps": len(found.whole), "failed": len(found.failed)}
    row["reasons"] = dict(Counter(reason for _, _, reason in found.failed))
    same = ours.times()["step"][found.steps()]
    for what, times in found.times().items():
        for p in supported(len(times)):
            row[f"{what}_p{p:g}_s"] = float(np.percentile(times, p))
        row[f"{what}_max_s"] = float(times.max())
    for p in supported(len(same)):
        row[f"ours_p{p:g}"] = row[f"step_p{p:g}_s"] / float(np.percentile(same, p))
    rounds = np.array(found.solver.rounds)
    row["rounds"] = {"mean": float(rounds.mean()), "max": int(rounds.max())}
    return row


def _text(row: dict[str, Any]) -> str:
    def told(what: str) -> str:
        names = [k.split("_")[1] for k in row if k.startswith(f"{what}_")]
        return ", ".join(f"{name} {1e6 * row[f'{what}_{name}_s']:.1f}" for name in names)

    over = ", ".join(f"{row[k]:.2f}" for k in row if k.startswith("ours_"))
    text = f"{row['steps']:7d} steps, {told('step')} us; x ours {over}; failed {row['failed']}"
    text += f"\n{'solver alone':>32s}  {told('solve')} us"
    if row["rounds"]["max"]:
        text += f"; rounds mean {row['rounds']['mean']:.2f}, max {row['rounds']['max']}"
    reasons = "".join(f"\n      {n} x {reason}" for reason, n in row["reasons"].items())
    return text + reasons


def agreement(kind: Kind, name: str, count: int = LOOPS) -> float:
    """Largest difference of first inputs from ours, as a fraction of the greatest acceleration."""
    worst = 0.0
    for case in cases(kind)[:: max(1, LOOPS * TICKS // count)]:
        (first, _), (other, _) = (
            solve_fresh(s, kind, case) for s in (ActiveSetBackend(), backend(name))
        )
        worst = max(worst, float(np.abs((first - other) / [0.3, 6.0]).max()))
    return worst
