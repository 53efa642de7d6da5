"""What a node believes: the scenario's files, and on top of them what comes on ``belief``."""

from collections.abc import Callable

from rclpy.node import Node

from push_model.belief import Belief
from push_msgs.msg import Belief as BeliefMessage
from push_ros.diagnostics import Diagnostics
from push_ros.names import Names
from push_ros.qos import BELIEF
from push_ros.report_conversions import belief_from_ros
from push_ros.validation import InvalidMessage
from push_scenario.scenario import Scenario


def belief_of(scenario: Scenario) -> Belief:
    """What a scenario's files say of its bodies."""
    return Belief(
        {name: spec for name, (spec, _) in scenario.objects.items()},
        {name: spec for name, (spec, _) in scenario.robots.items()},
    )


class BeliefFeed:
    """Subscribes to ``belief``; ``current`` is what is to be used at the next step.

    A message replaces what its source said before. One that cannot be is refused and counted, and
    the belief stays as it was. Sources are applied in the order in which they first spoke.
    """

    def __init__(
        self,
        node: Node,
        names: Names,
        scenario: Scenario,
        diagnostics: Diagnostics,
        changed: Callable[[Belief], None] | None = None,
    ) -> None:
        """changed: called with a belief that differs from the one before."""
        self._node, self._topic = node, names.world("belief")
        self._diagnostics, self._changed = diagnostics, changed
        self._base = self.current = belief_of(scenario)
        self._said: dict[str, BeliefMessage] = {}
        node.create_subscription(
            BeliefMessage,
            self._topic,
            self._on_data,
            BELIEF,
            event_callbacks=diagnostics.subscription_events(self._topic),
        )

    def _on_data(self, message: BeliefMessage) -> None:
        said = {**self._said, message.source: message}
        belief = self._base
        try:
            for each in said.values():
                belief = belief_from_ros(each, belief)
        except InvalidMessage as error:
            self._diagnostics.refuse(self._topic, str(error))
            return
        first, self._said = message.source not in self._said, said
        if belief == self.current:
            return
        self.current = belief
        if first:  # an estimator speaks every second
            self._node.get_logger().info(f"the belief of '{message.source}' is used from now on")
        if self._changed is not None:
            self._changed(belief)
