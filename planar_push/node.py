"""Run one node in this process, as ``ros2 run`` would: ROS arguments last, after ``--ros``."""

import argparse
import importlib
import json
import sys

from planar_push.arguments import add_scenario
from push_bringup.node_kinds import MODULES


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    parser.add_argument("name", choices=list(MODULES))
    add_scenario(parser)
    parser.add_argument("--ros", nargs=argparse.REMAINDER, default=[], help="ROS arguments, last")


def run(arguments: argparse.Namespace) -> int:
    """What the node's own ``main`` returns."""
    scenario = f"scenario:={json.dumps(arguments.scenario)}"
    words = ["--ros-args", "-p", scenario, *arguments.ros]
    sys.argv[1:] = words
    return int(importlib.import_module(MODULES[arguments.name]).main())
