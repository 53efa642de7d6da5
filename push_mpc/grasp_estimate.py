"""Estimate of the pushed object's pose in the robot frame."""

import numpy as np

from push_model import se2
from push_model.arrays import Array


class GraspEstimate:
    """A first-order filter of the object's pose in the robot frame, initialised by the first one.

    nominal: ``(3,)`` where it should be; pose: ``(3,)`` where it is. Robot and object poses of a
    measurement must be of the same time, because a robot moves millimetres during the latency.
    """

    def __init__(self, nominal: Array, time_constant: float) -> None:
        self.nominal = nominal
        self.pose = nominal.copy()
        self._time_constant = time_constant
        self._seen = False
        self._elapsed = 0.0  # [s] since the last measurement

    def update(self, dt: float, seen: Array | None) -> None:
        """Advance by dt [s], with the object's measured pose in the robot frame, or None."""
        self._elapsed += dt
        if seen is None:
            return
        elapsed, self._elapsed = self._elapsed, 0.0
        if not self._seen:
            self.pose, self._seen = seen, True
            return
        gain = min(1.0, elapsed / max(self._time_constant, elapsed))
        change = seen - self.pose
        change[2] = se2.wrap(change[2])
        self.pose = self.pose + gain * change

    @property
    def shift(self) -> Array:
        """Pose ``(3,)`` of the robot, in its nominal frame, that puts the object on its path."""
        return se2.compose(self.nominal, se2.inverse(self.pose))

    @property
    def offset(self) -> float:
        """[m] by which the object is to the left of its nominal place, (2.54)."""
        return float(self.pose[1] - self.nominal[1])

    @property
    def away(self) -> tuple[float, float]:
        """[m] by which the object is ahead and to the left of its nominal place."""
        return float(self.pose[0] - self.nominal[0]), self.offset

    @property
    def apart(self) -> tuple[float, float, float]:
        """Deviation from its nominal place: ahead [m], lateral (absolute) [m], angle (absolute)."""
        away = self.pose - self.nominal
        return float(away[0]), abs(float(away[1])), abs(se2.wrap(float(away[2])))


def distance(first: Array, second: Array) -> tuple[float, float]:
    """[m] and [rad] from one pose ``(3,)`` to another."""
    local = se2.between(first, second)
    return float(np.hypot(local[0], local[1])), abs(float(local[2]))
