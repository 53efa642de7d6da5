"""Velocity of a body from its poses: a Kalman filter of constant velocity, an axis at a time."""

import math

import numpy as np

from push_model.arrays import Array

_FIRST = 1.0  # [(m/s)^2], [(rad/s)^2] of the velocity before anything is known


class VelocityFilter:
    """x, y and heading with their rates; accelerations are white noise.

    pose, twist ``(3,)``: estimates along the world's axes, the heading continuous.
    """

    def __init__(
        self, position_noise: float, orientation_noise: float, acceleration: float, turning: float
    ) -> None:
        """Standard deviations: of poses [m], [rad]; of accelerations [m/s^2], [rad/s^2]."""
        self._measured = np.array([position_noise, position_noise, orientation_noise]) ** 2
        self._driven = np.array([acceleration, acceleration, turning]) ** 2
        self.reset()

    def reset(self) -> None:
        """Forget what was seen."""
        self.pose, self.twist = np.zeros(3), np.zeros(3)
        self._time: float | None = None

    def update(self, time: float, pose: Array) -> None:
        """Take a pose ``(3,)`` of a time [s]; one that is not later than the last is left out."""
        if self._time is None:
            self._time, self.pose, self.twist = time, np.array(pose, dtype=np.float64), np.zeros(3)
            self._pp, self._pv = self._measured.copy(), np.zeros(3)
            self._vv = np.full(3, _FIRST)
            return
        dt = time - self._time
        if dt <= 0.0:
            return
        self._time = time
        ahead = self.pose + dt * self.twist
        pp = self._pp + 2.0 * dt * self._pv + dt**2 * self._vv + self._driven * dt**4 / 4.0
        pv = self._pv + dt * self._vv + self._driven * dt**3 / 2.0
        vv = self._vv + self._driven * dt**2
        off = np.asarray(pose, dtype=np.float64) - ahead
        off[2] = math.remainder(off[2], 2.0 * math.pi)
        share = 1.0 / (pp + self._measured)
        gain, rate = pp * share, pv * share
        self.pose, self.twist = ahead + gain * off, self.twist + rate * off
        self._pp, self._pv, self._vv = (1.0 - gain) * pp, (1.0 - gain) * pv, vv - rate * pv
