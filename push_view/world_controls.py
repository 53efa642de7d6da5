"""Requests to the world: pause, reset, move a body by hand, make a robot fail."""

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from std_srvs.srv import SetBool

from push_msgs.srv import Displace, Kill, Reset
from push_ros.names import Names

Answer = Callable[[bool, str], None]


class WorldControls:
    """Lives in the executor's thread. A laboratory offers fewer of these services."""

    def __init__(self, node: Node, names: Names) -> None:
        make, at = node.create_client, names.world
        self._clients = {
            "pause": make(SetBool, at("bridge/pause")),
            "reset": make(Reset, at("bridge/reset")),
            "displace": make(Displace, at("displace")),
            "kill": make(Kill, at("bridge/kill")),
        }

    def offered(self) -> list[str]:
        """Names of the requests that some node answers now."""
        return [name for name, client in self._clients.items() if client.service_is_ready()]

    def ask(self, name: str, values: dict[str, Any], answer: Answer) -> None:
        """Send a request; ``answer`` is called with success and a sentence.

        values: for ``pause`` paused; for ``displace`` name, x, y [m], theta [rad]; for ``kill``
        robot.
        """
        client = self._clients[name]
        if not client.service_is_ready():
            answer(False, f"no node answers {client.srv_name}")
            return
        future = client.call_async(_request(name, values))
        future.add_done_callback(lambda f: answer(f.result().success, f.result().message))


def _request(name: str, values: dict[str, Any]) -> Any:
    if name == "pause":
        return SetBool.Request(data=values["paused"])
    if name == "displace":
        x, y, theta = values["x"], values["y"], values["theta"]
        return Displace.Request(name=values["name"], x=x, y=y, theta=theta)
    return Kill.Request(robot=values["robot"]) if name == "kill" else Reset.Request()
