"""Settings of the simulated world and of its motion-capture stream."""

from push_model.settings import bounded, settings


@settings
class PhysicsSettings:
    """PyBullet's step and solver."""

    time_step: float = bounded(
        1e-3, low=1e-4, high=1e-2, doc="[s] longest physics step; a tick is a whole number of them"
    )
    solver_iterations: int = bounded(100, low=5, high=1000, doc="constraint solver iterations")
    foot_stiffness: float = bounded(2000.0, low=10.0, high=1e6, doc="[N/m] of an object's foot")
    foot_damping: float = bounded(20.0, low=0.0, high=1e4, doc="[Ns/m] of an object's foot")


@settings
class MotionCaptureSettings:
    """The pose stream."""

    rate: float = bounded(100.0, low=1.0, high=1000.0, doc="[Hz]; one control tick per frame")
    position_noise: float = bounded(0.0, low=0.0, high=0.1, doc="[m] standard deviation per axis")
    orientation_noise: float = bounded(0.0, low=0.0, high=1.0, doc="[rad] standard deviation")
    latency: float = bounded(
        0.0, low=0.0, high=1.0, doc="[s] a frame comes out at the first tick that is so much later"
    )
    dropout: float = bounded(0.0, low=0.0, high=1.0, doc="probability that a frame misses a body")


@settings
class BridgeSettings:
    """Pace, safety and publishing of the bridge."""

    world: str = "pybullet"
    lockstep: bool = False
    real_time_factor: float = bounded(1.0, low=0.01, high=100.0, doc="pace when not in lockstep")
    command_timeout: float = bounded(0.2, low=0.01, high=5.0, doc="[s] sim time, then wheels stop")
    command_timeout_wall: float = bounded(
        0.5, low=0.05, high=10.0, doc="[s] wall time without a command, then wheels stop"
    )
    lockstep_warning: float = bounded(
        2.0,
        low=0.05,
        high=600.0,
        doc="Wall time without an answer to a tick in lockstep after which a warning names the "
        "robots that are waited for (s). The world waits on.",
    )
    discovery_time: float = bounded(
        0.5, low=0.0, high=10.0, doc="[s] wall time to look for another bridge at start"
    )
    tf_rate: float = bounded(25.0, low=0.1, high=1000.0, doc="[Hz] sim time, of /tf and markers")
    seed: int = bounded(1, low=0, high=2**62, doc="of the motion-capture noise")
