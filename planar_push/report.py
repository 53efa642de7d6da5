"""Write a report with pictures from a bag."""

import argparse
import sys
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    parser.add_argument("bag")
    parser.add_argument("--out", default="", help="folder; <bag>-report when it is not given")


def run(arguments: argparse.Namespace) -> int:
    """Write them."""
    from push_view.report import write_report

    bag = Path(arguments.bag)
    out = Path(arguments.out) if arguments.out else bag.parent / f"{bag.name}-report"
    try:
        errors = write_report(bag, out)
    except ValueError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(
        f"{out}: final error {1e3 * errors['position_error_m']:.1f} mm, "
        f"{errors['orientation_error_rad']:.3f} rad"
    )
    return 0
