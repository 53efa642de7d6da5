"""Settings of the two-layer push planner."""

import math
from typing import Literal

from push_model.settings import SettingsError, bounded, settings


@settings
class PlannerSettings:
    """Names follow section 2.2; lengths in [m], angles in [rad]."""

    planner: Literal["lazy", "thesis"] = bounded(
        "lazy",
        doc="Layer 2: lazy A* with improvements, or Algorithms 1 and 2 of the thesis as printed",
    )
    length_weight: float = bounded(
        1.0, low=0.0, high=100.0, doc="Weight lambda_1 of the path length in (2.1)"
    )
    clearance_weight: float = bounded(
        0.05, low=0.0, high=100.0, doc="Weight lambda_2 of the inverse clearance in (2.1) (m^2)"
    )
    clearance_levels: int = bounded(
        4, low=1, high=20, doc="Number of minimum clearances for which a guide path is searched"
    )
    rrt_iterations: int = bounded(
        1200, low=50, high=200000, doc="RRT* iterations for each minimum clearance"
    )
    rrt_range: float = bounded(
        0.3, low=0.02, high=5.0, doc="Longest extension of the RRT* tree (m)"
    )
    waypoint_spacing: float = bounded(
        0.3, low=0.02, high=5.0, doc="Distance between waypoints on the guide path (m)"
    )
    heading_offsets: tuple[float, ...] = bounded(
        (0.0, 0.5, -0.5, 1.0, -1.0), doc="Headings tried at a waypoint, relative to the path (rad)"
    )
    lateral_offsets: tuple[float, ...] = bounded(
        (0.0, 0.25, -0.25, 0.5, -0.5),
        doc="Lateral positions tried at a waypoint, relative to the path (m)",
    )
    run_lengths: tuple[float, ...] = bounded(
        (0.15, 0.3, 0.6), doc="Lengths of runs out of the start and into the goal (m)"
    )
    scattered_poses: tuple[int, ...] = bounded(
        (0, 300, 1000), doc="Random poses near the guide path that are added in each search"
    )
    manoeuvres: int = bounded(
        150,
        low=0,
        high=100000,
        doc="Poses two pushes away from start and goal that each further search adds",
    )
    heuristic_weight: float = bounded(
        3.0,
        low=1.0,
        high=100.0,
        doc="Weight of the estimated cost-to-go, used if a search with weight 1 does not finish",
    )
    max_expansions: int = bounded(
        1200, low=1, high=10000000, doc="Maximum number of pushes evaluated in one search"
    )
    total_expansions: int = bounded(
        7200,
        low=1,
        high=10000000,
        doc="Maximum number of pushes evaluated until a first plan is found",
    )
    improvement_expansions: int = bounded(
        1500, low=0, high=10000000, doc="Maximum number of pushes evaluated after the first plan"
    )
    improvement_poses: int = bounded(
        600, low=0, high=100000, doc="Scattered poses that the first improvement adds"
    )
    refinement: float = bounded(
        0.15,
        low=0.001,
        high=2.0,
        doc="Distance by which improvement rounds move poses (m); halved every two rounds",
    )
    push_cost: float = bounded(
        0.05, low=0.0, high=10.0, doc="Path length that each push costs in addition to its own (m)"
    )
    side_change_cost: float = bounded(
        0.3, low=0.0, high=10.0, doc="Path length that a change of the pushed side costs (m)"
    )
    friction_trust: float = bounded(
        0.75, low=0.1, high=1.0, doc="Fraction of the stable curvature that plans may use"
    )
    safety_distance: float = bounded(
        0.012, low=0.0, high=1.0, doc="Clearance of robot and object to obstacles (m)"
    )
    standoff: float = bounded(
        0.06,
        low=0.005,
        high=2.0,
        doc="Distance behind the contact from which a robot approaches the object (m)",
    )
    push_speed: float = bounded(0.07, low=0.005, high=2.0, doc="Speed of a push (m/s)")
    push_acceleration: float = bounded(
        0.05, low=0.005, high=5.0, doc="Acceleration of a push (m/s^2)"
    )
    move_speed: float = bounded(
        0.1, low=0.005, high=2.0, doc="Speed of the robot without object (m/s)"
    )
    move_acceleration: float = bounded(
        0.15, low=0.005, high=5.0, doc="Acceleration of the robot without object (m/s^2)"
    )
    turn_rate: float = bounded(1.5, low=0.05, high=10.0, doc="Speed of turns in place (rad/s)")
    turn_acceleration: float = bounded(
        3.0, low=0.05, high=50.0, doc="Acceleration of turns in place (rad/s^2)"
    )
    improvement_rounds: int = bounded(
        20, low=0, high=50, doc="Number of improvement searches after the first plan"
    )
    max_preemptive: int = bounded(
        8, low=0, high=100, doc="Maximum number of pre-emptive pushes that are tried"
    )
    seed: int = bounded(1, low=1, high=2**31, doc="Seed of the RRT*")

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
