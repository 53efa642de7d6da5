"""Settings of the two-layer push planner."""

import math
from typing import Literal

from push_model.settings import SettingsError, bounded, settings


@settings
class PlannerSettings:
    """Names follow section 2.2; lengths in [m], angles in [rad]."""

    planner: Literal["lazy", "thesis"] = bounded(
        "lazy", doc="layer 2: lazy A* with improvements, or Algorithms 1 and 2 as printed"
    )
    length_weight: float = bounded(1.0, low=0.0, high=100.0, doc="lambda_1 of (2.1)")
    clearance_weight: float = bounded(0.05, low=0.0, high=100.0, doc="lambda_2 of (2.1) [m^2]")
    clearance_levels: int = bounded(4, low=1, high=20, doc="thresholds of the bottleneck sweep")
    rrt_iterations: int = bounded(1200, low=50, high=200000, doc="RRT* iterations per threshold")
    rrt_range: float = bounded(0.3, low=0.02, high=5.0, doc="[m] longest RRT* extension")
    waypoint_spacing: float = bounded(0.3, low=0.02, high=5.0, doc="[m] between waypoints on Gamma")
    heading_offsets: tuple[float, ...] = (0.0, 0.5, -0.5, 1.0, -1.0)
    lateral_offsets: tuple[float, ...] = (0.0, 0.25, -0.25, 0.5, -0.5)
    run_lengths: tuple[float, ...] = (0.15, 0.3, 0.6)
    scattered_poses: tuple[int, ...] = (0, 300, 1000)
    manoeuvres: int = bounded(
        150,
        low=0,
        high=100000,
        doc="poses two pushes from start and goal each, more by so many in each further search",
    )
    heuristic_weight: float = bounded(
        3.0, low=1.0, high=100.0, doc="of the guessed cost, where a search with 1 does not end"
    )
    max_expansions: int = bounded(1200, low=1, high=10000000, doc="pushes tried in one search")
    total_expansions: int = bounded(
        7200, low=1, high=10000000, doc="pushes tried until there is a plan"
    )
    improvement_expansions: int = bounded(
        1500, low=0, high=10000000, doc="pushes tried after the first plan"
    )
    improvement_poses: int = bounded(
        600, low=0, high=100000, doc="scattered poses of the first improvement"
    )
    refinement: float = bounded(
        0.15, low=0.001, high=2.0, doc="[m] by which an improvement moves poses, halved every two"
    )
    push_cost: float = bounded(0.05, low=0.0, high=10.0, doc="[m] added for the stop of each push")
    side_change_cost: float = bounded(0.3, low=0.0, high=10.0, doc="[m] added for a change of side")
    friction_trust: float = bounded(
        0.75, low=0.1, high=1.0, doc="fraction of the stable curvature that plans may use"
    )
    safety_distance: float = bounded(0.012, low=0.0, high=1.0, doc="[m] kept from obstacles")
    standoff: float = bounded(0.06, low=0.005, high=2.0, doc="[m] behind contact, before a push")
    push_speed: float = bounded(0.07, low=0.005, high=2.0, doc="[m/s]")
    push_acceleration: float = bounded(0.05, low=0.005, high=5.0, doc="[m/s^2]")
    move_speed: float = bounded(0.1, low=0.005, high=2.0, doc="[m/s] of the robot alone")
    move_acceleration: float = bounded(0.15, low=0.005, high=5.0, doc="[m/s^2]")
    turn_rate: float = bounded(1.5, low=0.05, high=10.0, doc="[rad/s] on the spot")
    turn_acceleration: float = bounded(3.0, low=0.05, high=50.0, doc="[rad/s^2]")
    improvement_rounds: int = bounded(20, low=0, high=50, doc="searches after the first plan")
    max_preemptive: int = bounded(
        8, low=0, high=100, doc="pre-emptive pushes from whose ends a plan is looked for"
    )
    seed: int = bounded(1, low=1, high=2**31, doc="of the RRT*")

    def __post_init__(self) -> None:
        if self.length_weight == 0.0 and self.clearance_weight == 0.0:
            raise SettingsError("length_weight and clearance_weight must not both be 0")
        if not self.heading_offsets or not self.lateral_offsets:
            raise SettingsError("heading_offsets and lateral_offsets need at least one value")
        if not self.scattered_poses or min(self.scattered_poses) < 0:
            raise SettingsError(
                "scattered_poses: expected counts, one for each search until there is a plan, "
                f"got {list(self.scattered_poses)}"
            )
        for length in self.run_lengths:
            if not 0.0 < length < math.inf:
                raise SettingsError(
                    f"run_lengths: expected lengths above 0 m, got {list(self.run_lengths)}"
                )
        for name in ("heading_offsets", "lateral_offsets"):
            if not all(map(math.isfinite, getattr(self, name))):
                raise SettingsError(
                    f"{name}: expected finite values, got {list(getattr(self, name))}"
                )
