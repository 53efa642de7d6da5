"""Checks on inbound messages. Everything that reaches a core has passed here."""

import math
from typing import Any

import numpy as np

from push_model import se2
from push_model.arrays import Array

FRAME = "map"
"""The fixed frame of the project."""

_NORM_TOLERANCE = 1e-2
FARTHEST = 1e5
"""[m] from the origin that a body can plausibly be."""


class InvalidMessage(ValueError):
    """A message that must not be acted on; the text says why."""


def finite(values: Any, what: str) -> None:
    """Raise unless all numbers are finite."""
    if not np.isfinite(np.asarray(values, dtype=np.float64)).all():
        raise InvalidMessage(f"{what} is not finite")


def check_frame(frame: str, what: str) -> None:
    """Raise unless the frame is the fixed frame."""
    if frame != FRAME:
        raise InvalidMessage(f"{what} is given in frame '{frame}', expected '{FRAME}'")


def planar_pose(message: Any, what: str = "pose") -> Array:
    """geometry_msgs/Pose to a pose ``(3,)``.

    A quaternion whose norm is within 1e-2 of 1 is renormalised; others are refused.
    """
    p, q = message.position, message.orientation
    finite((p.x, p.y, p.z, q.x, q.y, q.z, q.w), what)
    if max(abs(p.x), abs(p.y)) > FARTHEST:
        raise InvalidMessage(f"{what}: ({p.x:.3g}, {p.y:.3g}) m is not a plausible position")
    norm = math.hypot(q.x, q.y, q.z, q.w)
    if abs(norm - 1.0) > _NORM_TOLERANCE:
        raise InvalidMessage(f"{what}: quaternion of norm {norm:.3g}, expected 1")
    yaw = se2.yaw_from_quaternion(q.x / norm, q.y / norm, q.z / norm, q.w / norm)
    return np.array([p.x, p.y, yaw])


def stamped_pose(message: Any, what: str) -> Array:
    """geometry_msgs/PoseStamped in the fixed frame to a pose ``(3,)``."""
    check_frame(message.header.frame_id, what)
    return planar_pose(message.pose, what)
