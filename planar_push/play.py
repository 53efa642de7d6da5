"""Play bags back on the page, or publish one again for RViz and similar tools."""

import argparse
import signal
import sys
import time
from pathlib import Path

from planar_push.arguments import add_namespace, add_port, positive
from push_bringup.systems import check_namespace

_HOST, _PORT = "127.0.0.1", 8080


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    parser.add_argument("bags", nargs="+", metavar="BAG", help="several are shown side by side")
    parser.add_argument("--host", default=None, help="address to serve the page on")
    add_port(parser)
    parser.set_defaults(port=None)
    parser.add_argument(
        "--publish",
        action="store_true",
        help="publish poses, map, plans and states of one bag on their topics instead; no commands",
    )
    parser.add_argument(
        "--factor",
        type=positive,
        default=None,
        help="with --publish: pace of the playback, bag time over wall time",
    )
    add_namespace(parser)


def run(arguments: argparse.Namespace) -> int:
    """Serve the page until a signal; or 0 when all has been published."""
    from push_record.bag import ending
    from push_record.contents import bag_scenario

    bags = [Path(bag) for bag in arguments.bags]
    check_namespace(arguments.namespace)
    wrong = ""
    if arguments.publish and len(bags) > 1:
        wrong = "--publish plays one bag; without it, several are shown on the page"
    elif arguments.publish and (arguments.host is not None or arguments.port is not None):
        wrong = "--host and --port belong to the page; --publish serves none"
    elif not arguments.publish and (arguments.factor is not None or arguments.namespace):
        wrong = "--factor and --namespace belong to --publish; on the page, choose the pace there"
    try:
        for bag in bags:
            bag_scenario(bag)
    except ValueError as error:
        wrong = str(error)
    if wrong:
        print(f"error: {wrong}", file=sys.stderr)
        return 2
    for bag in bags:
        trouble = ending(bag).text
        if trouble:
            print(f"{bag}: {trouble}", flush=True)
    return _publish(bags[0], arguments) if arguments.publish else _serve(bags, arguments)


def _serve(bags: list[Path], arguments: argparse.Namespace) -> int:
    from planar_push.arguments import stop_on_signals
    from push_view.http_answers import page_address
    from push_view.playback_server import PlaybackServer

    host = _HOST if arguments.host is None else arguments.host
    stopped = False

    def stop() -> None:
        nonlocal stopped
        stopped = True

    print(f"reading {len(bags)} bag{'s' if len(bags) > 1 else ''}", flush=True)
    server = PlaybackServer(bags, host, _PORT if arguments.port is None else arguments.port)
    stop_on_signals(stop)
    print(page_address(host, server.port), flush=True)
    try:
        while not stopped:
            time.sleep(0.1)
    finally:
        server.close()
    return 0


def _publish(bag: Path, arguments: argparse.Namespace) -> int:
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from planar_push.arguments import stop_on_signals
    from push_bringup.preparation import check_domain
    from push_record.player import PlayerNode
    from push_ros.process import Spinner

    check_domain(arguments.namespace)
    stopped = False

    def stop() -> None:
        nonlocal stopped
        stopped = True

    stop_on_signals(stop)
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = PlayerNode(bag, arguments.factor or 1.0, arguments.namespace)
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
