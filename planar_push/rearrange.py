"""Have one robot bring several objects to their goals, and follow it."""

import argparse
import sys

from planar_push.arguments import add_namespace, add_no_wait, finite, time_to_wait
from push_bringup.systems import check_namespace
from push_model.settings import SettingsError

_PATIENCE = 10.0  # [s] wall time for the suite to be found
_TIMEOUT = 1500.0  # [s] wall time for all moves


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    parser.add_argument(
        "goals",
        nargs="*",
        metavar="NAME X Y THETA",
        help="goals of objects, in [m] and [rad] in the map frame; without any, those under "
        "'arrangement' in the scenario that runs",
    )
    add_no_wait(parser, "send the goals and do not follow the job")
    add_namespace(parser)


def run(arguments: argparse.Namespace) -> int:
    """0 if every object reaches its goal; otherwise 1, with the reason and its code."""
    from push_bringup.arranger import Arranger

    check_namespace(arguments.namespace)
    goals, timeout = _goals(arguments.goals), time_to_wait(arguments, _TIMEOUT)
    with Arranger(arguments.namespace) as arranger:
        if not arranger.connect(_PATIENCE):
            print(
                "error: no rearranger answers; start one with: planar-push launch rearrange",
                file=sys.stderr,
            )
            return 1
        arranger.send(goals or arranger.arrangement())
        if not timeout:
            return 0
        code, reason = arranger.follow(timeout, lambda text: print(text, flush=True))
    if not code:
        return 0
    print(f"error: {reason} ({code})", file=sys.stderr)
    return 1


def _goals(words: list[str]) -> dict[str, tuple[float, float, float]]:
    """Raise SettingsError unless the words are names with three numbers each."""
    if len(words) % 4:
        raise SettingsError("expected NAME X Y THETA for each object")
    found: dict[str, tuple[float, float, float]] = {}
    for name, *numbers in zip(*[iter(words)] * 4, strict=True):
        try:
            x, y, theta = (finite(n) for n in numbers)
        except (argparse.ArgumentTypeError, ValueError) as error:
            raise SettingsError(f"goal of '{name}': {error}") from None
        if name in found:
            raise SettingsError(f"'{name}' has two goals")
        found[name] = (x, y, theta)
    return found
