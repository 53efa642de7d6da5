"""Run the run of a bag again in lockstep, and say whether it is equal to the bit."""

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    parser.add_argument("bag")
    parser.add_argument("--out", default="", help="folder in which the bag of the re-run is kept")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NODE.SETTING=VALUE",
        help="change a setting in the re-run, e.g. planner.push_speed=0.06; may be repeated",
    )


def run(arguments: argparse.Namespace) -> int:
    """0 if equal, or if a bag of live use was compared; 1 if different."""
    from push_bringup.preparation import check_bag
    from push_study.rerun import rerun
    from push_study.rerun_text import lines_of

    parameters: dict[str, dict[str, Any]] = {}
    for text in arguments.set:
        _set(parameters, text)
    if arguments.out:
        check_bag(Path(arguments.out))
    with tempfile.TemporaryDirectory("-planar-push") as folder:
        out = Path(arguments.out) if arguments.out else Path(folder) / "rerun"
        result = rerun(Path(arguments.bag), out, parameters, lambda text: print(text, flush=True))
        for line in lines_of(result):
            print(line)
    sys.stdout.flush()
    return result.code


def _set(parameters: dict[str, dict[str, Any]], text: str) -> None:
    """Add one changed setting; raises SettingsError."""
    from push_model.settings import SettingsError
    from push_scenario.files import parse_yaml

    name, equals, value = text.partition("=")
    node, *path = name.split(".")
    if not (equals and node and path and all(path)):
        raise SettingsError(f"--set {text}: expected NODE.SETTING=VALUE")
    values: dict[str, Any] = parameters.setdefault(node, {})
    for part in path[:-1]:
        values = values.setdefault(part, {})
    values[path[-1]] = parse_yaml(value, f"--set {text}")
