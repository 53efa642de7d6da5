"""Recorded motion of a robot and an object, and velocities from it."""

from dataclasses import dataclass

import numpy as np

from push_model import se2
from push_model.arrays import Array


@dataclass(frozen=True)
class Track:
    """time: ``(n,)`` [s]. robot, item: ``(n, 3)`` [m, m, rad], map frame."""

    time: Array
    robot: Array
    item: Array

    def between(self, start: float, end: float) -> "Track":
        """The part of a span of time [s]."""
        keep = (self.time >= start) & (self.time <= end)
        return Track(self.time[keep], self.robot[keep], self.item[keep])

    def corrected(self, frame: Array) -> "Track":
        """The same with the robot's frame put to ``frame (3,)`` in the measured one."""
        robot = np.array([se2.compose(p, frame) for p in self.robot]).reshape(-1, 3)
        return Track(self.time, robot, self.item)


@dataclass(frozen=True)
class Motion:
    """Pose and twist in the middle of a window, ``(3,)`` each, map frame."""

    pose: Array
    twist: Array


def motion(time: Array, poses: Array) -> Motion:
    """A line fitted to the poses ``(n, 3)`` of a window, n >= 3."""
    middle = float(time.mean())
    table = poses.copy()
    table[:, 2] = np.unwrap(table[:, 2])
    rows = np.column_stack([np.ones(len(time)), time - middle])
    solved, *_ = np.linalg.lstsq(rows, table, rcond=None)
    return Motion(solved[0], solved[1])
