"""The node that estimates at run time what motion capture does not measure, and publishes it.

It subscribes to poses and to the commands of one robot, and publishes intervals of contact
friction, centre of mass and latency on ``belief``. It commands nothing.
"""

import math
import sys
from typing import Any

from rclpy.node import Node

from push_estimation.pose_gate import PoseGateSettings, Stamp
from push_estimation.push_belief import PushPriorSettings
from push_estimation.push_estimates import PushEstimates
from push_estimation.stream_latency import LatencySettings
from push_model.belief import POSES, Interval
from push_model.settings import bounded, settings
from push_msgs.msg import Belief as BeliefMessage
from push_ros.command_feed import CommandFeed, Heard
from push_ros.diagnostics import Diagnostics
from push_ros.names import names_of
from push_ros.parameters import declare_settings
from push_ros.pose_feed import Frame, PoseFeed
from push_ros.process import run_node
from push_ros.qos import BELIEF
from push_ros.report_conversions import belief_to_ros
from push_ros.scheduling import Urgency
from push_scenario.scenario import Scenario, load_scenario

_SHOWN = 10.0  # [s] of pose time for which a contradiction is a warning


@settings
class EstimatorSettings:
    """Whether there is an estimator, and when it publishes."""

    enabled: bool = bounded(
        False,
        doc="Whether the system has an estimator for each robot that pushes an object with a flat "
        "bumper.",
    )
    period: float = bounded(
        1.0,
        low=0.05,
        high=3600.0,
        doc="Shortest time between two beliefs that the estimator publishes (s of pose time).",
    )
    change: float = bounded(
        0.2,
        low=0.0,
        high=1.0,
        doc="Change of a value, or of an end of its interval, above which the estimator publishes "
        "a new belief: a fraction of the width of the interval (dimensionless).",
    )


class EstimatorNode(Node):
    """Estimates for one robot and one object. See ``push_estimation.push_estimates``."""

    def __init__(
        self,
        scenario: Scenario | None = None,
        robot: str = "",
        item: str = "",
        namespace: str = "",
        world: str = "",
    ) -> None:
        """namespace: the team's; world: the bridge's, where it is another one."""
        super().__init__("estimator", namespace=namespace)
        names = names_of(self, world)
        file = self.declare_parameter("scenario", "env1-target1").value
        scenario = scenario or load_scenario(str(file))
        self.robot, spec = scenario.robot(str(self.declare_parameter("robot", robot).value))
        self.object, thing = scenario.object(str(self.declare_parameter("object", item).value))
        values = dict(scenario.parameters.get("estimator", {}))
        push, latency, poses = (values.pop(k, {}) for k in ("push", "latency", "poses"))
        where = "estimator"
        self.settings = declare_settings(self, EstimatorSettings, values, where=where)
        self.estimates = PushEstimates(
            spec,
            thing,
            declare_settings(self, PushPriorSettings, push, "push", f"{where}.push"),
            declare_settings(self, LatencySettings, latency, "latency", f"{where}.latency"),
        )
        gate = declare_settings(self, PoseGateSettings, poses, "poses", f"{where}.poses")
        self.source = "estimator" if len(scenario.robots) == 1 else f"estimator/{self.robot}"
        self._published: dict[tuple[str, str], Interval] = {}
        self._last = -math.inf  # [s] stamp of the last message
        self._told = 0  # contradictions that were logged
        self._diagnostics = Diagnostics(self, names, self._state)
        topic = names.world("belief")
        self._beliefs = self.create_publisher(
            BeliefMessage, topic, BELIEF, event_callbacks=self._diagnostics.publisher_events(topic)
        )
        CommandFeed(self, names, [self.robot], self._diagnostics, self._on_command)
        bodies = [self.robot, self.object]
        self._poses = PoseFeed(self, names, gate, bodies, self._diagnostics, self._on_frame)

    def _on_command(self, heard: Heard) -> None:
        if heard.robot == self.robot:
            self.estimates.command(heard.stamp, heard.vx, heard.omega)

    def _on_frame(self, frame: Frame) -> None:
        if frame.verdict is Stamp.REFUSED:
            return
        if frame.verdict is not Stamp.OK:
            self.estimates.interrupted()
            self._last = min(self._last, self._poses.stamp)
        robot, item = frame.seen.get(self.robot), frame.seen.get(self.object)
        if self.estimates.frame(self._poses.stamp, robot, item):
            self._publish(frame)
        self._tell()

    def _publish(self, frame: Frame) -> None:
        if self._poses.stamp - self._last < self.settings.period:
            return
        believed = {
            (POSES if name == "latency" else self.object, name): interval
            for name, interval in self.estimates.believed().items()
        }
        if not self._differs(believed):
            return
        message = belief_to_ros(self.source, believed)
        message.header.stamp = frame.stamp
        self._beliefs.publish(message)
        self._published, self._last = believed, self._poses.stamp

    def _differs(self, believed: dict[tuple[str, str], Interval]) -> bool:
        if set(believed) != set(self._published):
            return True
        for key, new in believed.items():
            old, least = self._published[key], self.settings.change * new.width
            pairs = ((new.value, old.value), (new.low, old.low), (new.high, old.high))
            if any(abs(a - b) > least for a, b in pairs):
                return True
        return False

    def _tell(self) -> None:
        """Log what contradicted the estimates, once each time that it begins."""
        count = self.estimates.told
        if count > self._told:
            self._told = count
            last = self.estimates.contradictions[-1]
            self.get_logger().warning(f"{', '.join(last.quantities)}: {last.sentence}")

    def _state(self) -> dict[str, Any]:
        estimates, state = self.estimates, dict[str, Any]()
        for name, i in estimates.intervals().items():
            state[name] = f"{i.value:.4g} [{i.low:.4g}, {i.high:.4g}]"
        push = estimates.push
        if push is not None:
            state["metres of push"] = f"{push.way:.2f}"
            state["windows"] = push.windows
            state["windows that no value explains"] = push.strange
            state["intervals widened"] = push.widened + estimates.latency.widened
        now = self._poses.stamp
        recent = [c for c in estimates.contradictions if 0.0 <= now - c.time < _SHOWN]
        if recent:
            state["warning"] = recent[-1].sentence
        return state


def main() -> int:
    """``ros2 run`` entry point."""
    return run_node(EstimatorNode, urgency=Urgency.BACKGROUND)


if __name__ == "__main__":
    sys.exit(main())
