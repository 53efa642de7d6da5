"""Poses from transforms: the child frame is the name of a body."""

from lab_bridge.pose_drivers import PoseHost, marker_from_ros
from push_ros.conversions import time_from_ros
from push_ros.qos import CHATTER
from push_scenario.lab import TransformSource
from tf2_msgs.msg import TFMessage


class TransformDriver:
    """See PoseDriver. Only direct transforms count; no tree is built."""

    def __init__(self, host: PoseHost, source: TransformSource) -> None:
        self._host, self._frame = host, source.frame.strip("/")
        self.sources = (source.topic,)
        self._input = host.subscribe(TFMessage, source.topic, self._on_transforms, CHATTER)

    def _on_transforms(self, message: TFMessage) -> None:
        for t in message.transforms:
            if self._frame and t.header.frame_id.strip("/") != self._frame:
                continue
            seen = marker_from_ros(t.transform.translation, t.transform.rotation)
            stamp = time_from_ros(t.header.stamp)
            self._host.sink.part(t.child_frame_id.strip("/"), seen, stamp)

    def close(self) -> None:
        """See PoseDriver."""
        self._host.node.destroy_subscription(self._input)


DRIVER = TransformDriver
