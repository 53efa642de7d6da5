"""Measure speed against other solvers, and physics against theory."""

import argparse
from pathlib import Path

from benchmarks import NAMES, WITH_STEPS
from planar_push.arguments import describe, whole


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    choices = ["all", *NAMES]
    parser.add_argument(
        "what",
        nargs="?",
        default="all",
        choices=choices,
        metavar="NAME",
        help="one of those below; default: all",
    )
    describe(parser, Path(__file__).resolve().parents[1] / "benchmarks", NAMES)
    parser.add_argument(
        "--steps",
        type=whole(1),
        help=f"number of control steps of our solver; only for {', '.join(WITH_STEPS)}",
    )
    parser.add_argument("--out", default="", help="folder for the JSON results")


def run(arguments: argparse.Namespace) -> int:
    """0 when every bound holds."""
    from benchmarks import run as run_benchmarks

    out = Path(arguments.out) if arguments.out else None
    return run_benchmarks(arguments.what, out, arguments.steps)
