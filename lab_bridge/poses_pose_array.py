"""Poses from one topic of geometry_msgs/PoseArray, in a given order."""

from geometry_msgs.msg import PoseArray

from lab_bridge.pose_drivers import PoseHost, marker_from_ros
from push_model.settings import SettingsError
from push_ros.conversions import time_from_ros
from push_ros.qos import STREAM
from push_scenario.lab import PoseArraySource


class PoseArrayDriver:
    """See PoseDriver. An array of another length than the order is refused: it might be shifted."""

    def __init__(self, host: PoseHost, source: PoseArraySource) -> None:
        missing = sorted(set(host.markers) - set(source.order))
        if missing:
            raise SettingsError(f"lab.poses.order: {missing} is missing in {list(source.order)}")
        self._host, self._order = host, source.order
        self.sources = (source.topic,)
        self._input = host.subscribe(PoseArray, source.topic, self._on_poses, STREAM)

    def _on_poses(self, message: PoseArray) -> None:
        if len(message.poses) != len(self._order):
            self._host.sink.refuse(
                self.sources[0],
                f"{len(message.poses)} poses, not the {len(self._order)} of lab.poses.order",
            )
            return
        seen = {
            name: marker_from_ros(pose.position, pose.orientation)
            for name, pose in zip(self._order, message.poses, strict=True)
        }
        self._host.sink.frame(seen, time_from_ros(message.header.stamp))

    def close(self) -> None:
        """See PoseDriver."""
        self._host.node.destroy_subscription(self._input)


DRIVER = PoseArrayDriver
