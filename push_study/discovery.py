"""Waiting until nodes of one process know each other, without a clock.

How long discovery takes depends on the machine, so a time limit would make a run depend on how busy
it is. What is used instead is that the middleware announces endpoints in order. A probe is a fresh
publisher and a fresh subscription. When the subscription has heard the publisher, whatever was
announced, and whatever latched message was sent, before the probe has had its turn too. If nothing
changes while many probes are heard, one after the other, the nodes will not find each other.
"""

from collections import Counter
from collections.abc import Callable, Hashable, Iterable

from rclpy.action import ActionClient
from rclpy.node import Node
from std_msgs.msg import Empty

from push_ros.process import Spinner
from push_ros.qos import LATCHED

_WAIT = 0.05  # [s] that a spin waits for something to do; it decides nothing
_BETWEEN = 10  # spins from one probe to the next: nodes have timers, which come between
_PROBES = 200  # that are heard without any change before the nodes are given up
_DEAF = 20_000  # spins for which a probe is waited for: the middleware delivers nothing at all
_SETTLED = 3  # probes after which endpoints that are known are matched


class NotDiscovered(RuntimeError):
    """Raised when nodes do not find each other."""


def unmatched(nodes: Iterable[Node]) -> list[str]:
    """Topics, services and actions over which nodes of this process do not reach each other yet.

    A topic is reached when each of its publishers, and each of its subscriptions, has been matched
    with all that the nodes have at the other end. A service or an action is reached when each of
    its clients sees a server.
    """
    nodes = list(nodes)
    publishers = [p for n in nodes for p in n.publishers]
    subscriptions = [s for n in nodes for s in n.subscriptions]
    sent = Counter(p.topic_name for p in publishers)
    heard = Counter(s.topic_name for s in subscriptions)
    missing = [
        p.topic_name
        for p in publishers
        if heard[p.topic_name] and p.get_subscription_count() < heard[p.topic_name]
    ]
    missing += [
        s.topic_name
        for s in subscriptions
        if sent[s.topic_name] and s.get_publisher_count() < sent[s.topic_name]
    ]
    for node in nodes:
        missing += [c.srv_name for c in node.clients if not c.service_is_ready()]
        actions = [w for w in node.waitables if isinstance(w, ActionClient)]
        missing += [f"an action of {node.get_name()}" for a in actions if not a.server_is_ready()]
    return sorted(set(missing))


class Discovery:
    """Waits on the executor of a run. node: of the run; it makes the probes."""

    def __init__(
        self, node: Node, spinner: Spinner, probes: int = _PROBES, between: int = _BETWEEN
    ) -> None:
        """probes: without any change before the nodes are given up; between: spins after each."""
        self._node, self._spinner = node, spinner
        self._most, self._between = probes, between
        self._number = 0

    def wait(self, progress: Callable[[], Hashable], done: Callable[[], bool]) -> None:
        """Spin until done.

        progress: anything that changes as the nodes find each other.

        Raises
        ------
        NotDiscovered: nothing has changed for many probes.
        """
        before, probes = progress(), 0
        while not done():
            self.probe()
            for _ in range(self._between):
                self._spinner.once(_WAIT)
                if done():
                    return
            now = progress()
            probes = probes + 1 if now == before else 0
            before = now
            if probes >= self._most:
                raise NotDiscovered(
                    f"the nodes did not find each other: {probes} endpoints that were created "
                    f"later have been discovered, but nothing else has changed: {now}"
                )

    def settle(self) -> None:
        """Spin until endpoints that are known are matched too."""
        for _ in range(_SETTLED):
            self.probe()

    def probe(self) -> None:
        """Spin until a fresh subscription has heard a fresh publisher."""
        self._number += 1
        topic = f"_probe/p{self._number}"
        heard: list[Empty] = []
        publisher = self._node.create_publisher(Empty, topic, LATCHED)
        subscription = self._node.create_subscription(Empty, topic, heard.append, LATCHED)
        try:
            publisher.publish(Empty())
            for _ in range(_DEAF):
                if heard:
                    return
                self._spinner.once(_WAIT)
            raise NotDiscovered("the middleware delivers nothing within this process")
        finally:
            self._node.destroy_subscription(subscription)
            self._node.destroy_publisher(publisher)
