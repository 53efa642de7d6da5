"""How much friction the wheels may be asked for: less while a wheel is seen to slip.

That a wheel slips although the model says that it rolls means that the friction is less than
believed, or the load on the wheel is. The trust halves at one rate and doubles at another.
"""

import numpy as np

from push_model.arrays import Array
from push_model.settings import bounded, settings
from push_model.torque_robot import TorqueRobot


@settings
class FrictionTrustSettings:
    """When a wheel counts as slipping, and what follows."""

    adapt: bool = bounded(
        True,
        doc="Whether the trusted fraction of the wheel friction shrinks while a wheel slips, "
        "and recovers while all wheels roll.",
    )
    slip: float = bounded(
        0.05,
        low=1e-3,
        high=10.0,
        doc="Difference of wheel speed and robot speed above which a wheel counts as slipping "
        "(m/s).",
    )
    slip_sigmas: float = bounded(
        4.0,
        low=0.0,
        high=100.0,
        doc="Number of standard deviations of the estimated robot speed that slip must exceed to "
        "count (dimensionless).",
    )
    loss_time: float = bounded(
        0.1,
        low=1e-3,
        high=10.0,
        doc="Time of slip in which the trusted fraction of the wheel friction halves (s).",
    )
    regain_time: float = bounded(
        8.0,
        low=0.1,
        high=1e4,
        doc="Time of rolling in which the trusted fraction of the wheel friction doubles, up "
        "to its initial value (s).",
    )
    least: float = bounded(
        0.3,
        low=0.01,
        high=1.0,
        doc="Lowest fraction of the wheel friction to which the trust can shrink (dimensionless).",
    )


def wheel_slip(robot: TorqueRobot, wheels: Array, v: float, omega: float) -> Array:
    """``(2,)`` [m/s] of the left and the right wheel: surface speed less that of its axle end.

    wheels: ``(2,)`` [rad/s] left, right. v, omega: of the axle midpoint.
    """
    axle = v + omega * robot.half_track * np.array([-1.0, 1.0])
    result: Array = wheels * robot.radius - axle
    return result


class FrictionTrust:
    """part: of the believed friction that may be asked for. slipping: whether a wheel does."""

    def __init__(self, settings: FrictionTrustSettings) -> None:
        self._settings = settings
        self.start()

    def start(self) -> None:
        """Full trust."""
        self.part, self.slipping = 1.0, False

    def update(self, dt: float, slips: Array | None, noise: float) -> None:
        """dt [s] more.

        slips: ``(2,)`` [m/s] of the wheels; None where they are not known: then no slip is seen,
        and the trust stays as it is. noise [m/s]: standard deviation of the estimated speed at a
        wheel.
        """
        s = self._settings
        if slips is None:
            self.slipping = False
            return
        self.slipping = float(np.abs(slips).max()) > max(s.slip, s.slip_sigmas * noise)
        if s.adapt:
            doublings = -dt / s.loss_time if self.slipping else dt / s.regain_time
            self.part = float(min(max(self.part * 2.0**doublings, s.least), 1.0))
