"""Tell a running suite what to believe of its objects, its robots or its pose stream."""

import argparse
import sys
import time
from pathlib import Path

from planar_push.arguments import add_namespace
from push_bringup.systems import check_namespace
from push_model.belief import POSES, QUANTITIES, Belief, BeliefError, Interval

_PATIENCE = 5.0  # [s] wall time until nodes listen
_SETTLE = 0.5  # [s] until they have heard


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    parser.add_argument(
        "values",
        nargs="*",
        metavar="BODY.QUANTITY=VALUE[:LOW:HIGH]",
        help=f"for example box.contact_friction=0.25:0.2:0.3, or latency=0.03; quantities: "
        f"{', '.join(QUANTITIES)}. The values replace all that the same source said before",
    )
    parser.add_argument(
        "--from", dest="file", default="", help="file of planar-push calibrate with further values"
    )
    parser.add_argument("--source", default="", help="who says so; default: person, or the file's")
    add_namespace(parser)


def parsed(text: str) -> tuple[tuple[str, str], Interval]:
    """Body, quantity and interval of one value.

    Raises
    ------
    BeliefError: says what was expected.
    """
    name, equals, numbers = text.partition("=")
    body, _, quantity = name.rpartition(".")
    parts = numbers.split(":")
    if not equals or len(parts) not in (1, 3) or quantity not in QUANTITIES:
        known = ", ".join(QUANTITIES)
        raise BeliefError(f"'{text}': expected BODY.QUANTITY=VALUE[:LOW:HIGH], of {known}")
    try:
        ends = [float(p) for p in parts]
    except ValueError:
        raise BeliefError(f"'{text}': expected numbers after '='") from None
    interval = Interval.exact(ends[0]) if len(ends) == 1 else Interval(*ends)
    return (body or POSES, quantity), interval


def run(arguments: argparse.Namespace) -> int:
    """0 when nodes have heard it."""
    from push_estimation.calibration_file import read_values
    from push_msgs.msg import Belief as BeliefMessage
    from push_record.recorder import heard_scenario
    from push_ros.belief_feed import belief_of
    from push_ros.latched import visitor
    from push_ros.names import space
    from push_ros.qos import BELIEF
    from push_ros.report_conversions import belief_to_ros

    check_namespace(arguments.namespace)
    source, values = "person", dict[tuple[str, str], Interval]()
    try:
        if arguments.file:
            source, values = read_values(Path(arguments.file))
        values |= dict(parsed(text) for text in arguments.values)
        if not values:
            raise BeliefError("no values are given; expected BODY.QUANTITY=VALUE, or --from FILE")
        base: Belief = belief_of(heard_scenario(arguments.namespace))
        base.updated(values)  # it can be
    except BeliefError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    with visitor() as (node, spinner):
        topic = f"{space(arguments.namespace)}belief"
        publisher = node.create_publisher(BeliefMessage, topic, BELIEF)
        if not spinner.until(lambda: publisher.get_subscription_count() > 0, _PATIENCE):
            print(f"error: nobody listens on {topic}", file=sys.stderr)
            return 1
        publisher.publish(belief_to_ros(arguments.source or source, values))
        end = time.monotonic() + _SETTLE
        spinner.until(lambda: time.monotonic() > end, 2.0 * _SETTLE)
    for (body, quantity), interval in values.items():
        name = f"{body}.{quantity}" if body != POSES else quantity
        print(f"{name} = {interval.value:g}, between {interval.low:g} and {interval.high:g}")
    return 0
