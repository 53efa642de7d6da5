"""Settings of the LTV-MPC and of the trajectory tracker around it."""

from typing import Literal

from push_model.settings import SettingsError, bounded, settings


@settings
class ControllerSettings:
    """Of the node itself."""

    controller: str = bounded("ltv", doc="which predictive controller, by name")


@settings
class MpcSettings:
    """Names follow section 2.4.5.

    A softened row may be violated by its kind's ``max_..._slack``; beyond, the robot stops. With
    the noise of a motion capture the violation of a job that goes well is zero, so the bounds say
    what is still harmless. Wheels saturate anyway. 0.02 rad/s is what ``friction_trust`` leaves of
    an e-puck's curvature at the speed of a push. 5 mm are more than noise and dead reckoning
    displace a robot by, and less than the 8 mm that the supervisor adds to the circles.
    """

    step: float = bounded(0.1, low=0.01, high=1.0, doc="[s] T_s of the prediction")
    horizon: int = bounded(20, low=2, high=100, doc="p, steps predicted")
    state_weight: tuple[float, float, float, float, float] = (40.0, 60.0, 1.0, 0.5, 0.02)
    terminal_factor: float = bounded(5.0, low=0.0, high=1000.0, doc="P = factor * Q")
    input_weight: tuple[float, float] = (0.05, 0.002)
    input_rate_weight: tuple[float, float] = (0.05, 0.002)
    max_acceleration: float = bounded(0.3, low=0.01, high=20.0, doc="[m/s^2]")
    max_turn_acceleration: float = bounded(6.0, low=0.01, high=200.0, doc="[rad/s^2]")
    max_acceleration_change: float = bounded(0.3, low=0.001, high=50.0, doc="[m/s^2] per step")
    max_turn_acceleration_change: float = bounded(
        6.0, low=0.001, high=500.0, doc="[rad/s^2] per step"
    )
    max_obstacles: int = bounded(20, low=0, high=200, doc="nearest obstacles in the QP")
    slack_linear: float = bounded(1000.0, low=0.0, high=1e6, doc="price of a softened row")
    slack_quadratic: float = bounded(20000.0, low=1e-3, high=1e8, doc="price of a softened row")
    max_wheel_slack: float = bounded(
        0.01,
        low=1e-6,
        high=100.0,
        doc="[m/s] of a wheel beyond its limit that is tolerated",
    )
    max_curvature_slack: float = bounded(
        0.02, low=1e-6, high=100.0, doc="[rad/s] beyond the stable curvature that is tolerated"
    )
    max_obstacle_slack: float = bounded(
        0.005, low=1e-6, high=100.0, doc="[m] inside an obstacle's circle that is tolerated"
    )
    backend: Literal["active_set", "daqp", "osqp"] = "active_set"

    def __post_init__(self) -> None:
        if min(self.state_weight) < 0.0 or min(self.input_rate_weight) < 0.0:
            raise SettingsError("weights must not be negative")
        if min(self.input_weight) <= 0.0:
            raise SettingsError("input_weight must be positive: without it there are many optima")


@settings
class ContactForceSettings(MpcSettings):
    """Of the controller with contact forces, sections 2.4.5-2.4.6."""

    force_weight: float = bounded(0.001, low=1e-6, high=1e3, doc="R_u of each contact force")
    constraint: bool = bounded(True, doc="whether (2.53) is asked for; without it for comparison")


@settings
class TrackerSettings:
    """When a trajectory is done, and when it has gone wrong."""

    tracked: Literal["object", "robot"] = bounded(
        "object", doc="what a push steers; the thesis steers the robot and hopes for the object"
    )
    friction_trust: float = bounded(
        0.85, low=0.1, high=1.0, doc="fraction of the stable curvature the controller may use"
    )
    pose_delay: float = bounded(0.0, low=0.0, high=1.0, doc="[s] latency of the pose stream")
    give_up: float = bounded(
        5.0, low=0.1, high=600.0, doc="[s] without poses until a task is given up"
    )
    position_tolerance: float = bounded(0.006, low=1e-4, high=1.0, doc="[m] at the end")
    orientation_tolerance: float = bounded(0.03, low=1e-4, high=3.2, doc="[rad] at the end")
    settle_time: float = bounded(3.0, low=0.0, high=60.0, doc="[s] to reach the tolerance")
    grasp_filter: float = bounded(0.2, low=0.0, high=10.0, doc="[s] time constant, object in robot")
    rest_speed: float = bounded(0.01, low=1e-4, high=1.0, doc="[m/s] that counts as at rest")
    rest_turn_rate: float = bounded(0.1, low=1e-3, high=10.0, doc="[rad/s] that counts as at rest")
    lag_begin: float = bounded(0.02, low=1e-3, high=1.0, doc="[m] lag that slows the reference")
    lag_end: float = bounded(0.06, low=2e-3, high=1.0, doc="[m] lag that halts the reference")
    contact_gap: float = bounded(0.015, low=1e-3, high=1.0, doc="[m] object to bumper")
    contact_aside: float = bounded(
        0.045, low=1e-3, high=1.0, doc="[m] object along the bumper, from its place"
    )
    contact_turn: float = bounded(0.25, low=0.01, high=3.2, doc="[rad] object against bumper")
    contact_time: float = bounded(0.5, low=0.0, high=10.0, doc="[s] until contact counts as lost")
    off_course: float = bounded(0.08, low=1e-3, high=5.0, doc="[m] from the reference")
    deadline: float = bounded(
        0.0, low=0.0, high=10.0, doc="[s] wall time a solve may take in live use; 0: not watched"
    )
    solver_patience: int = bounded(
        10, low=1, high=10000, doc="failed or late solves in a row that end the task"
    )
    fade_time: float = bounded(
        0.1, low=1e-3, high=10.0, doc="[s] in which the command fades to zero while solves are late"
    )
    stuck_time: float = bounded(1.5, low=0.1, high=60.0, doc="[s] commanded but not moving")
    stuck_way: float = bounded(0.03, low=1e-3, high=1.0, doc="[m] commanded in that time")
    blocked_time: float = bounded(
        4.0, low=0.1, high=600.0, doc="[s] that the reference waits for a robot that lags behind"
    )

    def __post_init__(self) -> None:
        if self.lag_end <= self.lag_begin:
            raise SettingsError(
                f"lag_end ({self.lag_end}) must be greater than lag_begin ({self.lag_begin})"
            )
