"""To listen in for a moment: what is latched on a topic, and who publishes there."""

import contextlib
import os
from collections.abc import Iterator
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from push_ros.process import Spinner, prepare_environment
from push_ros.qos import LATCHED


@contextlib.contextmanager
def own_context() -> Iterator[Any]:
    """A ROS context beside whatever this process has, in the domain of the environment."""
    prepare_environment()
    context = rclpy.Context()
    rclpy.init(args=[], context=context, signal_handler_options=SignalHandlerOptions.NO)
    try:
        yield context
    finally:
        rclpy.try_shutdown(context=context)


@contextlib.contextmanager
def visitor(context: Any = None) -> Iterator[tuple[Node, Spinner]]:
    """A node without a purpose of its own, in a context of its own unless one is given."""
    with contextlib.ExitStack() as stack:
        if context is None:
            context = stack.enter_context(own_context())
        node = rclpy.create_node(
            f"visitor_{os.getpid()}",
            context=context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
        spinner = Spinner([node], context)
        stack.callback(spinner.close)
        yield node, spinner


def hear_latched(message_type: Any, topic: str, limit: float, context: Any = None) -> Any | None:
    """The message that is latched on a topic; None when none comes within limit [s]."""
    heard: list[Any] = []
    with visitor(context) as (node, spinner):
        node.create_subscription(message_type, topic, heard.append, LATCHED)
        spinner.until(lambda: bool(heard), limit)
    return heard[-1] if heard else None


def publishers(node: Node, topic: str, kind: str = "") -> int:
    """How many publish on a topic, of one type where it is given, e.g. ``push_msgs/msg/Poses``.

    A motion-capture driver may use the name of one of our topics for a type of its own.
    """
    count = int(node.count_publishers(topic))
    if not count or not kind:
        return count
    return sum(i.topic_type == kind for i in node.get_publishers_info_by_topic(topic))


def has_publisher(topic: str, limit: float, context: Any = None, kind: str = "") -> bool:
    """Whether somebody publishes on a topic; he has limit [s] of wall time to be discovered.

    kind: type of the messages; any where it is not given.
    """
    with visitor(context) as (node, spinner):
        return spinner.until(lambda: publishers(node, topic, kind) > 0, limit)
