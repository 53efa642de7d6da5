"""The ``bumper`` of a robot type, chosen by ``kind``: what the robot pushes with."""

import math
from dataclasses import field
from typing import Literal

import numpy as np

from push_model.arrays import Array
from push_model.outlines import convex_hull, inside_convex
from push_model.settings import bounded, settings

_RING_CORNERS = 32


@settings
class FlatBumper:
    """A flat face across the front, a line contact (sections 2.4.7 and 2.6)."""

    kind: Literal["flat"] = field(default="flat", kw_only=True)
    width: float = bounded(low=1e-3, high=2.0, doc="Width of the flat face (m)")
    distance: float = bounded(low=1e-3, high=2.0, doc="Distance D from the axle to the face (m)")
    z: float | None = bounded(
        None,
        low=1e-3,
        high=2.0,
        doc="Height of the middle of the bumper above the floor (m); default: the height of "
        "the axle",
    )
    height: float = bounded(0.006, low=1e-3, high=1.0, doc="Height of the face (m)")

    @property
    def reach(self) -> float:
        """[m] of the circle about the axle midpoint that holds the bumper."""
        return math.hypot(self.distance, self.width / 2.0)

    def outline(self, body_radius: float) -> Array:
        """``(n, 2)`` [m] convex outline of a round body with the bumper, robot frame."""
        angle = np.linspace(math.pi / 2.0, 1.5 * math.pi, 13)
        back = body_radius * np.column_stack([np.cos(angle), np.sin(angle)])
        d, w = self.distance, self.width / 2.0
        outline = np.vstack([back, [[d, -w], [d, w]]])
        front = back[1:-1] * [-1.0, 1.0]
        if not inside_convex(outline, front).all():  # the body bulges beyond a narrow bumper
            outline = convex_hull(np.vstack([outline, front]))
        return outline


@settings
class RingBumper:
    """A ring about the axle midpoint, a point contact in any direction (chapters 3 and 4)."""

    kind: Literal["ring"] = field(default="ring", kw_only=True)
    radius: float = bounded(low=1e-3, high=2.0, doc="Radius of the ring (m)")
    z: float | None = bounded(
        None,
        low=1e-3,
        high=2.0,
        doc="Height of the middle of the bumper above the floor (m); default: the height of "
        "the axle",
    )
    height: float = bounded(0.006, low=1e-3, high=1.0, doc="Height of the ring (m)")

    @property
    def distance(self) -> float:
        """[m] from the axle midpoint to where it touches."""
        return self.radius

    @property
    def reach(self) -> float:
        """[m] of the circle about the axle midpoint that holds the bumper."""
        return self.radius

    def outline(self, body_radius: float) -> Array:
        """``(n, 2)`` [m] of a polygon round body and ring, robot frame."""
        angle = (np.arange(_RING_CORNERS) + 0.5) * 2.0 * math.pi / _RING_CORNERS
        radius = max(body_radius, self.radius) / math.cos(math.pi / _RING_CORNERS)
        return radius * np.column_stack([np.cos(angle), np.sin(angle)])


Bumper = FlatBumper | RingBumper
