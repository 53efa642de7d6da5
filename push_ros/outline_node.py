"""The node that estimates the outline of an object while several round robots push it.

It subscribes to poses and to the commands of a team, and publishes the outline on ``belief``. It
commands nothing.
"""

import math
import sys
from typing import Any

import numpy as np
from rclpy.node import Node

from push_estimation.outline_estimate import OutlineSettings
from push_estimation.outline_learner import OutlineLearner
from push_estimation.pose_gate import PoseGateSettings, Stamp
from push_estimation.stopped_robots import StoppedSettings
from push_model.arrays import Array
from push_model.bumpers import RingBumper
from push_model.distance_field import DistanceField
from push_model.occupancy import OccupancyGrid
from push_model.outlines import distance
from push_model.settings import SettingsError, bounded, settings
from push_msgs.msg import Belief as BeliefMessage
from push_ros.command_feed import CommandFeed, Heard
from push_ros.diagnostics import Diagnostics
from push_ros.map_feed import MapFeed
from push_ros.names import names_of
from push_ros.parameters import declare_settings
from push_ros.pose_feed import Frame, PoseFeed
from push_ros.process import run_node
from push_ros.qos import BELIEF
from push_ros.report_conversions import belief_to_ros
from push_ros.scheduling import Urgency
from push_scenario.scenario import Scenario, load_scenario

KIND = "outline_estimator"
_CORNERS = 48  # of a disc
_WALL = 0.03  # [m] between a robot and a wall within which the wall may stop the robot


@settings
class OutlineNodeSettings:
    """Whether outlines are estimated, what is assumed first, and when a message is published."""

    enabled: bool = bounded(
        False,
        doc="Whether a team of robots with ring bumpers has an estimator of the outline of its "
        "object.",
    )
    radius: float = bounded(
        0.0,
        low=0.0,
        high=100.0,
        doc="Radius of a disc about the origin of the object's frame that the outline estimator "
        "assumes as the first outline (m); 0: the outline in the file of the object",
    )
    period: float = bounded(
        1.0, low=0.1, high=3600.0, doc="Time between two estimates of the outline (s of pose time)."
    )
    change: float = bounded(
        1e-3,
        low=0.0,
        high=1.0,
        doc="Distance between the new and the published outline above which the new outline is "
        "published (m).",
    )


class OutlineNode(Node):
    """Estimates for one team and one object. See ``push_estimation.outline_learner``."""

    def __init__(
        self,
        scenario: Scenario | None = None,
        robots: tuple[str, ...] = (),
        item: str = "",
        namespace: str = "",
        world: str = "",
    ) -> None:
        """robots, item: of the team. namespace: the team's; world: the bridge's, where it is
        another one."""
        super().__init__(KIND, namespace=namespace)
        names = names_of(self, world)
        file = self.declare_parameter("scenario", "swarm-square").value
        scenario = scenario or load_scenario(str(file))
        given = self.declare_parameter("robots", list(robots) or [""]).value
        team = tuple(r for r in given if r) or tuple(scenario.robots)
        self.object, thing = scenario.object(str(self.declare_parameter("object", item).value))
        kind = scenario.robot(team[0])[1]
        if not isinstance(kind.bumper, RingBumper):
            raise SettingsError(f"{KIND}: '{team[0]}' has no ring bumper; leave 'enabled' unset")
        values = dict(scenario.parameters.get(KIND, {}))
        outline, stopped, poses = (values.pop(k, {}) for k in ("outline", "stopped", "poses"))
        self.settings = declare_settings(self, OutlineNodeSettings, values, where=KIND)
        first = thing.outline if self.settings.radius == 0.0 else _disc(self.settings.radius)
        self.learner = OutlineLearner(
            first,
            kind.footprint_radius,
            self.settings.period,
            declare_settings(self, OutlineSettings, outline, "outline", f"{KIND}.outline"),
            declare_settings(self, StoppedSettings, stopped, "stopped", f"{KIND}.stopped"),
        )
        gate = declare_settings(self, PoseGateSettings, poses, "poses", f"{KIND}.poses")
        teams = len(scenario.teams) > 1
        self.source = f"outline_estimator/{self.object}" if teams else "outline_estimator"
        self._said: Array | None = None if self.settings.radius else first
        self._forgotten, self._robots = 0, set(team)
        self._diagnostics = Diagnostics(self, names, self._state)
        topic = names.world("belief")
        self._beliefs = self.create_publisher(
            BeliefMessage, topic, BELIEF, event_callbacks=self._diagnostics.publisher_events(topic)
        )
        self._radius = kind.footprint_radius
        self._walls: DistanceField | None = None
        MapFeed(self, names, self._diagnostics, self._take_map)
        self._commands = CommandFeed(self, names, team, self._diagnostics, self._on_command)
        self._poses = PoseFeed(
            *(self, names, gate, [*team, self.object], self._diagnostics, self._on_frame),
            meet=lambda bodies: bodies,
        )

    def _on_command(self, heard: Heard) -> None:
        self._robots.add(heard.robot)  # robots that join the team later too
        self.learner.command(heard.robot, heard.stamp, heard.vx, heard.vy, heard.fixed)

    def _take_map(self, grid: OccupancyGrid) -> None:
        self._walls = DistanceField(grid)

    def _at_wall(self, pose: Array) -> bool:
        """Whether a wall may stop a robot."""
        if self._walls is None:
            return False
        return self._walls.at(float(pose[0]), float(pose[1])) < self._radius + _WALL

    def _on_frame(self, frame: Frame) -> None:
        if frame.verdict is Stamp.REFUSED:
            return
        if frame.verdict is not Stamp.OK:
            self.learner.interrupted()
        seen = dict(frame.seen)
        item = seen.pop(self.object, None)
        if item is None:
            return
        if self._said is None:
            self._publish(frame)
        robots = {n: p for n, p in seen.items() if n in self._robots}
        others = np.array([p[:2] for n, p in seen.items() if n not in robots]).reshape(-1, 2)
        unsure = {n for n, p in robots.items() if self._at_wall(p)}
        if self.learner.frame(self._poses.stamp, item, robots, others, unsure):
            self._tell()
            if self._differs():
                self._publish(frame)

    def _differs(self) -> bool:
        """Whether the outline is another one than the published one."""
        new, old = self.learner.estimate.outline, self._said
        if old is None:
            return True
        away = max(distance(new, old).max(), distance(old, new).max())
        return bool(away > self.settings.change)

    def _publish(self, frame: Frame) -> None:
        self._said = self.learner.estimate.outline
        message = belief_to_ros(self.source, {}, {self.object: self._said})
        message.header.stamp = frame.stamp
        self._beliefs.publish(message)

    def _tell(self) -> None:
        """Log once each time that everything was forgotten."""
        forgotten = self.learner.estimate.forgotten
        if forgotten > self._forgotten:
            self._forgotten = forgotten
            self.get_logger().warning(
                f"the outline of '{self.object}' is estimated anew: robots were where the object "
                "had stopped others"
            )

    def _state(self) -> dict[str, Any]:
        estimate = self.learner.estimate
        return {
            "corners": len(estimate.outline),
            "places where the object stopped robots": len(estimate.sightings.contacts),
            "share of the line of contact explored": f"{estimate.explored():.2f}",
            "estimated anew": estimate.forgotten,
        }


def _disc(radius: float) -> Array:
    angle = np.arange(_CORNERS) * 2.0 * math.pi / _CORNERS
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def main() -> int:
    """``ros2 run`` entry point."""
    return run_node(OutlineNode, urgency=Urgency.BACKGROUND)


if __name__ == "__main__":
    sys.exit(main())
