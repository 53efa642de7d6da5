"""Send a goal pose and follow the job."""

import argparse
import sys

from planar_push.arguments import add_namespace, add_no_wait, finite, tell, time_to_wait
from push_bringup.systems import check_namespace
from push_model.jobs import JobError

_PATIENCE = 10.0  # [s] wall time for the suite to be found
_TIMEOUT = 300.0  # [s] wall time for the job


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    parser.add_argument("x", type=finite, help="[m] in the map frame")
    parser.add_argument("y", type=finite, help="[m] in the map frame")
    parser.add_argument("theta", type=finite, help="[rad] heading")
    parser.add_argument("--team", default="", help="name of the team, if there are several")
    add_no_wait(parser, "send the goal and do not follow the job")
    add_namespace(parser)


def run(arguments: argparse.Namespace) -> int:
    """0 if the job succeeds, or if its plan waits; otherwise 1, with the reason and its code."""
    from push_bringup.monitor import Monitor

    check_namespace(arguments.namespace)
    check_namespace(arguments.team)
    timeout = time_to_wait(arguments, _TIMEOUT)
    with Monitor(arguments.namespace, arguments.team, on_event=tell) as monitor:
        if not monitor.connect(_PATIENCE):
            teams = monitor.teams
            remedy = (
                f"name a team of the running suite by --team: {', '.join(teams)}"
                if teams and arguments.team not in teams
                else "start a suite with: planar-push launch single (the system torque takes "
                "trajectories, not goals)"
            )
            print(f"error: {monitor.missing()}; {remedy}", file=sys.stderr)
            return 1
        monitor.send_goal((arguments.x, arguments.y, arguments.theta))
        if not timeout:
            return 0
        result = monitor.follow(timeout)
    if result.code is JobError.NONE:
        return 0
    code = "" if result.code is None else f" ({result.code.name})"
    print(f"error: {result.reason}{code}", file=sys.stderr)
    return 1
