"""Which robots do not go although they are told to. No ROS, no clock."""

import math
from collections import deque

import numpy as np

from push_model.arrays import Array

_LEVER = 0.03  # [m] at which turns count as ways
_GAP = 0.2  # [s] between ticks from which on they are no longer one after the other


class ActuationMonitor:
    """Tells which robots do not go although they are told to."""

    def __init__(self, count: int, patience: float, way: float) -> None:
        """patience: [s] over which ``way`` [m] must be commanded, a tenth of which must be gone."""
        self._patience, self._way = patience, way
        self._seen: deque[tuple[float, Array, Array, Array]] = deque()
        self._told = np.zeros((count, 3))  # [m], [m], [rad] so far

    def step(self, time: float, robots: Array, twists: Array) -> tuple[int, ...]:
        """Indices of the disobedient; robots ``(n, 3)`` poses, twists ``(n, 2)`` v [m/s], omega
        [rad/s] that they are told from now on, or ``(n, 3)`` with a velocity in the fixed frame.
        Turns count as ways at a lever, and who is told to go to and fro is not told to go
        anywhere."""
        if self._seen and time - self._seen[-1][0] > _GAP:
            self._seen.clear()
        if self._seen:
            before, _, told, _ = self._seen[-1]
            self._told = self._told + told * (time - before)
        speeds = twists
        if twists.shape[1] == 2:
            ahead = np.column_stack([np.cos(robots[:, 2]), np.sin(robots[:, 2])])
            speeds = np.column_stack([ahead * twists[:, :1], twists[:, 1]])
        self._seen.append((time, np.array(robots), speeds, self._told))
        while time - self._seen[0][0] > self._patience:
            self._seen.popleft()
        first, poses, _, sums = self._seen[0]
        if time - first < 0.9 * self._patience:
            return ()
        ways = self._told - sums
        told = np.hypot(*ways[:, :2].T) + _LEVER * np.abs(ways[:, 2])
        turned = np.remainder(robots[:, 2] - poses[:, 2] + math.pi, 2.0 * math.pi) - math.pi
        gone = np.hypot(*(robots[:, :2] - poses[:, :2]).T) + _LEVER * np.abs(turned)
        return tuple(int(i) for i in np.flatnonzero((told > self._way) & (gone < 0.1 * told)))
