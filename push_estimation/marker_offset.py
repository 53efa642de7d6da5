"""Where the axle of a robot is in its marker frame: from a turn on the spot, and a straight drive.

In a turn on the spot the middle of the axle c stays where it is. A marker frame at p_k with heading
a_k sees it at r, which is the same for all k: p_k + R(a_k) r = c. That is linear in r and c. In a
straight drive the robot moves along its heading, which the marker frame sees under a fixed angle.
"""

import math

import numpy as np

from push_estimation.intervals import TooLittle, solve_with_intervals
from push_estimation.tracks import motion
from push_model import se2
from push_model.arrays import Array
from push_model.belief import Interval

_ENOUGH = math.radians(60.0)  # of a turn
_WAY = 0.02  # [m] of a drive


def axle_in_marker_frame(poses: Array) -> tuple[Interval, Interval]:
    """x and y [m] of the axle's middle in the marker frame, from poses ``(n, 3)`` during a turn.

    Raises
    ------
    TooLittle: the robot has turned by less than 60 degrees.
    """
    if len(poses) < 10 or float(np.ptp(np.unwrap(poses[:, 2]))) < _ENOUGH:
        raise TooLittle("the turn on the spot is shorter than 60 degrees")
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    one, none = np.ones(len(poses)), np.zeros(len(poses))
    rows = np.vstack([np.column_stack([c, -s, -one, none]), np.column_stack([s, c, none, -one])])
    x, y, *_ = solve_with_intervals(rows, -np.concatenate([poses[:, 0], poses[:, 1]]))
    return x, y


def heading_in_marker_frame(time: Array, poses: Array) -> float:
    """Angle [rad] of the robot's heading in its marker frame, from times ``(n,)`` and poses
    ``(n, 3)`` during a straight drive ahead; the offset of the axle does not matter.

    Raises
    ------
    TooLittle: the robot has moved by less than 2 cm.
    """
    if len(poses) < 10 or float(np.hypot(*(poses[-1] - poses[0])[:2])) < _WAY:
        raise TooLittle("the straight drive is shorter than 2 cm")
    fitted = motion(time, poses)
    ahead = math.atan2(fitted.twist[1], fitted.twist[0])
    return se2.wrap(ahead - float(fitted.pose[2]))
