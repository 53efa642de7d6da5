"""Settings of the two-layer push planner."""

import math
from typing import Literal

from push_model.settings import SettingsError, bounded, settings


@settings
class PlannerSettings:
    """Names follow section 2.2; lengths in [m], angles in [rad]."""

    planner: Literal["lazy", "thesis"] = bounded(
        "lazy",
        doc="Search for the push sequence (layer 2): 'lazy' (lazy A* with improvements), or "
        "'thesis' (Algorithms 1 and 2 as printed)",
    )
    length_weight: float = bounded(
        1.0,
        low=0.0,
        high=100.0,
        doc="Weight lambda_1 of the path length in the cost of a guide path, (2.1) of the thesis "
        "(dimensionless)",
    )
    clearance_weight: float = bounded(
        0.05,
        low=0.0,
        high=100.0,
        doc="Weight lambda_2 of the inverse clearance in the cost of a guide path, (2.1) of the "
        "thesis (m^2)",
    )
    clearance_levels: int = bounded(
        4, low=1, high=20, doc="Number of minimum clearances for which a guide path is searched"
    )
    rrt_iterations: int = bounded(
        1200, low=50, high=200000, doc="RRT* iterations for each minimum clearance"
    )
    rrt_range: float = bounded(
        0.3, low=0.02, high=5.0, doc="Longest extension of the RRT* tree in one iteration (m)"
    )
    waypoint_spacing: float = bounded(
        0.3, low=0.02, high=5.0, doc="Distance between waypoints on the guide path (m)"
    )
    heading_offsets: tuple[float, ...] = bounded(
        (0.0, 0.5, -0.5, 1.0, -1.0),
        doc="Headings of the object that are tried at a waypoint, relative to the guide path (rad)",
    )
    lateral_offsets: tuple[float, ...] = bounded(
        (0.0, 0.25, -0.25, 0.5, -0.5),
        doc="Lateral positions of the object that are tried at a waypoint, relative to the "
        "guide path (m)",
    )
    run_lengths: tuple[float, ...] = bounded(
        (0.15, 0.3, 0.6),
        doc="Lengths of the pushes from the start and to the goal whose other ends are tried as "
        "poses of the object (m)",
    )
    scattered_poses: tuple[int, ...] = bounded(
        (0, 300, 1000),
        doc="Numbers of random object poses near the guide path, one for each search until a "
        "plan is found",
    )
    manoeuvres: int = bounded(
        150,
        low=0,
        high=100000,
        doc="Number of object poses, two pushes away from start or goal, that each further search "
        "adds",
    )
    heuristic_weight: float = bounded(
        3.0,
        low=1.0,
        high=100.0,
        doc="Weight of the estimated cost-to-go in a repeated search, after a search with weight "
        "1 has reached max_expansions without a plan (dimensionless)",
    )
    max_expansions: int = bounded(
        1200, low=1, high=10000000, doc="Maximum number of pushes that one search evaluates"
    )
    total_expansions: int = bounded(
        30000,
        low=1,
        high=10000000,
        doc="Maximum number of pushes that are evaluated until a first plan is found. A last, "
        "long search uses what the searches before it have left",
    )
    improvement_expansions: int = bounded(
        1500,
        low=0,
        high=10000000,
        doc="Maximum number of pushes that are evaluated after the first plan, to lower its cost",
    )
    improvement_poses: int = bounded(
        600,
        low=0,
        high=100000,
        doc="Number of random object poses that the first search after the first plan adds",
    )
    arc_nodes: int = bounded(
        150000,
        low=100,
        high=15000000,
        doc="Maximum number of object poses in each of the two searches over arcs (forward and "
        "backward), which look for a plan with a lower cost",
    )
    refinement: float = bounded(
        0.15,
        low=0.001,
        high=2.0,
        doc="Distance by which searches after the first plan move the poses of the best plan "
        "(m); halved every two rounds",
    )
    bound_boxes: int = bounded(
        2000,
        low=0,
        high=10000000,
        doc="Maximum number of boxes of object poses that are divided to raise the lower bound on "
        "the cost of the final plan",
    )
    contact_time: float = bounded(
        2.5,
        low=0.0,
        high=100.0,
        doc="Time that each change of the pushed side costs in a plan for backing off and "
        "approaching, in addition to the drive around the object (s)",
    )
    friction_trust: float = bounded(
        0.75,
        low=0.1,
        high=1.0,
        doc="Fraction of the limits of the stable curvature that plans may use; the rest is a "
        "margin for lower friction (dimensionless)",
    )
    certified_trust: float = bounded(
        0.9,
        low=0.1,
        high=1.0,
        doc="Fraction of the certified curvature limits that plans may use, where it allows more "
        "than friction_trust. Within these limits a push is stable for all frictions and centres "
        "of mass within the believed intervals (dimensionless)",
    )
    easing: float = bounded(
        0.06,
        low=0.0,
        high=1.0,
        doc="Fraction by which the final plan may cost more than the cheapest one, if its pushes "
        "then have wider bends; 0 keeps the cheapest plan (dimensionless)",
    )
    safety_distance: float = bounded(
        0.012,
        low=0.0,
        high=1.0,
        doc="Least clearance of robot and object to obstacles in a plan (m)",
    )
    standoff: float = bounded(
        0.06,
        low=0.005,
        high=2.0,
        doc="Distance behind the contact from which a robot approaches the object (m)",
    )
    push_speed: float = bounded(
        0.125,
        low=0.005,
        high=2.0,
        doc="Greatest speed of the robot during a push (m/s); on curves the wheels and "
        "wheel_reserve may require a lower one",
    )
    push_acceleration: float = bounded(
        0.3,
        low=0.005,
        high=5.0,
        doc="Acceleration of the robot at the beginning and at the end of a push (m/s^2)",
    )
    wheel_reserve: float = bounded(
        0.04,
        low=0.0,
        high=0.9,
        doc="Fraction of the maximum wheel speed that planned motions do not use, so that the "
        "controller can correct errors (dimensionless)",
    )
    move_speed: float = bounded(
        0.125, low=0.005, high=2.0, doc="Greatest speed of the robot between two pushes (m/s)"
    )
    move_acceleration: float = bounded(
        0.5, low=0.005, high=5.0, doc="Acceleration of the robot between two pushes (m/s^2)"
    )
    turn_rate: float = bounded(
        4.0,
        low=0.05,
        high=10.0,
        doc="Greatest turn rate of the robot when it turns in place between two pushes (rad/s)",
    )
    turn_acceleration: float = bounded(
        12.0,
        low=0.05,
        high=50.0,
        doc="Greatest angular acceleration of the robot between two pushes (rad/s^2). A wide robot "
        "turns more slowly: no wheel accelerates by more than move_acceleration",
    )
    improvement_rounds: int = bounded(
        20, low=0, high=50, doc="Maximum number of searches after the first plan, to lower its cost"
    )
    max_preemptive: int = bounded(
        8, low=0, high=100, doc="Maximum number of pre-emptive pushes that are tried"
    )
    max_turning: int = bounded(
        6,
        low=0,
        high=100,
        doc="Maximum number of pushes on a corner of the object that are tried as pre-emptive "
        "pushes",
    )
    seed: int = bounded(
        1,
        low=1,
        high=2**31,
        doc="Seed of the random numbers of the planner (RRT* and random poses)",
    )

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
