"""A push that shows friction and centre of mass: the robot weaves so that the object slides.

An ordinary push keeps the object stuck to the bumper, and what sticks says little. Here the robot
turns to one side until the object has slid along the bumper, or turns off it, and then to the other
side. The centre of mass shows when the force passes near an end of the bumper, which is why the
object slides far.
"""

import math

import numpy as np

from push_estimation.line_push_model import Bumper
from push_estimation.pushed_side import Facing, PushedSides
from push_model import se2
from push_model.arrays import Array
from push_model.settings import bounded, settings


@settings
class ProbingSettings:
    """How the robot weaves."""

    speed: float = bounded(0.05, low=1e-3, high=5.0, doc="Speed of a probing push (m/s).")
    slide: float = bounded(
        0.63,
        low=0.05,
        high=0.9,
        doc="Distance by which the object slides to either side in a probing push, as a fraction "
        "of half the width of the bumper (dimensionless).",
    )
    sharpest: float = bounded(
        0.4,
        low=0.01,
        high=2.0,
        doc="Greatest curvature of a probing push, multiplied by the distance of the bumper from "
        "the axle (dimensionless).",
    )
    growth: float = bounded(
        0.15,
        low=0.01,
        high=10.0,
        doc="Rate at which the curvature of a probing push grows, multiplied by the distance of "
        "the bumper from the axle (1/s).",
    )
    open: float = bounded(
        0.05,
        low=0.01,
        high=0.5,
        doc="Angle between the bumper and the pushed side at which a probing push turns in the "
        "other direction (rad).",
    )


class ProbingPush:
    """Commands of a robot that stands behind an object, bumper at a side.

    off: whether the object is no longer at the bumper.
    """

    def __init__(
        self, outline: Array, bumper: Bumper, values: ProbingSettings | None = None
    ) -> None:
        """outline: ``(n, 2)`` [m] of the object in its frame."""
        self._settings = values or ProbingSettings()
        self._bumper, self._sides = bumper, PushedSides(outline, bumper)
        self._side: Facing | None = None
        self._seen = np.zeros(2)
        self._turn, self._sharp, self._since = 1.0, 0.0, 0.0
        self.off = False

    def step(self, dt: float, robot: Array, item: Array) -> tuple[float, float]:
        """v [m/s] and omega [rad/s] after poses ``(3,)`` in the world, dt [s] after the last."""
        s, rel = self._settings, se2.between(item, robot)
        if self._side is None:
            self._side = self._sides.near(rel)
            if self._side is None:
                self.off = True
                return 0.0, 0.0
            self._seen = self._sides.place(rel, self._side)[:2]
        place = self._sides.place(rel, self._side)
        share = min(1.0, dt / 0.05)  # against noise
        self._seen = self._seen + share * (place[:2] - self._seen)
        q, phi = self._seen
        self.off = bool(place[2] > 0.02 or abs(q) > self._side.length)
        if self.off:
            return 0.0, 0.0
        self._since += dt
        far = q * self._turn > s.slide * self._bumper.half_width
        opens = phi * self._turn > s.open
        if self._since > 0.2 and (far or opens):
            self._turn, self._sharp, self._since = -self._turn, 0.0, 0.0
        self._sharp = min(self._sharp + s.growth * dt, s.sharpest)
        curvature = self._turn * self._sharp / self._bumper.distance
        slow = max(0.3, math.cos(phi))
        return s.speed * slow, s.speed * slow * curvature
