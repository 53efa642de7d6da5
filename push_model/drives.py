"""What moves a robot and how fast: the ``drive`` of a robot type, told by ``kind``."""

import math
from dataclasses import field
from typing import Literal

from push_model.kinematics import DifferentialDrive
from push_model.settings import bounded, settings


@settings
class SpeedDrive(DifferentialDrive):
    """Two wheels whose speed is controlled, as on an e-puck."""

    kind: Literal["differential"] = field(default="differential", kw_only=True)
    wheel_radius: float = bounded(low=1e-3, high=1.0, doc="[m]")
    half_track: float = bounded(low=1e-3, high=1.0, doc="[m] half the wheel distance")
    max_wheel_speed: float = bounded(low=1e-2, high=100.0, doc="[rad/s]")
    wheel_mass: float = bounded(low=1e-4, high=50.0, doc="[kg] of one wheel")
    wheel_torque: float = bounded(low=1e-4, high=100.0, doc="[Nm] greatest motor torque")
    wheel_inertia: float = bounded(
        0.0, low=0.0, high=100.0, doc="[kg m^2] about the axle, with its geared motor; 0: a ball's"
    )
    wheel_friction: float = bounded(1.0, low=0.0, high=3.0, doc="wheel on floor")


@settings
class TorqueDrive(DifferentialDrive):
    """Two wheels whose torque is controlled, as on the Pioneer of section 2.3."""

    kind: Literal["torque"] = field(default="torque", kw_only=True)
    wheel_radius: float = bounded(low=1e-3, high=1.0, doc="[m] r")
    half_track: float = bounded(low=1e-3, high=1.0, doc="[m] l, half the wheel distance")
    max_wheel_speed: float = bounded(low=1e-2, high=100.0, doc="[rad/s]")
    max_torque: float = bounded(low=1e-4, high=1000.0, doc="[Nm] at one wheel")
    wheel_mass: float = bounded(low=1e-4, high=50.0, doc="[kg] of one wheel")
    wheel_inertia: float = bounded(low=1e-9, high=100.0, doc="[kg m^2] I_w about the axle")
    wheel_friction: float = bounded(1.0, low=0.0, high=3.0, doc="mu, wheel on floor")


@settings
class HolonomicDrive:
    """Traction in any direction, as of a disc of a swarm."""

    kind: Literal["holonomic"] = field(default="holonomic", kw_only=True)
    max_speed: float = bounded(low=1e-3, high=100.0, doc="[m/s] in any direction")
    max_turn_rate: float = bounded(low=1e-2, high=1000.0, doc="[rad/s]")
    max_force: float = bounded(low=1e-3, high=10000.0, doc="[N] of its traction")

    def saturate(self, vx: float, vy: float, omega: float) -> tuple[float, float, float]:
        """The feasible twist of the same direction and rotation centre: scaled by one factor."""
        need = max(math.hypot(vx, vy) / self.max_speed, abs(omega) / self.max_turn_rate)
        return (vx, vy, omega) if need <= 1.0 else (vx / need, vy / need, omega / need)


Drive = SpeedDrive | TorqueDrive | HolonomicDrive
