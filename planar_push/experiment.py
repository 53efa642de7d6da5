"""Run seeded trials of a study; write summary, plots and a bag. Continues an interrupted study."""

import argparse
from pathlib import Path

from planar_push.arguments import add_study, describe, names, study_folder, whole


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    folder = Path(__file__).resolve().parents[1] / "push_study" / "experiments"
    known = sorted(p.stem.replace("_", "-") for p in folder.glob("[a-z]*.py"))
    parser.add_argument("name", metavar="NAME", help="one of those below")
    describe(parser, folder, known)
    parser.add_argument(
        "--scenarios", default="", help="comma-separated scenarios; default: those of the study"
    )
    parser.add_argument(
        "--trials", type=whole(1), default=5, help="number of trials of each scenario"
    )
    parser.add_argument(
        "--uncertainty",
        help="what the nodes do not know: none, mild, contest, shape, hard or unknown "
        "(docs/results.md); refused if the study has no choice",
    )
    parser.add_argument(
        "--world", help="pybullet, planar or viscous; refused if the study supports only one"
    )
    add_study(parser)


def run(arguments: argparse.Namespace) -> int:
    """0 when every trial was run and at least one succeeded."""
    from push_study.study import StudyOptions, complete, experiment, run_study

    given, out = names(arguments.scenarios), study_folder(arguments, arguments.name)
    what = experiment(arguments.name)
    options = StudyOptions(
        given or what.SCENARIOS,
        arguments.trials,
        arguments.seed,
        out,
        arguments.scheduler,
        arguments.workers,
        arguments.uncertainty or what.OPTIONS.get("uncertainty", "mild"),
        arguments.world or "",
        frozenset(o for o in ("uncertainty", "world") if getattr(arguments, o) is not None),
    )
    summary = run_study(arguments.name, options)
    print(f"\n{out}/summary.json")
    return 0 if complete(summary) else 1
