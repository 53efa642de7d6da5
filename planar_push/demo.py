"""Run a system once: start it, send the scenario's goals, record, report."""

import argparse
import math
import shutil
import signal
import sys
from collections.abc import Iterable
from pathlib import Path

from planar_push.arguments import (
    add_factor,
    add_namespace,
    add_system_and_scenario,
    add_timeout,
    scenario_of,
    stop_on_signals,
    tell,
)
from push_bringup.failures import SuiteFailed

_POSITION, _ORIENTATION = 0.02, 0.1  # [m], [rad] of a demonstration that succeeds


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    add_system_and_scenario(parser)
    parser.add_argument("--out", default="results/demo", help="folder; replaces an earlier demo")
    add_factor(parser)
    add_timeout(parser, 220.0)
    add_namespace(parser)


def run(arguments: argparse.Namespace) -> int:
    """0 if every object has reached its goal."""
    from push_bringup.preparation import check_domain, prepare
    from push_bringup.suite import Suite, scenario_goals
    from push_scenario.scenario import load_scenario
    from push_view.report import PRODUCTS, write_report

    out = Path(arguments.out)
    scenario = load_scenario(scenario_of(arguments))
    goals = scenario_goals(scenario)
    words = {
        "system": arguments.system,
        "namespace": arguments.namespace,
        "factor": arguments.factor,
    }
    prepare(scenario, record=out / "bag.new", **words)
    check_domain(arguments.namespace)
    _clear(out, (*PRODUCTS, "bag"))  # nothing is wrong: an earlier demo may go
    suite = Suite(scenario, record=out / "bag", verbose=True, on_event=tell, **words)
    stop_on_signals(suite.request_stop)
    results = {}
    try:
        with suite:
            for team, goal in goals.items():
                print(f"goal: {goal} on {suite.monitor(team).goal_topic}", flush=True)
            results = suite.reach_all(goals, timeout=arguments.timeout)
    except SuiteFailed as error:
        if not suite.stop_requested:
            print(f"error: {error}", file=sys.stderr)
    if suite.stop_requested:
        return 130
    for result in results.values():
        if not result.success:
            print(f"error: {result}", file=sys.stderr)
    if not any((out / "bag").glob("*.mcap")):
        return 1  # nothing was recorded; the reason has been printed
    for number in (signal.SIGINT, signal.SIGTERM):  # nothing is left to stop
        signal.signal(number, lambda *_: sys.exit(130))
    print("writing the report", flush=True)
    write_report(out / "bag", out)
    good = bool(results)
    for result in results.values():
        position, orientation = result.position_error, result.orientation_error
        good &= result.success and position <= _POSITION and orientation <= _ORIENTATION
        name = f"{result.team}: " if result.team else ""
        if math.isfinite(position):
            print(f"{name}final error: {1e3 * position:.1f} mm, {orientation:.3f} rad")
    for file in (*PRODUCTS, "bag"):
        print(f"  {out / file}")
    return 0 if good else 1


def _clear(out: Path, names: Iterable[str]) -> None:
    """Remove what an earlier demo left."""
    out.mkdir(parents=True, exist_ok=True)
    for name in names:
        if (out / name).is_dir():
            shutil.rmtree(out / name)
        else:
            (out / name).unlink(missing_ok=True)
