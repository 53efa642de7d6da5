"""Services that people call. The node that answers a call publishes it, so that a bag holds it."""

import json
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from push_msgs.msg import ServiceCall
from push_msgs.srv import Displace, Kill, LoadScenario, Reset
from push_ros.qos import STATUS

CALLS = "service_calls"
"""Topic of the calls, in the namespace of the world and in that of each team."""

KINDS: Mapping[str, Any] = {
    "push_msgs/srv/Displace": Displace,
    "push_msgs/srv/Kill": Kill,
    "push_msgs/srv/LoadScenario": LoadScenario,
    "push_msgs/srv/Reset": Reset,
    "std_srvs/srv/SetBool": SetBool,
    "std_srvs/srv/Trigger": Trigger,
}
"""Types of the services that people call, by name."""
RESTARTS = ("push_msgs/srv/LoadScenario", "push_msgs/srv/Reset")
"""Those after which time begins anew."""


class Services:
    """Creates services of a node and publishes their calls on one topic.

    now: [s] of the world.
    """

    def __init__(self, node: Node, topic: str, now: Callable[[], float]) -> None:
        self._node, self._now = node, now
        self._publisher = node.create_publisher(ServiceCall, topic, STATUS)

    def serve(self, kind: Any, name: str, answer: Callable[[Any, Any], Any]) -> None:
        """Create a service of a full name; ``answer`` fills in and returns the response."""

        def answered(request: Any, response: Any) -> Any:
            response = answer(request, response)
            self._tell(kind, name, request, response)
            return response

        self._node.create_service(kind, name, answered)

    def _tell(self, kind: Any, name: str, request: Any, response: Any) -> None:
        call = ServiceCall(service=name, request=to_json(request))
        call.type = next(n for n, k in KINDS.items() if k is kind)
        nanoseconds = round(1e9 * self._now())
        call.header.stamp.sec = nanoseconds // 1_000_000_000
        call.header.stamp.nanosec = nanoseconds % 1_000_000_000
        call.success, call.message = bool(response.success), str(response.message)
        self._publisher.publish(call)


def to_json(request: Any) -> str:
    """The fields of a request, which are plain values."""
    return json.dumps(
        {name: getattr(request, name) for name in request.get_fields_and_field_types()}
    )


def from_json(kind: Any, text: str) -> Any:
    """A request from its fields.

    Raises
    ------
    ValueError: the text is not such a request.
    """
    try:
        return kind.Request(**json.loads(text))
    except (TypeError, AssertionError, AttributeError) as error:
        raise ValueError(f"no request of {kind.__name__}: {text} ({error})") from None
