"""Settings of the supervisor."""

from push_model.settings import bounded, settings


@settings
class SupervisorSettings:
    """Tolerances, patience and speeds of a job."""

    auto_execute: bool = True
    position_tolerance: float = bounded(
        0.012, low=1e-3, high=1.0, doc="[m] of the object at the goal"
    )
    orientation_tolerance: float = bounded(0.06, low=1e-3, high=3.2, doc="[rad] at the goal")
    displacement: float = bounded(
        0.02, low=1e-3, high=1.0, doc="[m] off its planned start at which a plan is dropped"
    )
    displacement_turn: float = bounded(0.12, low=1e-3, high=3.2, doc="[rad] likewise")
    max_replans: int = bounded(4, low=0, high=100, doc="new plans within one job")
    max_retries: int = bounded(2, low=0, high=100, doc="further tries to position in a row")
    max_losses: int = bounded(
        40, low=0, high=10000, doc="times in a row that the controller may be gone"
    )
    max_waits: int = bounded(
        10, low=0, high=10000, doc="waits in a row for other bodies to make way"
    )
    wait: float = bounded(
        3.0, low=0.1, high=600.0, doc="[s] of pose time that each of those waits takes"
    )
    approach_speed: float = bounded(0.04, low=1e-3, high=2.0, doc="[m/s] to contact and back")
    acceleration: float = bounded(0.1, low=1e-3, high=10.0, doc="[m/s^2] of those motions")
    detach_distance: float = bounded(0.06, low=5e-3, high=2.0, doc="[m] backed off after a push")
    obstacle_margin: float = bounded(0.008, low=0.0, high=1.0, doc="[m] robot body to obstacles")
    heartbeat_timeout: float = bounded(
        0.25, low=0.05, high=10.0, doc="[s] without the supervisor until a robot stops"
    )
    controller_timeout: float = bounded(
        1.0, low=0.2, high=60.0, doc="[s] without a sign of the controller until it counts as lost"
    )
    node_timeout: float = bounded(
        20.0, low=0.5, high=600.0, doc="[s] wall time to wait for a lost node to return"
    )
    answer_timeout: float = bounded(
        10.0, low=0.5, high=600.0, doc="[s] wall time without a sign of the planner: ask again"
    )
    pose_timeout: float = bounded(
        5.0, low=0.2, high=60.0, doc="[s] wall time without poses until they count as lost"
    )
