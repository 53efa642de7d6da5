"""Which side of an object a flat bumper is at, and where: from the two poses."""

import math
from dataclasses import dataclass

import numpy as np

from push_estimation.line_push_model import Bumper
from push_model import se2
from push_model.arrays import Array
from push_model.outlines import convex_hull

FACING = 0.6
"""[rad] between the robot's heading and the side's normal, at most."""
REACH = 0.02
"""[m] from the bumper to the side within which a side is looked for."""


@dataclass(frozen=True)
class Facing:
    """A side of the object. middle: [m], object's frame. heading: [rad] of its inward normal in
    that frame. length: [m]."""

    middle: tuple[float, float]
    heading: float
    length: float

    def seen_from(self, points: Array) -> Array:
        """Points ``(n, 2)`` of the object's frame in the frame of the side: x into the object."""
        result: Array = (points - np.array(self.middle)) @ se2.rotation_matrix(self.heading)
        return result


class PushedSides:
    """The sides of a convex hull that a bumper can be at."""

    def __init__(self, outline: Array, bumper: Bumper) -> None:
        """outline: ``(n, 2)`` [m] of the object in its frame."""
        self._bumper = bumper
        hull = convex_hull(np.asarray(outline, dtype=np.float64))
        self._sides = []
        for a, b in zip(hull, np.roll(hull, -1, axis=0), strict=True):
            length = float(np.hypot(*(b - a)))
            if length > 0.5 * bumper.half_width:
                x, y = (a + b) / 2.0
                inward = math.atan2(b[0] - a[0], a[1] - b[1])
                self._sides.append(Facing((float(x), float(y)), inward, length))

    def near(self, robot: Array) -> Facing | None:
        """The side that the bumper of a robot at a pose ``(3,)`` in the object's frame is at."""
        best, least = None, REACH
        for side in self._sides:
            q, phi, gap = self.place(robot, side)
            touches = abs(q) < side.length / 2.0 + self._bumper.half_width
            if abs(phi) < FACING and abs(gap) < least and touches:
                best, least = side, abs(float(gap))
        return best

    def place(self, robot: Array, side: Facing) -> Array:
        """``(3,)`` of a robot at a pose ``(3,)`` in the object's frame: position q [m] of the
        bumper's middle along the side, heading phi [rad] from the side's normal, and the gap [m]
        between side and bumper."""
        phi = se2.wrap(float(robot[2]) - side.heading)
        axle = side.seen_from(robot[None, :2])[0]
        d, h = self._bumper.distance, self._bumper.half_width
        ahead = axle[0] + d * math.cos(phi) + h * abs(math.sin(phi))
        return np.array([axle[1] + d * math.sin(phi), phi, -ahead])
