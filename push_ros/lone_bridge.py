"""Only one bridge in a namespace of a domain: a second would set the clock of the first back."""

import time
from typing import IO, Any

from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from push_model.settings import SettingsError
from push_msgs.msg import Poses
from push_ros.claims import claim_world
from push_ros.latched import publishers
from push_ros.names import Names
from push_ros.qos import CLOCK, STREAM

_POSES = "push_msgs/msg/Poses"
_GONE = 6.0  # [s] after which one that was killed is forgotten by the graph, see discovery.xml
_PAUSE = 0.02  # [s] between looks


def refuse_second_bridge(node: Node, names: Names, wait: float) -> IO[str]:
    """Claim the world, and look for another bridge for some time [s], before publishing anything.

    Returns the claim, to be closed with the bridge. One on this machine is known by its claim. One
    that was killed stays in the graph for some seconds: it is waited for until it vanishes. One
    that lives is known by its clock, or by its poses where it is the bridge to a lab.

    Raises
    ------
    SettingsError: a bridge already runs here.
    """
    domain = str(node.context.get_domain_id())
    where = names.world_space.rstrip("/")
    inside = f", namespace {where}" if where else ""
    begun = f"a bridge already runs in domain {domain}{inside}"
    claim = claim_world(domain, names.world_space)
    if claim is None:
        raise SettingsError(f"{begun}, or a calibration or drive test")
    topic = names.world("poses")
    if not _seen(node, topic, time.monotonic() + wait):
        return claim
    signs = [
        (kind, node.create_subscription(kind, names.world(name), lambda _: None, qos))
        for kind, name, qos in ((Clock, "clock", CLOCK), (Poses, "poses", STREAM))
    ]
    try:
        end = time.monotonic() + _GONE
        while publishers(node, topic, _POSES):
            if any(_taken(sign, kind) for kind, sign in signs) or time.monotonic() > end:
                claim.close()
                raise SettingsError(begun)
            time.sleep(_PAUSE)
    finally:
        for _, sign in signs:
            node.destroy_subscription(sign)
    return claim


def _taken(subscription: Any, kind: Any) -> bool:
    with subscription.handle:
        return subscription.handle.take_message(kind, False) is not None


def _seen(node: Node, topic: str, end: float) -> bool:
    while not publishers(node, topic, _POSES):
        if time.monotonic() >= end:
            return False
        time.sleep(_PAUSE)
    return True
