"""Signs of life: who gave a robot its task says with every frame that it is still there."""

from rclpy.node import Node
from std_msgs.msg import Header

from push_ros.conversions import time_from_ros
from push_ros.diagnostics import Diagnostics
from push_ros.names import Names
from push_ros.pose_feed import PoseFeed
from push_ros.qos import STREAM

_AHEAD = 1.0  # [s] that a heartbeat's stamp may lie ahead of the poses


class HeartbeatWatch:
    """Listens to a robot's ``heartbeat``. A sender that promised none is not missed."""

    def __init__(
        self, node: Node, names: Names, robot: str, feed: PoseFeed, diagnostics: Diagnostics
    ) -> None:
        self._node, self._feed, self._diagnostics = node, feed, diagnostics
        self._topic = names.robot(robot, "heartbeat")
        self._timeout = 0.0
        self._stamp = self._heard = 0.0
        node.create_subscription(Header, self._topic, self._on_heartbeat, STREAM)

    def begin(self, timeout: float) -> None:
        """From now on a silence longer than timeout [s] is a loss; 0: nothing is watched."""
        self._timeout = timeout
        self._stamp, self._heard = self._feed.stamp, self._feed.clock.now

    def reset(self) -> None:
        """The clock went back."""
        self._stamp = 0.0

    @property
    def lost(self) -> bool:
        """Whether the sender has been silent for too long.

        Live, the silence must be too long in pose time and in wall time: a fast simulation shortens
        the one, a pause lengthens the other. In lockstep the sender must also have left the graph:
        nobody waits for it there, so it may lag behind by any time and still be at work.
        """
        silence, clock = self._feed.stamp - self._stamp, self._feed.clock
        if not clock.lockstep:
            silence = min(silence, clock.now - self._heard)
        if not 0.0 < self._timeout < silence:
            return False
        return not clock.lockstep or int(self._node.count_publishers(self._topic)) == 0

    def _on_heartbeat(self, message: Header) -> None:
        stamp = time_from_ros(message.stamp)
        known = self._feed.stamp > 0.0  # before the first frame nothing is early
        if known and stamp > self._feed.stamp + _AHEAD:
            self._diagnostics.refuse(
                self._topic, f"its stamp lies more than {_AHEAD:g} s ahead of the poses"
            )
            return
        self._stamp = max(self._stamp, stamp)
        self._heard = self._feed.clock.now
