"""Which robots are in contact with something that may hold them up. No ROS.

Contact is inferred from positions: a gap below ``_GAP`` counts, because the outline that is
believed and the poses that are measured are both off by some millimetres.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from push_model import se2
from push_model.arrays import Array, Mask, Rows
from push_model.outlines import distance

_GAP = 0.01  # [m] up to which a gap to a robot counts as contact


@dataclass(frozen=True)
class Contacts:
    """The contacts of n robots at one instant.

    points ``(n, 2)`` [m], world frame. touched ``(n,)``: robots in contact with anything. pairs
    ``(p, 2)``: indices of robots in contact with each other. at_object: indices of robots in
    contact with the object, whose centre of mass is at ``middle (2,)`` [m]. at_fixed ``(q, 2)``:
    robots, and which of the discs ``fixed (m, 3)`` x, y, radius [m] touches them.
    """

    points: Array
    touched: Mask
    pairs: Rows
    at_object: Rows
    middle: Array
    at_fixed: Rows
    fixed: Array

    def neighbours(self, index: int) -> set[int]:
        """The robots that are in contact with a robot."""
        rows = self.pairs[(self.pairs == index).any(axis=1)]
        return set(rows.ravel().tolist()) - {index}

    def jam(self, index: int) -> set[int]:
        """The robots that press on a robot, directly or through others."""
        found, front = {index}, {index}
        while front:
            front = set().union(*(self.neighbours(k) for k in front)) - found
            found |= front
        return found - {index}

    def away(self, index: int) -> Array:
        """``(2,)`` unit vector, world frame, that leads away from what touches a robot; zero where
        nothing does, or where contacts on all sides cancel."""
        here = self.points[index]
        others = [self.points[j] for j in sorted(self.neighbours(index))]
        others += [self.fixed[j, :2] for i, j in self.at_fixed if i == index]
        if index in self.at_object:
            others.append(self.middle)
        ways = here - np.array(others).reshape(-1, 2)
        total = (ways / np.maximum(np.hypot(*ways.T), 1e-9)[:, None]).sum(axis=0)
        length = float(np.hypot(*total))
        unit: Array = total / length if length > 1e-6 else np.zeros(2)
        return unit


def find_contacts(
    pose: Array, outline: Array, points: Array, radius: float, fixed: Array
) -> Contacts:
    """Contacts of robots at ``(n, 2)`` [m], world frame.

    Parameters
    ----------
    pose: ``(3,)`` of the object, whose ``outline (k, 2)`` [m] is given in its frame.
    radius: [m] of the robots.
    fixed: ``(m, 3)`` x, y, radius [m] of discs that do not take part.
    """
    near = radius + _GAP
    touched = np.zeros(len(points), dtype=np.bool_)
    pairs = cKDTree(points).query_pairs(near + radius, output_type="ndarray").astype(np.intp)
    touched[pairs.ravel()] = True
    at_fixed = np.zeros((0, 2), dtype=np.intp)
    if len(fixed):
        away = np.hypot(*(points[:, None] - fixed[None, :, :2]).transpose(2, 0, 1))
        at_fixed = np.argwhere(away < near + fixed[:, 2])
        touched[at_fixed[:, 0]] = True
    local = se2.transform(se2.inverse(pose), points)
    close = np.flatnonzero(np.hypot(*local.T) < float(np.hypot(*outline.T).max()) + near)
    at_object = close[distance(outline, local[close]) < near]
    touched[at_object] = True
    return Contacts(points, touched, pairs, at_object, pose[:2], at_fixed, fixed)
