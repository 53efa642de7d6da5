"""Compare all methods, ours and those of other authors, on equal tasks; write a page and a CSV."""

import argparse
import sys
import time
from pathlib import Path

from planar_push.arguments import whole

QUICK = "open-square,env1,plates-open"
"""Contests of ``--quick``."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    parser.add_argument(
        "--quick", action="store_true", help=f"3 matches per cell, only the contests {QUICK}"
    )
    parser.add_argument(
        "--contests", default="", help="comma-separated contests; default: all of them"
    )
    parser.add_argument(
        "--methods",
        default="",
        help="comma-separated methods: names of the table, or MODULE:ATTRIBUTE of an Entry; "
        "default: all of the table",
    )
    parser.add_argument("--trials", type=whole(1), help="matches per cell; default 20, quick 3")
    parser.add_argument("--seed", type=whole(0), default=1, help="seed of the first match")
    parser.add_argument("--uncertainty", default="mild", help="as of planar-push experiment")
    parser.add_argument("--world", default="planar", help="planar or pybullet")
    parser.add_argument(
        "--out", default="", help="output folder; an interrupted run in it is continued"
    )
    parser.add_argument("--scheduler", default="", help="address of a Dask scheduler")
    parser.add_argument(
        "--workers", type=whole(0), default=0, help="local processes; 0: one per core"
    )


def run(arguments: argparse.Namespace) -> int:
    """0 when every match was run and at least one succeeded."""
    from push_study.study import StudyOptions, complete, experiment, run_study

    sys.path.insert(0, str(Path.cwd()))  # entries of a user's own files
    contests = arguments.contests or (QUICK if arguments.quick else "")
    chosen = _names(contests)
    out = arguments.out or f"results/leaderboard-{time.strftime('%Y%m%d-%H%M%S')}"
    options = StudyOptions(
        chosen or experiment("leaderboard").SCENARIOS,
        arguments.trials or (3 if arguments.quick else 20),
        arguments.seed,
        Path(out),
        arguments.scheduler,
        arguments.workers,
        arguments.uncertainty,
        arguments.world,
        frozenset(),
        _names(arguments.methods),
    )
    return 0 if complete(run_study("leaderboard", options)) else 1


def _names(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(",") if name.strip())
