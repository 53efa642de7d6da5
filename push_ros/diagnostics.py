"""/diagnostics: one status a node, with its counters and its complaints."""

from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node

from push_ros.names import Names
from push_ros.qos import STATUS


class Diagnostics:
    """Publishes a node's state once a second of wall time, and counts QoS mismatches."""

    def __init__(self, node: Node, names: Names, values: Callable[[], Mapping[str, Any]]) -> None:
        """``values`` gives the current key-value pairs; a key ``warning`` or ``error`` that is not
        empty sets the level."""
        self._node = node
        self._values = values
        self.refused: dict[str, int] = {}
        self.last_refusal = ""
        self.qos_mismatches: dict[str, int] = {}
        self.rivals: set[str] = set()  # topics that have more than one publisher now
        self._single: list[str] = []
        self._publisher = node.create_publisher(DiagnosticArray, names.world("diagnostics"), STATUS)
        self._timer = node.create_timer(
            1.0, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def refuse(self, topic: str, reason: str) -> None:
        """Count a refused message; the first few of each kind are logged."""
        count = self.refused.get(topic, 0) + 1
        self.refused[topic] = count
        self.last_refusal = f"{topic}: {reason}"
        if count <= 3:
            self._node.get_logger().warning(f"refused a message on {self.last_refusal}")

    def subscription_events(self, topic: str) -> SubscriptionEventCallbacks:
        """Event callbacks that report publishers whose QoS does not fit."""
        return SubscriptionEventCallbacks(
            incompatible_qos=lambda info: self._mismatch(topic, "publisher", info)
        )

    def publisher_events(self, topic: str) -> PublisherEventCallbacks:
        """Event callbacks that report subscriptions whose QoS does not fit."""
        return PublisherEventCallbacks(
            incompatible_qos=lambda info: self._mismatch(topic, "subscription", info)
        )

    def _mismatch(self, topic: str, kind: str, info: Any) -> None:
        self.qos_mismatches[topic] = info.total_count
        self._node.get_logger().warning(
            f"a {kind} of {topic} has an incompatible QoS ({info.last_policy_kind}), so no "
            "messages arrive; use the QoS that the README lists"
        )

    def watch_publishers(self, topic: str) -> None:
        """Warn when more than one publishes on a topic that is to have one source."""
        self._single.append(topic)

    def _rivals(self) -> str:
        """What to warn of: topics with more than one publisher. Each is logged once."""
        found = []
        for topic in self._single:
            count = int(self._node.count_publishers(topic))
            if count > 1:  # of one type: those of another one are not heard
                infos = self._node.get_publishers_info_by_topic(topic)
                kinds = Counter(info.topic_type for info in infos)
                count = max(kinds.values(), default=0)
            if count > 1:
                found.append(f"{count} publishers on {topic}")
                if topic not in self.rivals:
                    self._node.get_logger().warning(f"{found[-1]}; stop all but one")
                self.rivals.add(topic)
            else:
                self.rivals.discard(topic)
        return "; ".join(found)

    def publish(self) -> None:
        """Publish now."""
        values = dict(self._values())
        rivals = self._rivals()
        for topic, count in self.refused.items():
            values[f"refused {topic}"] = count
        for topic, count in self.qos_mismatches.items():
            values[f"incompatible QoS {topic}"] = count
        status = DiagnosticStatus(
            name=self._node.get_fully_qualified_name().strip("/"), hardware_id="planar-push"
        )
        error, warning = str(values.pop("error", "")), str(values.pop("warning", "")) or rivals
        status.level = DiagnosticStatus.OK
        status.message = "running"
        if self.qos_mismatches or warning:
            status.level = DiagnosticStatus.WARN
            status.message = warning or "incompatible QoS"
        if error:
            status.level = DiagnosticStatus.ERROR
            status.message = error
        if self.last_refusal:
            values["last refusal"] = self.last_refusal
        status.values = [KeyValue(key=str(k), value=str(v)) for k, v in values.items()]
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)
