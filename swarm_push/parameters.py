"""The settings of a swarm, of its one node and of its robots' own alike."""

from dataclasses import dataclass
from typing import TypeVar

from rclpy.node import Node

from push_estimation.pose_gate import PoseGateSettings
from push_model.occupancy import OccupancyGrid
from push_model.specs import ObjectSpec, RobotSpec
from push_ros.parameters import declare_settings
from push_scenario.scenario import Scenario
from swarm_push.agent import AgentSettings
from swarm_push.crescent_law import CrescentLawSettings
from swarm_push.laws import LawSections, LawSettings
from swarm_push.object_track import TrackSettings
from swarm_push.region import covered_region, is_open
from swarm_push.swarm_job import SwarmJob, SwarmJobSettings
from swarm_push.thesis_law import ThesisLawSettings

T = TypeVar("T")
_SECTIONS = ("law", "crescent", "thesis", "track", "agents", "poses")


@dataclass(frozen=True)
class SwarmParameters:
    """All of them, and what they make."""

    job: SwarmJobSettings
    laws: LawSections
    track: TrackSettings
    agents: AgentSettings
    poses: PoseGateSettings

    def make_job(self, grid: OccupancyGrid, item: ObjectSpec, robot: RobotSpec) -> SwarmJob | str:
        """For a map; where there can be none, why not."""
        region = covered_region(grid, robot.footprint_radius)
        if region is None:
            return "the map has no room for a robot"
        if not is_open(grid) and self.laws.law.law == "thesis":
            return "the map has obstacles, of which the printed law knows nothing"
        return SwarmJob(region, item, robot, self.job, self.laws, grid, self.track)


def declare_swarm(node: Node, scenario: Scenario) -> SwarmParameters:
    """A node's parameters, from those of ``swarm`` in a scenario."""
    values = dict(scenario.parameters.get("swarm", {}))
    sections = {k: values.pop(k, {}) for k in _SECTIONS}

    def declared(cls: type[T], name: str) -> T:
        return declare_settings(node, cls, sections[name], name, f"swarm.{name}")

    return SwarmParameters(
        declare_settings(node, SwarmJobSettings, values, where="swarm"),
        LawSections(
            declared(LawSettings, "law"),
            declared(CrescentLawSettings, "crescent"),
            declared(ThesisLawSettings, "thesis"),
        ),
        declared(TrackSettings, "track"),
        declared(AgentSettings, "agents"),
        declared(PoseGateSettings, "poses"),
    )
