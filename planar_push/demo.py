"""Run a system once: start it, send the scenario's goals, record, report."""

import argparse
import math
import shutil
import signal
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from planar_push.arguments import (
    add_factor,
    add_namespace,
    add_system_and_scenario,
    add_timeout,
    scenario_of,
    stop_on_signals,
    tell,
    whole,
)
from push_bringup.failures import SuiteFailed
from push_model.settings import SettingsError

if TYPE_CHECKING:
    from push_bringup.job_result import JobResult
    from push_scenario.scenario import Scenario


_OTHERS = {
    "rearrange": "start it with 'planar-push launch rearrange', then run 'planar-push rearrange'",
    "torque": "start it with 'planar-push launch torque', and send a trajectory (docs/torque.md)",
}
"""Systems that take no goal of one object, and what to do instead."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    add_system_and_scenario(parser)
    parser.add_argument("--out", default="results/demo", help="folder; replaces an earlier demo")
    parser.add_argument(
        "--lockstep",
        action="store_true",
        help="in one process, as fast as possible; `planar-push rerun` repeats it to the bit",
    )
    parser.add_argument(
        "--seed", type=whole(0), default=None, help="of the simulation; default: the scenario's"
    )
    add_factor(parser)
    words = "[s] to wait for each goal: of wall time, or with --lockstep of simulated time"
    add_timeout(parser, 220.0, words)
    add_namespace(parser)


def run(arguments: argparse.Namespace) -> int:
    """0 if every object has reached its goal."""
    from push_bringup.preparation import check_domain, prepare
    from push_bringup.suite import Suite, scenario_goals
    from push_scenario.scenario import load_scenario
    from push_view.report import PRODUCTS

    if arguments.system in _OTHERS:
        raise SettingsError(
            f"demo does not run the system '{arguments.system}'; {_OTHERS[arguments.system]}"
        )
    out = Path(arguments.out)
    scenario = load_scenario(scenario_of(arguments))
    if arguments.seed is not None:
        scenario = scenario.settings("bridge", seed=arguments.seed)
    goals = scenario_goals(scenario)
    words = {
        "system": arguments.system,
        "namespace": arguments.namespace,
        "factor": arguments.factor,
    }
    prepare(scenario, record=out / "bag.new", **words)
    if arguments.lockstep:
        if arguments.factor is not None:
            raise SettingsError("--factor: a run in lockstep has no pace; leave it out")
        _clear(out, (*PRODUCTS, "bag"))
        return _conclude(_in_lockstep(arguments, scenario, out / "bag"), out, "true poses")
    check_domain(arguments.namespace)
    _clear(out, (*PRODUCTS, "bag"))  # nothing is wrong: an earlier demo may go
    suite = Suite(scenario, record=out / "bag", verbose=True, on_event=tell, **words)
    stop_on_signals(suite.request_stop)
    results = {}
    try:
        with suite:
            for team, row in goals.items():
                told = ", then ".join(str(goal) for goal in row)
                print(f"goal: {told} on {suite.monitor(team).goal_topic}", flush=True)
            results = suite.reach_all(timeout=arguments.timeout)
    except SuiteFailed as error:
        if not suite.stop_requested:
            print(f"error: {error}", file=sys.stderr)
    if suite.stop_requested:
        return 130
    return _conclude(results, out, "poses that were measured last")


def _in_lockstep(
    arguments: argparse.Namespace, scenario: "Scenario", bag: Path
) -> "dict[str, JobResult]":
    from push_study.recorded_run import recorded_run

    print("running in lockstep", flush=True)
    words = {"sim_limit": arguments.timeout, "namespace": arguments.namespace}
    return recorded_run(scenario, arguments.system, bag, **words)


def _conclude(results: "dict[str, JobResult]", out: Path, poses: str) -> int:
    """Write the report; 0 if every object has reached its goal. poses: which give the errors."""
    from push_view.report import PRODUCTS, write_report

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
        good &= result.success  # within the tolerances of the system
        name = f"{result.team}: " if result.team else ""
        if math.isfinite(position):
            print(f"{name}final error: {1e3 * position:.1f} mm, {orientation:.3f} rad ({poses})")
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
