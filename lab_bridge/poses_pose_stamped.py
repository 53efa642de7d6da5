"""Poses from a topic of geometry_msgs/PoseStamped for each body."""

from collections.abc import Callable
from functools import partial

from geometry_msgs.msg import PoseStamped

from lab_bridge.pose_drivers import PoseHost, marker_from_ros
from push_model.settings import SettingsError
from push_ros.conversions import time_from_ros
from push_ros.qos import STREAM
from push_scenario.lab import PoseStampedSource


class PoseStampedDriver:
    """See PoseDriver."""

    def __init__(self, host: PoseHost, source: PoseStampedSource) -> None:
        self._host = host
        if "{name}" not in source.topic and len(host.markers) > 1:
            raise SettingsError(f"lab.poses.topic: '{source.topic}' must contain {{name}}")
        topics = {m: source.topic.replace("{name}", m.replace(" ", "_")) for m in host.markers}
        self.sources = tuple(topics.values())
        self._inputs = []
        for marker, topic in topics.items():
            heard: Callable[[PoseStamped], None] = partial(self._on_pose, marker)
            self._inputs.append(host.subscribe(PoseStamped, topic, heard, STREAM))

    def _on_pose(self, marker: str, message: PoseStamped) -> None:
        seen = marker_from_ros(message.pose.position, message.pose.orientation)
        self._host.sink.part(marker, seen, time_from_ros(message.header.stamp))

    def close(self) -> None:
        """See PoseDriver."""
        for subscription in self._inputs:
            self._host.node.destroy_subscription(subscription)


DRIVER = PoseStampedDriver
