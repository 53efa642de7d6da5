"""Benchmarks: speed beside rivals, and the physics against theory. ``planar-push bench``."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from push_record.recorder import revision


def run(what: str, out: Path | None) -> int:
    """Run one benchmark or all; returns 0 when every bound holds."""
    from benchmarks import curve, latency, lockstep, mpc, physics, plan, stable_push

    known: dict[str, Callable[[], dict[str, Any]]] = {
        "curve": curve.run,
        "mpc": mpc.run,
        "plan": plan.run,
        "latency": latency.run,
        "lockstep": lockstep.run,
        "physics": physics.run,
        "stable-push": stable_push.run,
    }
    names = list(known) if what == "all" else [what]
    results: dict[str, Any] = {"revision": revision()}
    good = True
    for name in names:
        print(f"== {name}", flush=True)
        results[name] = known[name]()
        for bound, (value, limit, holds) in results[name].get("bounds", {}).items():
            good &= holds
            print(f"  {'ok  ' if holds else 'FAIL'} {bound}: {value:.4g} (bound {limit})")
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        (out / "bench.json").write_text(json.dumps(results, indent=1, default=str) + "\n")
    return 0 if good else 1
