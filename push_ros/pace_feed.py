"""How nodes measure silence: in wall time where the world is live, in pose time in lockstep.

In lockstep the world waits for its controllers, however long they take, so wall time says nothing:
a busy machine, or a process that was stopped for a while, must not change a run. There a node that
is in the ROS graph is only slow, and whatever else is waited for is counted in the time of the
poses. The bridge says on the latched topic ``lockstep`` which of the two holds. Without a word from
it the world is live, as it is in the lab.
"""

import time
from collections.abc import Callable
from weakref import WeakKeyDictionary

from rclpy.node import Node
from std_msgs.msg import Bool

from push_ros.names import Names
from push_ros.qos import LATCHED

_clocks: "WeakKeyDictionary[Node, LivenessClock]" = WeakKeyDictionary()


def pace_known(node: Node) -> bool:
    """Whether the bridge has told a node how the world is paced; true for one that does not ask."""
    clock = _clocks.get(node)
    return clock is None or clock.told


class LivenessClock:
    """A clock for time limits on other nodes and on the pose stream.

    It never goes back. It stands still while the world is paused and, in lockstep, while no poses
    come. Only differences of its readings mean something.
    """

    def __init__(self, node: Node, names: Names, stamp: Callable[[], float]) -> None:
        """stamp: gives the time of the newest accepted poses [s]."""
        self.paused = False
        """Whether the world stands still."""
        self.lockstep = False
        """Whether the world waits for its controllers."""
        self.told = False
        """Whether the bridge has said so."""
        _clocks[node] = self
        self._stamp = stamp
        self._now = 0.0
        self._wall, self._pose_time = time.monotonic(), stamp()
        node.create_subscription(Bool, names.world("paused"), self._on_paused, LATCHED)
        node.create_subscription(Bool, names.world("lockstep"), self._on_lockstep, LATCHED)

    @property
    def now(self) -> float:
        """[s] Time that counts as waiting, since this clock was made."""
        wall, pose_time = time.monotonic(), self._stamp()
        if self.lockstep:
            self._now += max(0.0, pose_time - self._pose_time)
        elif not self.paused:
            self._now += wall - self._wall
        self._wall, self._pose_time = wall, pose_time
        return self._now

    def _on_paused(self, message: Bool) -> None:
        _ = self.now  # what has passed until here is counted as before
        self.paused = bool(message.data)

    def _on_lockstep(self, message: Bool) -> None:
        _ = self.now
        self.lockstep, self.told = bool(message.data), True
