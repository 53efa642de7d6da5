"""Record the suite's topics until Ctrl-C."""

import argparse
from pathlib import Path

from planar_push.arguments import add_namespace, add_scenario
from push_bringup.systems import check_namespace


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    add_scenario(parser, None)
    parser.add_argument("--out", required=True, help="bag folder")
    add_namespace(parser)


def run(arguments: argparse.Namespace) -> int:
    """Record until a signal."""
    from push_bringup.preparation import check_bag
    from push_record.recorder import LIVE, RecorderNode, heard_scenario
    from push_ros.process import run_node
    from push_ros.scheduling import Urgency
    from push_scenario.scenario import load_scenario

    check_namespace(arguments.namespace)
    check_bag(Path(arguments.out))
    if arguments.scenario:
        scenario = load_scenario(arguments.scenario)
    else:
        print("waiting for the scenario of a suite", flush=True)
        scenario = heard_scenario(arguments.namespace)

    print(f"recording to {arguments.out} until Ctrl-C", flush=True)

    def make() -> RecorderNode:
        return RecorderNode(
            Path(arguments.out), scenario, namespace=arguments.namespace, about=LIVE
        )

    return int(run_node(make, [], urgency=Urgency.ORDINARY))
