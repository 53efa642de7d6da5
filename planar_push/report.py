"""Write a report with pictures from a bag, or from the folder of a study."""

import argparse
import math
import sys
from pathlib import Path

from push_model.settings import SettingsError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    parser.add_argument("bag", help="a bag, or the folder of a study")
    parser.add_argument(
        "--out",
        default="",
        help="folder; <bag>-report when it is not given, or the folder of the study",
    )
    parser.add_argument(
        "--attach", action="store_true", help="also put the report into the bag, as attachments"
    )


def run(arguments: argparse.Namespace) -> int:
    """Write them."""
    from push_record.attach import attach
    from push_view.report import PRODUCTS, write_report
    from push_view.study_report import is_study, write_study_report

    bag = Path(arguments.bag)
    if is_study(bag):
        if arguments.attach:
            raise SettingsError("--attach: a study is no bag; give the bag of a trial")
        out = Path(arguments.out) if arguments.out else bag
        out.mkdir(parents=True, exist_ok=True)
        count = write_study_report(bag, out / "report.html")
        print(f"{out / 'report.html'}: {count} trials")
        return 0
    out = Path(arguments.out) if arguments.out else bag.parent / f"{bag.name}-report"
    try:
        errors = write_report(bag, out)
    except ValueError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    if arguments.attach:
        attach(bag, [out / name for name in PRODUCTS if (out / name).is_file()])
    if math.isnan(errors["position_error_m"]):
        print(f"{out}: no final error, because the bag holds no goal or no pose of the object")
        return 0
    word = "final error" if errors["finished"] else "the recording ends in mid-job; error then"
    print(
        f"{out}: {word} {1e3 * errors['position_error_m']:.1f} mm, "
        f"{errors['orientation_error_rad']:.3f} rad"
    )
    return 0
