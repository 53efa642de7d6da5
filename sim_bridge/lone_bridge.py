"""Only one bridge in a namespace of a domain: a second would set the clock of the first back."""

import time

from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from push_model.settings import SettingsError
from push_ros.names import Names
from push_ros.qos import CLOCK

_GONE = 6.0  # [s] after which one that was killed is forgotten by the graph, see discovery.xml
_PAUSE = 0.02  # [s] between looks


def refuse_second_bridge(node: Node, names: Names, wait: float) -> None:
    """Look for another bridge for some time [s] of wall time, before publishing anything.

    One that was killed stays in the graph for some seconds: it is waited for until it vanishes. One
    that lives is known by its clock.

    Raises
    ------
    SettingsError: a bridge already runs here.
    """
    topic = names.world("poses")
    if not _seen(node, topic, time.monotonic() + wait):
        return
    clock = node.create_subscription(Clock, names.world("clock"), lambda _: None, CLOCK)
    try:
        end = time.monotonic() + _GONE
        while node.count_publishers(topic) > 0:
            with clock.handle:
                ticks = clock.handle.take_message(Clock, False) is not None
            if ticks or time.monotonic() > end:
                where = names.world_space.rstrip("/")
                inside = f", namespace {where}" if where else ""
                raise SettingsError(
                    f"a bridge already runs in domain {node.context.get_domain_id()}{inside}"
                )
            time.sleep(_PAUSE)
    finally:
        node.destroy_subscription(clock)


def _seen(node: Node, topic: str, end: float) -> bool:
    while node.count_publishers(topic) == 0:
        if time.monotonic() >= end:
            return False
        time.sleep(_PAUSE)
    return True
