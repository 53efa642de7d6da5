"""Copy the readable part of a truncated bag."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    parser.add_argument("bag")
    parser.add_argument("--out", required=True, help="folder of the new bag")


def run(arguments: argparse.Namespace) -> int:
    """0 if anything could be read."""
    from push_record.bag import recover

    count = recover(Path(arguments.bag), Path(arguments.out))
    print(f"{count} messages recovered into {arguments.out}")
    return 0 if count else 1
