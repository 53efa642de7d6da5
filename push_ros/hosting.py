"""What a package adds to the node of its method."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from push_ros.commander import Commander
from push_ros.task_server import TaskAction

Host = TypeVar("Host")
"""The node that is added to, see ``MethodNode``."""


@dataclass(frozen=True)
class Hosting(Generic[Host]):
    """What a package adds to the node of its method.

    actions: further actions, made from the node. commander: in the place of the one that sends
    velocities to all robots. attach: called with the node when it is made, e.g. for clients of
    other nodes; its result becomes the ``partners`` of the arena.
    """

    actions: Callable[[Host], Sequence[TaskAction]] = lambda node: ()
    commander: Callable[[Host], Commander | None] = lambda node: None
    attach: Callable[[Host], Any] = lambda node: None
