"""/diagnostics: one status a node, with its counters and its complaints."""

from collections.abc import Callable, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node

from push_ros.qos import STATUS


class Diagnostics:
    """Publishes a node's state once a second of wall time, and counts QoS mismatches."""

    def __init__(self, node: Node, values: Callable[[], Mapping[str, Any]]) -> None:
        """``values`` gives the current key-value pairs; a key ``warning`` or ``error`` that is not
        empty sets the level."""
        self._node = node
        self._values = values
        self.refused: dict[str, int] = {}
        self.last_refusal = ""
        self.qos_mismatches: dict[str, int] = {}
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", STATUS)
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
            f"a {kind} of {topic} has an incompatible QoS ({info.last_policy_kind})"
        )

    def publish(self) -> None:
        """Publish now."""
        values = dict(self._values())
        for topic, count in self.refused.items():
            values[f"refused {topic}"] = count
        for topic, count in self.qos_mismatches.items():
            values[f"incompatible QoS {topic}"] = count
        status = DiagnosticStatus(name=self._node.get_name(), hardware_id="planar-push")
        error, warning = str(values.pop("error", "")), str(values.pop("warning", ""))
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
