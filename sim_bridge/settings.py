"""Settings of the simulated world and of its motion-capture stream."""

from push_model.settings import bounded, settings


@settings
class PhysicsSettings:
    """PyBullet's step and solver."""

    time_step: float = bounded(
        1e-3,
        low=1e-4,
        high=1e-2,
        doc="Longest physics step (s). A control tick is a whole number of steps.",
    )
    solver_iterations: int = bounded(
        100, low=5, high=1000, doc="Iterations of the constraint solver in one physics step."
    )
    foot_stiffness: float = bounded(
        2000.0, low=10.0, high=1e6, doc="Contact stiffness of one foot of an object (N/m)."
    )
    foot_damping: float = bounded(
        20.0, low=0.0, high=1e4, doc="Contact damping of one foot of an object (N s/m)."
    )


@settings
class MotionCaptureSettings:
    """The pose stream."""

    rate: float = bounded(
        100.0, low=1.0, high=1000.0, doc="Frames per second; one control tick per frame (Hz)."
    )
    position_noise: float = bounded(
        0.0,
        low=0.0,
        high=0.1,
        doc="Standard deviation of the white noise on x and on y of every pose (m).",
    )
    orientation_noise: float = bounded(
        0.0,
        low=0.0,
        high=1.0,
        doc="Standard deviation of the white noise on the orientation of every pose (rad).",
    )
    latency: float = bounded(
        0.0,
        low=0.0,
        high=1.0,
        doc="Mean time from the measurement of a frame to its publication (s). Any value is kept "
        "exactly: the time of the measurement may lie between two ticks of the simulation.",
    )
    latency_jitter: float = bounded(
        0.0,
        low=0.0,
        high=0.5,
        doc="Half width of the uniform distribution of the latency about its mean (s). A frame "
        "never overtakes an earlier one.",
    )
    dropout: float = bounded(
        0.0, low=0.0, high=1.0, doc="Probability that a frame misses a body (dimensionless)."
    )


@settings
class BridgeSettings:
    """Pace, safety and publishing of the bridge."""

    world: str = bounded(
        "pybullet", doc="Kind of the simulated world: 'pybullet', 'planar' or 'viscous'."
    )
    lockstep: bool = bounded(
        False,
        doc="Whether the simulation waits in every tick until all commanded robots have answered "
        "the last frame, however long this takes. Otherwise the pace of the simulation is "
        "real_time_factor.",
    )
    real_time_factor: float = bounded(
        1.0,
        low=0.01,
        high=100.0,
        doc="Simulated time per wall time when the world is not in lockstep (dimensionless).",
    )
    command_timeout: float = bounded(
        0.2,
        low=0.01,
        high=5.0,
        doc="A robot is stopped when the frame of poses that its last command answers is older "
        "than this, plus the greatest latency of the poses (s of simulated time).",
    )
    command_timeout_wall: float = bounded(
        0.5,
        low=0.05,
        high=10.0,
        doc="Wall time without a command after which a robot is stopped (s). Unused in lockstep.",
    )
    lockstep_warning: float = bounded(
        2.0,
        low=0.05,
        high=600.0,
        doc="Wall time without an answer to a frame in lockstep after which a warning names the "
        "robots that have not answered (s). The simulation continues to wait.",
    )
    discovery_time: float = bounded(
        0.5,
        low=0.0,
        high=10.0,
        doc="Wall time to look for another bridge before this one starts (s).",
    )
    tf_rate: float = bounded(
        25.0,
        low=0.1,
        high=1000.0,
        doc="Transforms on /tf per second of simulated time (Hz). Markers are published at a fifth "
        "of this rate.",
    )
    seed: int = bounded(
        1, low=0, high=2**62, doc="Seed of the noise, drop-outs and latency of the poses."
    )
