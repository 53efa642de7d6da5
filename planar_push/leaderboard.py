"""Compare all methods, ours and those of other authors, on equal tasks; write a page and a CSV."""

import argparse
import sys
from pathlib import Path

from planar_push.arguments import add_study, names, study_folder, whole

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
    parser.add_argument(
        "--uncertainty",
        help="as of planar-push experiment; default contest: mild with poses at 50 Hz",
    )
    parser.add_argument("--world", default="planar", help="planar, pybullet or viscous")
    add_study(parser)


def run(arguments: argparse.Namespace) -> int:
    """0 when every match was run and at least one succeeded."""
    from push_study.study import StudyOptions, complete, experiment, run_study

    sys.path.insert(0, str(Path.cwd()))  # entries of a user's own files
    contests = arguments.contests or (QUICK if arguments.quick else "")
    chosen = names(contests)
    what = experiment("leaderboard")
    options = StudyOptions(
        chosen or what.SCENARIOS,
        arguments.trials or (3 if arguments.quick else 20),
        arguments.seed,
        study_folder(arguments, "leaderboard"),
        arguments.scheduler,
        arguments.workers,
        arguments.uncertainty or what.OPTIONS["uncertainty"],
        arguments.world,
        frozenset(),
        names(arguments.methods),
    )
    return 0 if complete(run_study("leaderboard", options)) else 1
