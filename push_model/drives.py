"""The ``drive`` of a robot type, chosen by ``kind``: what moves the robot, and how fast."""

import math
from dataclasses import field
from typing import Literal

import numpy as np

from push_model.arrays import Array
from push_model.kinematics import DifferentialDrive, Number
from push_model.settings import bounded, settings


@settings
class SpeedDrive(DifferentialDrive):
    """Two wheels whose speed is controlled, as on an e-puck."""

    kind: Literal["differential"] = field(default="differential", kw_only=True)
    wheel_radius: float = bounded(low=1e-3, high=1.0, doc="Radius of a wheel (m)")
    half_track: float = bounded(low=1e-3, high=1.0, doc="Half the distance between the wheels (m)")
    max_wheel_speed: float = bounded(low=1e-2, high=100.0, doc="Greatest speed of a wheel (rad/s)")
    wheel_mass: float = bounded(low=1e-4, high=50.0, doc="Mass of one wheel (kg)")
    wheel_torque: float = bounded(low=1e-4, high=100.0, doc="Greatest torque of a motor (Nm)")
    wheel_inertia: float = bounded(
        0.0,
        low=0.0,
        high=100.0,
        doc="Inertia of a wheel with its geared motor about the axle (kg m^2); 0: that of a "
        "solid ball",
    )
    wheel_friction: float = bounded(
        1.0, low=0.0, high=3.0, doc="Friction coefficient of wheel and floor (dimensionless)"
    )


@settings
class TorqueDrive(DifferentialDrive):
    """Two wheels whose torque is controlled, as on the Pioneer of section 2.3."""

    kind: Literal["torque"] = field(default="torque", kw_only=True)
    wheel_radius: float = bounded(low=1e-3, high=1.0, doc="Radius r of a wheel (m)")
    half_track: float = bounded(
        low=1e-3, high=1.0, doc="Half the distance l between the wheels (m)"
    )
    max_wheel_speed: float = bounded(low=1e-2, high=100.0, doc="Greatest speed of a wheel (rad/s)")
    max_torque: float = bounded(low=1e-4, high=1000.0, doc="Greatest torque at one wheel (Nm)")
    wheel_mass: float = bounded(low=1e-4, high=50.0, doc="Mass of one wheel (kg)")
    wheel_inertia: float = bounded(
        low=1e-9, high=100.0, doc="Inertia I_w of a wheel about the axle (kg m^2)"
    )
    wheel_friction: float = bounded(
        1.0, low=0.0, high=3.0, doc="Friction coefficient mu of wheel and floor (dimensionless)"
    )


@settings
class HolonomicDrive:
    """Traction in any direction, as for a disc of a swarm."""

    kind: Literal["holonomic"] = field(default="holonomic", kw_only=True)
    max_speed: float = bounded(low=1e-3, high=100.0, doc="Greatest speed in any direction (m/s)")
    max_turn_rate: float = bounded(low=1e-2, high=1000.0, doc="Greatest turn rate (rad/s)")
    max_force: float = bounded(low=1e-3, high=10000.0, doc="Greatest traction (N)")

    def saturate_all(self, twists: Array) -> Array:
        """The same of many twists ``(…, 3)`` [m/s, m/s, rad/s]."""
        return saturate_any_way(twists, self.max_speed, self.max_turn_rate)

    def saturate(self, vx: float, vy: float, omega: float) -> tuple[float, float, float]:
        """The feasible twist of the same direction and rotation centre: scaled by one factor."""
        need = max(math.hypot(vx, vy) / self.max_speed, abs(omega) / self.max_turn_rate)
        return (vx, vy, omega) if need <= 1.0 else (vx / need, vy / need, omega / need)


def saturate_any_way(twists: Array, max_speed: Number, max_turn_rate: Number) -> Array:
    """The feasible twists ``(…, 3)`` [m/s, m/s, rad/s] of the same directions and rotation centres,
    of one drive or each of its own: max_speed [m/s], max_turn_rate [rad/s]."""
    speed, turn = np.hypot(twists[..., 0], twists[..., 1]), np.abs(twists[..., 2])
    need = np.maximum(np.maximum(speed / max_speed, turn / max_turn_rate), 1.0)
    scaled: Array = twists / need[..., None]
    return scaled


Drive = SpeedDrive | TorqueDrive | HolonomicDrive
