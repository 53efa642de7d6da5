"""Poses from ``motion_capture_tracking``: one topic of its NamedPoseArray."""

import importlib
from typing import Any

from lab_bridge.pose_drivers import PoseHost, marker_from_ros
from push_model.settings import SettingsError
from push_ros.conversions import time_from_ros
from push_ros.qos import STREAM
from push_scenario.lab import NamedPoseArraySource

PACKAGE = "motion_capture_tracking_interfaces"


class NamedPoseArrayDriver:
    """See PoseDriver. The message type comes from the ROS installation of the lab."""

    def __init__(self, host: PoseHost, source: NamedPoseArraySource) -> None:
        try:
            kind = importlib.import_module(f"{PACKAGE}.msg").NamedPoseArray
        except ImportError as error:
            raise SettingsError(
                f"lab.poses: the ROS package {PACKAGE} is needed, which is built with "
                f"motion_capture_tracking; source its workspace ({error})"
            ) from None
        self._host = host
        self.sources = (source.topic,)
        self._input = host.subscribe(kind, source.topic, self.take, STREAM)

    def take(self, message: Any) -> None:
        """A message of the type."""
        seen = {
            str(named.name): marker_from_ros(named.pose.position, named.pose.orientation)
            for named in message.poses
        }
        self._host.sink.frame(seen, time_from_ros(message.header.stamp))

    def close(self) -> None:
        """See PoseDriver."""
        self._host.node.destroy_subscription(self._input)


DRIVER = NamedPoseArrayDriver
