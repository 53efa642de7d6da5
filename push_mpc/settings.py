"""Settings of the LTV-MPC and of the trajectory tracker around it."""

from typing import Literal

from push_model.settings import SettingsError, bounded, settings


@settings
class ControllerSettings:
    """Settings of the node itself."""

    controller: str = bounded(
        "ltv",
        doc="Name of the predictive controller: 'ltv' (LTV-MPC with a curvature constraint), "
        "'contact_force' (LTV-MPC with contact forces), or MODULE:ATTRIBUTE of another one",
    )


@settings
class MpcSettings:
    """Names follow section 2.4.5.

    A soft constraint may be violated by the ``max_..._slack`` of its kind; beyond that the robot
    stops. In normal jobs with motion-capture noise the violation is zero. The bounds are what is
    still harmless: wheels saturate anyway; 0.02 rad/s is less than the margin that
    ``friction_trust`` leaves of an e-puck's curvature at the speed of a push; 5 mm are more than
    noise and dead reckoning displace a robot by, and less than the 8 mm that the supervisor adds
    to the circles.
    """

    step: float = bounded(
        0.1, low=0.01, high=1.0, doc="Length T_s of a predicted step of the MPC (s)"
    )
    horizon: int = bounded(20, low=2, high=100, doc="Number p of predicted steps of the MPC")
    state_weight: tuple[float, float, float, float, float] = bounded(
        (40.0, 60.0, 1.0, 0.5, 0.02),
        doc="Diagonal of the weight matrix Q of the MPC: weights of the squared errors e_x, e_y, "
        "e_theta, e_v, e_omega (in m, m, rad, m/s, rad/s)",
    )
    terminal_factor: float = bounded(
        5.0,
        low=0.0,
        high=1000.0,
        doc="Factor of the terminal weight of the MPC, P = factor * Q (dimensionless)",
    )
    input_weight: tuple[float, float] = bounded(
        (0.05, 0.002),
        doc="Diagonal of the weight matrix R_u of the MPC: weights of the squared linear and "
        "angular acceleration (in m/s^2, rad/s^2)",
    )
    input_rate_weight: tuple[float, float] = bounded(
        (0.05, 0.002),
        doc="Diagonal of the weight matrix R_du of the MPC: weights of the squared changes per "
        "step of the linear and the angular acceleration (in m/s^2, rad/s^2)",
    )
    feedforward: bool = bounded(
        True,
        doc="Whether the MPC, when the robot moves alone, applies input_weight and "
        "input_rate_weight to the accelerations less those of the reference. The robot then "
        "follows a reference that speeds up or brakes without delay. Otherwise, and in a push, "
        "they apply to the accelerations, as in (2.52)",
    )
    max_acceleration: float = bounded(
        0.5, low=0.01, high=20.0, doc="Limit of the linear acceleration (m/s^2)"
    )
    max_turn_acceleration: float = bounded(
        18.0, low=0.01, high=200.0, doc="Limit of the angular acceleration (rad/s^2)"
    )
    max_acceleration_change: float = bounded(
        0.5,
        low=0.001,
        high=50.0,
        doc="Limit of the change of the linear acceleration in one step (m/s^2)",
    )
    max_turn_acceleration_change: float = bounded(
        18.0,
        low=0.001,
        high=500.0,
        doc="Limit of the change of the angular acceleration in one step (rad/s^2)",
    )
    max_obstacles: int = bounded(
        20,
        low=0,
        high=200,
        doc="Greatest number of obstacles for which the controller has constraints; the nearest "
        "ones are taken",
    )
    slack_linear: float = bounded(
        1000.0,
        low=0.0,
        high=1e6,
        doc="Linear penalty on the violation of a soft constraint in the cost of the MPC "
        "(violations in m/s, rad/s, m)",
    )
    slack_quadratic: float = bounded(
        20000.0,
        low=1e-3,
        high=1e8,
        doc="Quadratic penalty on the violation of a soft constraint in the cost of the MPC "
        "(violations in m/s, rad/s, m)",
    )
    max_wheel_slack: float = bounded(
        0.01,
        low=1e-6,
        high=100.0,
        doc="Speed by which a wheel may exceed its limit before the solve counts as failed (m/s)",
    )
    max_curvature_slack: float = bounded(
        0.02,
        low=1e-6,
        high=100.0,
        doc="Turn rate beyond the stable curvature above which the solve counts as failed (rad/s)",
    )
    max_obstacle_slack: float = bounded(
        0.005,
        low=1e-6,
        high=100.0,
        doc="Depth inside the safety circle of an obstacle above which the solve counts as "
        "failed (m)",
    )
    backend: Literal["active_set", "daqp", "osqp"] = bounded(
        "active_set",
        doc="Solver of the quadratic programme of the controller: 'active_set', 'daqp' or 'osqp'",
    )

    def __post_init__(self) -> None:
        if min(self.state_weight) < 0.0 or min(self.input_rate_weight) < 0.0:
            raise SettingsError("weights must not be negative")
        if min(self.input_weight) <= 0.0:
            raise SettingsError("input_weight must be positive: without it there are many optima")


