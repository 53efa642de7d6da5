"""A flat bumper that pushes on a corner of an object, until a side lies flush against it.

The push is quasi-static. The bumper moves straight ahead and touches one corner; the contact is a
point with Coulomb friction, and the floor is an ellipsoidal limit surface (3.4). A force f at the
corner, at r from the centre of mass, moves the corner in the direction of M f, with

    M = I + perp(r) perp(r)^T / c^2,    perp(r) = (-r_y, r_x),

c being the radius of the limit surface. The corner sticks to the bumper if the force that moves it
straight ahead lies inside the friction cone. Otherwise it slides, and the force is at the edge of
the cone. The object turns until a side of it meets the bumper, and then moves straight on if the
centre of mass is between the ends of the contact (stable pushing by two points: Mason, "Mechanics
and planning of manipulator pushing operations", 1986; the motion is the "reorient push" of Akella
and Mason, "Posing polygonal objects in the plane by pushing", 1998).

Poses are of the centre of mass, in the frame of the robot: origin at the middle of the axle, x
ahead. The outline must be convex, since only its corners are looked at.
"""

import math
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np

from push_model.arrays import Array

_STEP = 5e-4  # [m] of travel
_FLUSH = 1e-9  # [rad] to the bumper, from which on a side is flush


@dataclass(frozen=True)
class CornerPush:
    """The motion of the object. poses: ``(n, 3)`` in the frame of the robot, which has moved
    ``travel`` ``(n,)`` [m]; at the last one a side is flush."""

    poses: Array
    travel: Array


def touching(outline: Array, heading: float, face: float, corner: float) -> Array:
    """Pose ``(3,)`` of an object whose rearmost corner touches the bumper.

    Parameters
    ----------
    outline: ``(n, 2)`` [m] about the centre of mass. heading: [rad] in the frame of the robot.
    face: [m] from the axle ahead to the bumper. corner: [m] place of the corner, to the left of the
        middle of the bumper.
    """
    c, s = math.cos(heading), math.sin(heading)
    x, y = outline[:, 0] * c - outline[:, 1] * s, outline[:, 0] * s + outline[:, 1] * c
    rear = int(np.argmin(x))
    return np.array([face - x[rear], corner - y[rear], heading])


def corner_push(
    outline: Array,
    start: Array,
    face: float,
    half_width: float,
    friction: float,
    radius: float,
    most: float,
) -> CornerPush | None:
    """Push straight ahead from a pose in which a corner touches; None if no side gets flush.

    Parameters
    ----------
    outline: ``(n, 2)`` [m], convex, counter-clockwise, about the centre of mass.
    start: ``(3,)`` pose of the object, see ``touching``.
    face, half_width: [m] of the bumper. friction: of the contact. radius: [m] c of the limit
        surface. most: [m] of travel.
    """
    poses = np.empty((int(most / _STEP) + 2, 3))
    count = _follow(outline, start, face, half_width, friction, radius**2, poses)
    return CornerPush(poses[:count].copy(), _STEP * np.arange(count)) if count else None


@numba.njit(cache=True)
def _follow(
    outline: Any, start: Any, face: float, half: float, friction: float, square: float, poses: Any
) -> int:
    """Number of poses until a side is flush; 0 if none gets flush."""
    y, theta = start[1], start[2]
    n = outline.shape[0]
    for k in range(poses.shape[0]):
        c, s = math.cos(theta), math.sin(theta)
        rear = 0
        for i in range(n):
            if c * outline[i, 0] - s * outline[i, 1] < c * outline[rear, 0] - s * outline[rear, 1]:
                rear = i
        # The corner is at the face; a step leaves an error of second order.
        rx = c * outline[rear, 0] - s * outline[rear, 1]
        ry = s * outline[rear, 0] + c * outline[rear, 1]
        poses[k, 0], poses[k, 1], poses[k, 2] = face - rx, y, theta
        if abs(y + ry) > half:
            return 0
        a, b = 1.0 + ry * ry / square, 1.0 + rx * rx / square
        d = -rx * ry / square
        # The force that moves the corner straight ahead is that of M f = (1, 0), up to a factor.
        fx, fy = b, -d
        if abs(fy) > friction * fx:
            fx, fy = 1.0, math.copysign(friction, fy)
        ahead = a * fx + d * fy
        turn = (rx * fy - ry * fx) / square / ahead
        across = fy / ahead
        if turn == 0.0:
            return 0
        # Of the two neighbours, the one that comes nearer.
        following = (rear + 1) % n if turn < 0.0 else (rear + n - 1) % n
        ex, ey = outline[following, 0] - outline[rear, 0], outline[following, 1] - outline[rear, 1]
        gap = c * ex - s * ey
        away = s * ex + c * ey
        left_to_turn = math.atan2(gap, abs(away))
        if left_to_turn <= abs(turn) * _STEP + _FLUSH:
            theta += math.copysign(left_to_turn, turn)
            c, s = math.cos(theta), math.sin(theta)
            rx = c * outline[rear, 0] - s * outline[rear, 1]
            poses[k, 0], poses[k, 2] = face - rx, theta
            return k + 1
        y += across * _STEP
        theta += turn * _STEP
    return 0
