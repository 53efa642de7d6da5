"""Show a live view in the browser, where goals can be set by mouse."""

import argparse

from planar_push.arguments import add_namespace, add_port, add_scenario
from push_bringup.systems import check_namespace


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    add_scenario(parser, None)
    add_namespace(parser)
    parser.add_argument("--host", default="127.0.0.1", help="address to serve on")
    add_port(parser)


def run(arguments: argparse.Namespace) -> int:
    """Serve until a signal. The bodies are received from the bridge."""
    from push_bringup.background_suite import BackgroundSuite
    from push_ros.process import run_node
    from push_ros.scheduling import Urgency
    from push_scenario.scenario import load_scenario
    from push_view.http_answers import page_address
    from push_view.page_server import PageServer
    from push_view.viewer_node import ViewerNode

    check_namespace(arguments.namespace)
    scenario = load_scenario(arguments.scenario) if arguments.scenario else None
    server: PageServer | None = None
    starter = BackgroundSuite(arguments.namespace)

    def make() -> ViewerNode:
        nonlocal server
        node = ViewerNode(scenario)
        server = PageServer(node, arguments.host, arguments.port, starter=starter)
        print(page_address(arguments.host, server.port), flush=True)
        return node

    words = ["--ros-args", "-r", f"__ns:=/{arguments.namespace.strip('/')}"]
    try:
        return int(run_node(make, words if arguments.namespace else [], urgency=Urgency.BACKGROUND))
    finally:
        if server is not None:
            server.close()
        starter.close()
