"""Rigid motions of the plane. A pose is an array ``(x, y, theta)`` in [m, m, rad].

Poses compose like frames: ``compose(a_b, b_c)`` is the pose of c in a.
"""

import math

import numpy as np

from push_model.arrays import Array


def wrap(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def pose(x: float, y: float, theta: float) -> Array:
    """A pose ``(3,)``."""
    return np.array([x, y, theta], dtype=np.float64)


def rotation_matrix(theta: float) -> Array:
    """``(2, 2)`` rotation by theta."""
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -s], [s, c]])


def compose(first: Array, second: Array) -> Array:
    """Pose ``(3,)`` of the second frame, given in the first, seen from the first's parent."""
    c, s = math.cos(first[2]), math.sin(first[2])
    return np.array(
        [
            first[0] + c * second[0] - s * second[1],
            first[1] + s * second[0] + c * second[1],
            wrap(first[2] + second[2]),
        ]
    )


def inverse(frame: Array) -> Array:
    """Pose ``(3,)`` of the parent seen from the frame."""
    c, s = math.cos(frame[2]), math.sin(frame[2])
    return np.array([-c * frame[0] - s * frame[1], s * frame[0] - c * frame[1], wrap(-frame[2])])


def between(first: Array, second: Array) -> Array:
    """Pose ``(3,)`` of the second frame seen from the first; both share a parent."""
    return compose(inverse(first), second)


def transform(frame: Array, points: Array) -> Array:
    """Points ``(n, 2)`` of the frame seen from its parent ``(n, 2)``."""
    result: Array = np.asarray(points) @ rotation_matrix(frame[2]).T + frame[:2]
    return result


def quaternion_from_yaw(theta: float) -> tuple[float, float, float, float]:
    """Quaternion ``(x, y, z, w)`` of a turn about the vertical axis."""
    return 0.0, 0.0, math.sin(theta / 2.0), math.cos(theta / 2.0)


def yaw_from_quaternion(x: float, y: float, z: float, w: float) -> float:
    """Heading [rad] of a unit quaternion."""
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
