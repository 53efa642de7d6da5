"""Where the pushed object sits at the bumper: its pose in the robot frame, smoothed."""

import numpy as np

from push_model import se2
from push_model.arrays import Array


class GraspEstimate:
    """A first-order filter of the object's pose in the robot frame; the first one counts in full.

    nominal: ``(3,)`` where it should be; pose: ``(3,)`` where it is. Both poses of a measurement
    must be of one time: in the 0.1 s that a frame is late, a robot moves on by millimetres.
    """

    def __init__(self, nominal: Array, time_constant: float) -> None:
        self.nominal = nominal
        self.pose = nominal.copy()
        self._time_constant = time_constant
        self._seen = False
        self._elapsed = 0.0  # [s] since the last measurement

    def update(self, dt: float, seen: Array | None) -> None:
        """Let dt [s] pass, at whose end the object is seen there in the robot frame, or not."""
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
        """Pose ``(3,)`` of the robot frame that puts the object on its way, in the nominal one."""
        return se2.compose(self.nominal, se2.inverse(self.pose))

    @property
    def offset(self) -> float:
        """[m] by which the object sits to the left of its nominal place, (2.54)."""
        return float(self.pose[1] - self.nominal[1])

    @property
    def away(self) -> tuple[float, float]:
        """[m] by which the object sits ahead and to the left of its nominal place."""
        return float(self.pose[0] - self.nominal[0]), self.offset

    @property
    def apart(self) -> tuple[float, float, float]:
        """Ahead of its place [m], aside of it (absolute) [m], turned against it (absolute)."""
        away = self.pose - self.nominal
        return float(away[0]), abs(float(away[1])), abs(se2.wrap(float(away[2])))


def distance(first: Array, second: Array) -> tuple[float, float]:
    """[m] and [rad] from one pose ``(3,)`` to another."""
    local = se2.between(first, second)
    return float(np.hypot(local[0], local[1])), abs(float(local[2]))
