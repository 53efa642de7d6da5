"""The programmes of bench mpc by seven solvers, with the same rows and warm starts, many steps.

Closed loops of 50 ticks are drawn without end; all solvers get each of them in turn. ``run(10**6)``
takes a million steps; slow solvers get a part of them, as the table says.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.measure import at_least, at_most, thread_times
from benchmarks.mpc import LOOPS, TICKS, Kind, cases, kinds, solve_fresh
from benchmarks.qp_rivals import RIVALS, backend
from push_qp import ActiveSetBackend, DaqpBackend, OsqpBackend

STEPS = 20_000
SHARE = {"active set": 1.0, "daqp": 1.0, "quadprog": 1.0, "osqp": 0.05}
"""Of the steps that a solver gets; a fifth where it is not listed."""


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


def run(steps: int = STEPS) -> dict[str, Any]:
    """Median, p99 and p99.9 of the CPU time of a step, and failures."""
    result: dict[str, Any] = {"bounds": {}}
    for label in ("easy", "hard"):
        kind = kinds()[label]
        times, failures = _times(kind, steps)
        ours = times["active set"]
        for name, found in times.items():
            q = {f"p{p}_s": float(np.percentile(found, p)) for p in (50, 99, 99.9)}
            result[f"{label} {name}"] = {**q, "steps": len(found), "failed": failures[name]}
            ratios = [q[f"p{p}_s"] / np.percentile(ours, p) for p in (50, 99, 99.9)]
            print(
                f"  {label:5s} {name:11s} {len(found):8d} steps  median {1e6 * q['p50_s']:7.1f} us"
                f"  p99 {1e6 * q['p99_s']:8.1f} us  p99.9 {1e6 * q['p99.9_s']:8.1f} us   x ours "
                + ", ".join(f"{r:.1f}" for r in ratios)
                + f"   failed {failures[name]}",
                flush=True,
            )
            if name != "active set":
                bound = f"{label}: {name} / ours, median"
                result["bounds"][bound] = at_least(ratios[0], 1.0)
        result["bounds"][f"{label}: failed solves of ours"] = at_most(failures["active set"], 0)
    return result


def _times(kind: Kind, steps: int) -> tuple[dict[str, np.ndarray], dict[str, int]]:
    made = {name: make() for name, make in makers().items()}
    controllers = {name: kind.make(solver) for name, solver in made.items()}
    times: dict[str, list[np.ndarray]] = {name: [] for name in made}
    failures = dict.fromkeys(made, 0)
    done, seed = 0, 0
    while done < steps:
        inputs = cases(kind, seed)
        seed += 1
        for first in range(0, len(inputs), TICKS):
            loop = inputs[first : first + TICKS]
            for name, mpc in controllers.items():
                share = SHARE.get(name, 0.2)
                if len(times[name]) * TICKS > share * max(done, 1):
                    continue

                def step(case: Any, mpc: Any = mpc) -> Any:
                    if case[3]:
                        mpc.reset()
                    return mpc.solve(case[0], case[1], kind.contact, case[2])

                if not times[name]:
                    step(loop[0])  # compiled, imported
                spent, answers = thread_times(step, loop)
                times[name].append(spent)
                failures[name] += sum(not a.solved for a in answers)
            done += TICKS
            if done >= steps:
                break
    return {name: np.concatenate(parts) for name, parts in times.items()}, failures


def agreement(kind: Kind, name: str, count: int = LOOPS) -> float:
    """Largest difference of first inputs from ours, as a fraction of the greatest acceleration."""
    worst = 0.0
    for case in cases(kind)[:: max(1, LOOPS * TICKS // count)]:
        (first, _), (other, _) = (
            solve_fresh(s, kind, case) for s in (ActiveSetBackend(), backend(name))
        )
        worst = max(worst, float(np.abs((first - other) / [0.3, 6.0]).max()))
    return worst