@settings
class ContactForceSettings(MpcSettings):
    """Settings of the controller with contact forces, sections 2.4.5-2.4.6."""

    force_weight: float = bounded(
        0.001,
        low=1e-6,
        high=1e3,
        doc="Weight R_u of each squared contact force in the cost of the contact-force controller; "
        "the forces are scaled and have no unit (dimensionless)",
    )
    constraint: bool = bounded(
        True,
        doc="Whether the contact-force controller uses the pushing constraint (2.53) of the "
        "thesis; false for comparison only",
    )


@settings
class TrackerSettings:
    """When a trajectory is done, and when it has gone wrong."""

    tracked: Literal["object", "robot"] = bounded(
        "object",
        doc="Body whose pose the controller tracks in a push: 'object', or 'robot' as in the "
        "thesis",
    )
    friction_trust: float = bounded(
        0.85,
        low=0.1,
        high=1.0,
        doc="Fraction of the limits of the stable curvature that the controller may use "
        "(dimensionless)",
    )
    slip_warning: float = bounded(
        1.0,
        low=0.0,
        high=60.0,
        doc="Time by which the controller looks ahead along the path of a push for a bend on which "
        "the object may slip (s); without effect until a belief has been published",
    )
    stop_before_slip: bool = bounded(
        True,
        doc="Whether a push ends before a bend on which the object may slip, so that a "
        "new plan is made; otherwise there is only a warning",
    )
    pose_delay: float = bounded(
        0.0, low=0.0, high=1.0, doc="Latency of the pose stream that the controller compensates (s)"
    )
    give_up: float = bounded(
        5.0,
        low=0.1,
        high=600.0,
        doc="Time without poses after which the tracking of a trajectory fails (s)",
    )
    position_tolerance: float = bounded(
        0.006, low=1e-4, high=1.0, doc="Position error allowed at the end of a trajectory (m)"
    )
    orientation_tolerance: float = bounded(
        0.03, low=1e-4, high=3.2, doc="Heading error allowed at the end of a trajectory (rad)"
    )
    settle_time: float = bounded(
        3.0,
        low=0.0,
        high=60.0,
        doc="Time after the end of a trajectory in which its end must be reached within the "
        "tolerances (s)",
    )
    grasp_filter: float = bounded(
        0.2,
        low=0.0,
        high=10.0,
        doc="Time constant of the filter on the object's pose in the robot frame (s)",
    )
    rest_speed: float = bounded(
        0.01, low=1e-4, high=1.0, doc="Speed below which a robot counts as at rest (m/s)"
    )
    rest_turn_rate: float = bounded(
        0.1, low=1e-3, high=10.0, doc="Turn rate below which a robot counts as at rest (rad/s)"
    )
    lag_begin: float = bounded(
        0.02, low=1e-3, high=1.0, doc="Lag of the robot at which the reference slows down (m)"
    )
    lag_end: float = bounded(
        0.06, low=2e-3, high=1.0, doc="Lag of the robot at which the reference stops (m)"
    )
    contact_gap: float = bounded(
        0.015,
        low=1e-3,
        high=1.0,
        doc="Gap between object and bumper above which contact is in doubt (m)",
    )
    contact_aside: float = bounded(
        0.02,
        low=1e-3,
        high=1.0,
        doc="Displacement of the object along the bumper above which contact is in doubt (m)",
    )
    contact_turn: float = bounded(
        0.25,
        low=0.01,
        high=3.2,
        doc="Rotation of the object relative to the bumper above which contact is in doubt (rad)",
    )
    contact_time: float = bounded(
        0.5,
        low=0.0,
        high=10.0,
        doc="Time for which contact may be in doubt before it counts as lost (s)",
    )
    off_course: float = bounded(
        0.08,
        low=1e-3,
        high=5.0,
        doc="Distance of the robot from its reference at which the tracking of a trajectory fails "
        "(m)",
    )
    deadline: float = bounded(
        0.0,
        low=0.0,
        high=10.0,
        doc="Wall time that a solve of the MPC may take in real time (s); a longer solve counts as "
        "late; 0: no limit",
    )
    solver_patience: int = bounded(
        10,
        low=1,
        high=10000,
        doc="Number of failed or late solves in a row after which the tracking of a trajectory "
        "fails",
    )
    fade_time: float = bounded(
        0.1,
        low=1e-3,
        high=10.0,
        doc="Time in which the last command fades to zero while solves are late (s)",
    )
    stuck_time: float = bounded(
        1.5,
        low=0.1,
        high=60.0,
        doc="Length of the time window in which the commanded and the measured motion are compared "
        "to detect a stuck robot (s)",
    )
    stuck_way: float = bounded(
        0.03,
        low=1e-3,
        high=1.0,
        doc="Distance that must be commanded within the time 'stuck_time' before a robot can be "
        "judged as stuck (m)",
    )
    blocked_time: float = bounded(
        4.0,
        low=0.1,
        high=600.0,
        doc="Time that the reference waits for a robot that lags behind before the tracking of a "
        "trajectory fails (s)",
    )

    def __post_init__(self) -> None:
        if self.lag_end <= self.lag_begin:
            raise SettingsError(
                f"lag_end ({self.lag_end}) must be greater than lag_begin ({self.lag_begin})"
            )
