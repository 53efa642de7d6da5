"""Kinematics of wheeled robots: unicycle (2.12), differential drive, input/output linearisation."""

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from push_model.arrays import Array
from push_model.se2 import wrap

Number = TypeVar("Number", float, Array)


@dataclass(frozen=True)
class DifferentialDrive:
    """Two driven wheels on one axle.

    wheel_radius: [m].
    half_track: [m] l, half the distance between the wheels.
    max_wheel_speed: [rad/s].
    """

    wheel_radius: float
    half_track: float
    max_wheel_speed: float

    @property
    def max_speed(self) -> float:
        """[m/s] greatest speed straight ahead."""
        return self.wheel_radius * self.max_wheel_speed

    @property
    def max_turn_rate(self) -> float:
        """[rad/s] greatest turn rate in place."""
        return self.max_speed / self.half_track

    def wheel_speeds(self, v: float, omega: float) -> tuple[float, float]:
        """Left and right wheel speeds [rad/s] for a twist."""
        return (
            (v - omega * self.half_track) / self.wheel_radius,
            (v + omega * self.half_track) / self.wheel_radius,
        )

    def twist(self, left: Number, right: Number) -> tuple[Number, Number]:
        """(v, omega) for wheel speeds [rad/s], numbers or arrays."""
        return (
            (left + right) * self.wheel_radius / 2.0,
            (right - left) * self.wheel_radius / (2.0 * self.half_track),
        )

    def saturate_all(self, twists: Array) -> Array:
        """The same of many twists ``(…, 3)`` [m/s, m/s, rad/s]; the second column becomes 0."""
        return saturate_wheels(twists, self.half_track, self.max_speed)

    def saturate(self, v: float, omega: float) -> tuple[float, float]:
        """The nearest feasible twist of the same curvature: both scaled by one factor."""
        need = (abs(v) + abs(omega) * self.half_track) / self.max_speed
        return (v, omega) if need <= 1.0 else (v / need, omega / need)

    def follow(self, velocities: Array, headings: Array, lead: float) -> Array:
        """Input/output linearisation: twists ``(n, 2)`` v [m/s], omega [rad/s] such that points
        ahead of the robots' axles move at given velocities, as (3.11) and chapter 4 take for
        granted; scaled to the limits of the wheels.

        Parameters
        ----------
        velocities: ``(n, 2)`` [m/s] of the points, world frame.
        headings: ``(n,)`` [rad] of the robots.
        lead: [m] of the points ahead of the axles.

        Raises
        ------
        ValueError: lead is zero; a point on the axle cannot move sideways.
        """
        if lead == 0.0:
            raise ValueError("the controlled point must not lie on the axle (lead = 0)")
        c, s = np.cos(headings), np.sin(headings)
        v = c * velocities[:, 0] + s * velocities[:, 1]
        omega = (-s * velocities[:, 0] + c * velocities[:, 1]) / lead
        need = (np.abs(v) + np.abs(omega) * self.half_track) / self.max_speed
        return np.column_stack([v, omega]) / np.maximum(need, 1.0)[:, None]


def saturate_wheels(twists: Array, half_track: Number, max_speed: Number) -> Array:
    """The nearest feasible twists ``(…, 3)`` [m/s, m/s, rad/s] of the same curvatures, of one drive
    or each of its own: half_track [m], max_speed [m/s]; the second column becomes 0."""
    v, omega = twists[..., 0], twists[..., 2]
    need = np.maximum((np.abs(v) + np.abs(omega) * half_track) / max_speed, 1.0)
    return np.stack([v / need, np.zeros_like(v), omega / need], axis=-1)


def unicycle_step(state: Array, v: float, omega: float, dt: float) -> Array:
    """Exact motion of a unicycle pose ``(3,)`` under a constant twist for dt [s]."""
    x, y, theta = state
    half = 0.5 * omega * dt
    chord = v * dt * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
    return np.array(
        [
            x + chord * math.cos(theta + half),
            y + chord * math.sin(theta + half),
            wrap(theta + omega * dt),
        ]
    )
