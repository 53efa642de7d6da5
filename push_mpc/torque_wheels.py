"""What the wheels of a robot said last, and whether it still counts.

A driver that has lost its encoders goes on with old stamps, or repeats itself with fresh ones. Such
states expire: the controller goes on from poses alone.
"""

from collections import deque

import numpy as np

from push_model.arrays import Array

MAX_AGE = 0.05
"""[s] between a frame and the wheel states that are used with it."""
_KEPT = 1.0  # [s] of states that are kept, for poses that come late
_TURNS = 0.5  # [rad/s] at which the angle of a wheel must change from state to state


class WheelFeed:
    """Stamped speeds of the left and the right wheel."""

    def __init__(self) -> None:
        self._kept: deque[tuple[float, Array]] = deque()
        self._angles: Array | None = None

    def take(self, stamp: float, angles: Array, speeds: Array) -> str:
        """Angles ``(2,)`` [rad], or none of them, and speeds ``(2,)`` [rad/s] at a stamp [s].

        Returns why they are refused; empty where they are taken.
        """
        if speeds.shape != (2,) or not np.isfinite(speeds).all():
            return f"{len(speeds)} speeds, or not finite ones"
        if len(angles) not in (0, 2) or not np.isfinite(angles).all():
            return f"{len(angles)} angles, or not finite ones"
        before, self._angles = self._angles, angles if len(angles) else None
        if before is not None and self._angles is not None and self._kept:
            frozen = (np.abs(speeds) > _TURNS) & (angles == before)
            if stamp > self._kept[-1][0] and frozen.any():
                return "a wheel that turns stays at its angle: the states are frozen"
        if self._kept and stamp < self._kept[-1][0]:
            self._kept.clear()  # the clock jumped back
        self._kept.append((stamp, speeds))
        while stamp - self._kept[0][0] > _KEPT:
            self._kept.popleft()
        return ""

    def at(self, stamp: float) -> Array | None:
        """Speeds ``(2,)`` [rad/s] nearest to a time [s]; None where none are near enough."""
        if not self._kept:
            return None
        when, speeds = min(self._kept, key=lambda state: abs(state[0] - stamp))
        return speeds if abs(when - stamp) <= MAX_AGE else None
