"""Where a group and its object are now: poses are late, the commands since are known.

Robots are carried forward along the twists that they were commanded, the object along the twists
with which it was pushed. Both come from the time of the frame to the time at which the answer takes
effect. Without a delay poses stay as they are.
"""

import numpy as np

from push_estimation.dead_reckoning import DeadReckoning, twist_step
from push_model.arrays import Array

_GAP = 0.2  # [s] between frames from which on everything has come to rest in between
_KEPT = 0.3  # [s] of commands that are kept at least, for a delay that becomes longer


class GroupPrediction:
    """Poses of ``count`` robots and their object now, from those in a frame.

    delay: [s] from the measurement of a frame to the command that answers it.
    """

    def __init__(self, count: int, delay: float) -> None:
        self._robots = [DeadReckoning(delay) for _ in range(count)]
        self._item = DeadReckoning(delay, twist_step)
        self._all = [*self._robots, self._item]
        self._twists = np.zeros((count, 2))
        self._pushed = np.zeros(3)
        self._time: float | None = None

    @property
    def delay(self) -> float:
        """[s] from the measurement of a frame to the command that answers it."""
        return self._item.delay

    @delay.setter
    def delay(self, seconds: float) -> None:
        for reckoning in self._all:
            reckoning.delay = seconds

    def frame(self, now: float) -> None:
        """A frame has come at a time [s]; what was last answered was in force until then."""
        dt = 0.0 if self._time is None else now - self._time
        self._time = now
        if dt > _GAP or dt < 0.0:
            for reckoning in self._all:
                reckoning.clear()
        elif dt > 0.0:
            for reckoning, twist in zip(self._robots, self._twists.tolist(), strict=True):
                reckoning.record(dt, *twist)
            self._item.record(dt, *self._pushed.tolist())
            for reckoning in self._all:
                reckoning.forget(max(0.0, _KEPT - self.delay))

    def robots(self, poses: Array) -> Array:
        """Poses ``(n, 3)`` of the robots now, from those in the frame."""
        if self.delay == 0.0:
            return poses
        return np.array([r.now(p) for r, p in zip(self._robots, poses, strict=True)])

    def item(self, pose: Array) -> Array:
        """Pose ``(3,)`` of the object now, from that in the frame."""
        return self._item.now(pose)

    def answer(self, twists: Array, pushed: Array | None = None) -> None:
        """The answer to the frame: twists ``(n, 2)`` v [m/s], omega [rad/s] of the robots, and the
        twist ``(3,)`` [m/s, m/s, rad/s] with which the object is pushed, in its frame."""
        self._twists = np.array(twists)
        self._pushed = np.zeros(3) if pushed is None else np.array(pushed)
