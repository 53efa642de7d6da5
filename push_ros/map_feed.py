"""The map of the world as a node uses it: validated, and told when it is another one."""

import time
from collections.abc import Callable

from nav_msgs.msg import OccupancyGrid
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from push_model.occupancy import OccupancyGrid as Grid
from push_ros.conversions import grid_from_ros
from push_ros.diagnostics import Diagnostics
from push_ros.names import Names
from push_ros.qos import LATCHED
from push_ros.validation import InvalidMessage

PATIENCE = 5.0  # [s] wall time that a request waits for the first map


class MapFeed:
    """Subscribes to ``map``; calls ``taken`` with each map that differs from the one before."""

    def __init__(
        self,
        node: Node,
        names: Names,
        diagnostics: Diagnostics,
        taken: Callable[[Grid], None],
    ) -> None:
        self._topic, self._diagnostics, self._taken = names.world("map"), diagnostics, taken
        self._last: Grid | None = None
        node.create_subscription(
            OccupancyGrid,
            self._topic,
            self._on_data,
            LATCHED,
            event_callbacks=diagnostics.subscription_events(self._topic),
        )

    def _on_data(self, message: OccupancyGrid) -> None:
        try:
            grid = grid_from_ros(message)
        except InvalidMessage as error:
            self._diagnostics.refuse(self._topic, str(error))
            return
        if self._last is None or not self._last.equals(grid):
            self._last = grid
            self._taken(grid)


class FirstMap:
    """Lets a request wait for the first map; ``missed`` is called with a sentence when none comes
    in time."""

    def __init__(self, node: Node, names: Names, missed: Callable[[str], None]) -> None:
        self._missed, self._since = missed, 0.0
        self._reason = f"no map has been received on {names.world('map')}"
        self.awaited = False
        """Whether a request waits; set it to False when it has begun or ended."""
        node.create_timer(0.5, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def wait(self) -> None:
        """A request waits from now on."""
        self.awaited, self._since = True, time.monotonic()

    def _on_timer(self) -> None:
        if self.awaited and time.monotonic() - self._since > PATIENCE:
            self.awaited = False
            self._missed(self._reason)
