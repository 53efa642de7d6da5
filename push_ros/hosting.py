"""What a package adds to the node of its method."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from push_ros.commander import Commander
from push_ros.task_server import TaskAction

if TYPE_CHECKING:
    from push_ros.method_node import MethodNode


@dataclass(frozen=True)
class Hosting:
    """What a package adds to the node of its method.

    actions: further actions, made from the node. commander: in the place of the one that sends
    velocities to all robots. attach: called with the node when it is made, e.g. for clients of
    other nodes; its result becomes the ``partners`` of the arena.
    """

    actions: Callable[["MethodNode"], Sequence[TaskAction]] = lambda node: ()
    commander: Callable[["MethodNode"], Commander | None] = lambda node: None
    attach: Callable[["MethodNode"], Any] = lambda node: None
