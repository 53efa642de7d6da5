"""Play a bag back for the viewer: poses, map, plans and states, but no commands."""

import argparse
import signal
import sys
from pathlib import Path

from planar_push.arguments import add_namespace, positive
from push_bringup.systems import check_namespace


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    parser.add_argument("bag")
    parser.add_argument(
        "--factor", type=positive, default=1.0, help="pace of the playback, bag time over wall time"
    )
    add_namespace(parser)


def run(arguments: argparse.Namespace) -> int:
    """0 when all has been played."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from planar_push.arguments import stop_on_signals
    from push_bringup.preparation import check_domain
    from push_record.contents import bag_scenario
    from push_record.player import PlayerNode
    from push_ros.process import Spinner

    check_namespace(arguments.namespace)
    bag = Path(arguments.bag)
    try:
        bag_scenario(bag)
    except ValueError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    check_domain(arguments.namespace)
    stopped = False

    def stop() -> None:
        nonlocal stopped
        stopped = True

    stop_on_signals(stop)
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = PlayerNode(bag, arguments.factor, arguments.namespace)
        spinner = Spinner([node])
        try:
            while not (stopped or node.finished):
                spinner.once(0.05)
        finally:
            spinner.close()
    finally:
        rclpy.try_shutdown()
    print(f"{node.played} messages played")
    return 128 + signal.SIGINT if stopped else 0
