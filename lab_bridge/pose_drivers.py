"""Where poses come from: a driver for each kind of source, a file each.

The driver of the kind ``tf`` is ``DRIVER`` of the module ``poses_tf``. One outside the packages is
named as ``MODULE:ATTRIBUTE``.
"""

import importlib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from rclpy.node import Node

from lab_bridge.marker_mapping import Marker
from push_model.outside import from_outside
from push_model.settings import SettingsError
from push_scenario.lab import OtherSource


class PoseSink(Protocol):
    """Takes what a driver hears. Call it on the node's thread only."""

    def part(self, marker: str, seen: Marker, stamp: float | None) -> None:
        """One body of a frame whose bodies arrive one by one.

        marker: its name in motion capture. stamp: [s] of capture, None where it is not known.
        """
        ...

    def frame(self, seen: Mapping[str, Marker], stamp: float | None) -> None:
        """All bodies of one instant, by their names in motion capture."""
        ...

    def refuse(self, where: str, reason: str) -> None:
        """Something that arrived and cannot be used."""
        ...


@dataclass(frozen=True)
class PoseHost:
    """What a driver works with. markers: names in motion capture that are wanted. taken: topics of
    the suite, on which no driver can listen to another type."""

    node: Node
    sink: PoseSink
    markers: tuple[str, ...]
    taken: Collection[str] = ()

    def subscribe(self, kind: Any, topic: str, handler: Callable[[Any], None], qos: Any) -> Any:
        """A subscription of the node.

        Raises
        ------
        SettingsError: the topic is one of the suite's own, or no name of a topic.
        """
        try:
            full = self.node.resolve_topic_name(topic)
        except Exception as error:
            raise SettingsError(
                f"lab.poses.topic: '{topic}' is no name of a topic: {error}"
            ) from None
        if full in self.taken:
            raise SettingsError(
                f"lab.poses.topic: {full} is the suite's own topic; start the motion-capture node "
                f"with the remapping {topic}:=/mocap/poses, and give that name here"
            )
        return self.node.create_subscription(kind, topic, handler, qos)


class PoseDriver(Protocol):
    """A source of poses that has been made for a host."""

    @property
    def sources(self) -> tuple[str, ...]:
        """Topics or addresses that it listens to, for people."""
        ...

    def close(self) -> None:
        """Listen no more."""
        ...


PoseDriverMaker = Callable[[PoseHost, Any], PoseDriver]
"""Makes a driver for a host, from the settings of its source; raises SettingsError."""


def make_pose_driver(host: PoseHost, source: Any) -> PoseDriver:
    """The driver of a source.

    Raises
    ------
    SettingsError: it cannot be found, or it refuses its settings.
    """
    if isinstance(source, OtherSource):
        maker: PoseDriverMaker = from_outside(source.driver, "lab.poses.driver")
        return maker(host, source.settings)
    maker = importlib.import_module(f"lab_bridge.poses_{source.kind}").DRIVER
    return maker(host, source)


def marker_from_ros(position: Any, orientation: Any) -> Marker:
    """From geometry_msgs Point or Vector3, and Quaternion."""
    p, q = position, orientation
    return Marker(np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w]))
