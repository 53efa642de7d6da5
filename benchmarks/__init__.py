"""Benchmarks: speed against other solvers, and physics against theory. ``planar-push bench``."""

import importlib
import json
from pathlib import Path
from typing import Any

from push_model.settings import SettingsError

NAMES = (
    "curve",
    "grasp",
    "group",
    "gym",
    "mpc",
    "nmpc",
    "placement",
    "plan",
    "latency",
    "lockstep",
    "physics",
    "solvers",
    "stable-push",
    "swarm",
    "swarm-graph",
    "third-opinion",
    "worlds",
)
"""Modules of this package with a ``run``; a dash for each underscore."""
WITH_STEPS = ("solvers",)
"""Those whose ``run`` takes a number of steps."""


def run(what: str, out: Path | None, steps: int | None = None) -> int:
    """Run one benchmark or all; returns 0 when every bound holds.

    Raises
    ------
    SettingsError: steps are given, and this benchmark has none.
    """
    from push_record.revision import revision

    if steps is not None and what not in WITH_STEPS:
        raise SettingsError(f"bench {what}: --steps is for bench {', '.join(WITH_STEPS)} only")
    options = {} if steps is None else {"steps": steps}

    names = list(NAMES) if what == "all" else [what]
    results: dict[str, Any] = {"revision": revision()}
    good = True
    for name in names:
        print(f"== {name}", flush=True)
        module = importlib.import_module(f"benchmarks.{name.replace('-', '_')}")
        results[name] = module.run(**options)
        for bound, (value, limit, holds) in results[name].get("bounds", {}).items():
            good &= holds
            print(f"  {'ok  ' if holds else 'FAIL'} {bound}: {value:.4g} (bound {limit})")
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        (out / "bench.json").write_text(json.dumps(results, indent=1, default=str) + "\n")
    return 0 if good else 1
