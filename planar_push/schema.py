"""Write the JSON schemas of scenario, robot, object and environment files, for editors."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    parser.add_argument("--out", default="", help="folder; config/schema when it is not given")


def run(arguments: argparse.Namespace) -> int:
    """Write and name them."""
    from push_scenario.files import config_directory
    from push_scenario.schema import write_schemas

    folder = Path(arguments.out) if arguments.out else config_directory() / "schema"
    for path in write_schemas(folder):
        print(path)
    return 0
