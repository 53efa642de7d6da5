"""Actuation monitor: which robots do not move although they are commanded to. No ROS, no clock."""

import math
from collections import deque

import numpy as np

from push_model.arrays import Array

_LEVER = 0.03  # [m] by which a turn [rad] is converted into a distance: about half a track width
_GAP = 0.2  # [s] between frames beyond which the history is no longer continuous
_PART = 0.1  # of the commanded distance: a robot that moves less does not move as commanded


class ActuationMonitor:
    """Compares the distance that robots were commanded with the distance that they moved."""

    def __init__(self, count: int, patience: float, way: float) -> None:
        """count: of robots. patience: [s] over which motion is compared. way: [m] that must have
        been commanded in that time for a robot to be judged."""
        self._patience, self._way = patience, way
        self._seen: deque[tuple[float, Array, Array, Array]] = deque()
        self._told = np.zeros((count, 3))  # [m], [m], [rad] commanded so far
        self._since = np.full(count, -math.inf)  # [s] from when on each robot is judged

    def step(self, time: float, robots: Array, twists: Array) -> tuple[int, ...]:
        """Indices of the robots that moved less than a tenth of the commanded distance.

        Commands are summed as vectors: a robot that is commanded to and fro is not commanded to go
        anywhere.

        Parameters
        ----------
        time: [s] of the frame.
        robots: ``(n, 3)`` poses [m, m, rad], world frame.
        twists: ``(n, 2)`` v [m/s], omega [rad/s] commanded from now on, or ``(n, 3)`` with
            velocities in the world frame.
        """
        if self._seen and time - self._seen[-1][0] > _GAP:
            self._seen.clear()
        if self._seen:
            before, _, told, _ = self._seen[-1]
            self._told = self._told + told * (time - before)
        speeds = twists
        if twists.shape[1] == 2:
            ahead = np.column_stack([np.cos(robots[:, 2]), np.sin(robots[:, 2])])
            speeds = np.column_stack([ahead * twists[:, :1], twists[:, 1]])
        self._seen.append((time, np.array(robots), speeds, self._told.copy()))
        while time - self._seen[0][0] > self._patience:
            self._seen.popleft()
        first, poses, _, sums = self._seen[0]
        if time - first < 0.9 * self._patience:
            return ()
        ways = self._told - sums
        told = np.hypot(*ways[:, :2].T) + _LEVER * np.abs(ways[:, 2])
        turned = np.remainder(robots[:, 2] - poses[:, 2] + math.pi, 2.0 * math.pi) - math.pi
        gone = np.hypot(*(robots[:, :2] - poses[:, :2]).T) + _LEVER * np.abs(turned)
        long = time - self._since >= 0.9 * self._patience
        slow = (told > self._way) & (gone < _PART * told) & long
        return tuple(int(i) for i in np.flatnonzero(slow))

    def restart(self, index: int) -> None:
        """Judge one robot only by what is commanded from the last frame on."""
        if self._seen:
            self._since[index] = self._seen[-1][0]
        for _, poses, _, sums in self._seen:
            poses[index] = self._seen[-1][1][index]
            sums[index] = self._told[index]
