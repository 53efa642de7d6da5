"""Sides from which an object can be pushed without slipping, and settings of ``stable_nmpc.py``."""

from dataclasses import dataclass

import numpy as np

from push_model.arrays import Array
from push_model.belief import Belief
from push_model.pushable_sides import pushable_sides
from push_model.settings import bounded, settings
from push_model.shapes import Side
from push_model.specs import RobotSpec
from push_model.stable_push import CurvatureLimits, contact_on_side, curvature_limits
from push_study.rivals.lone_pusher import GoalTolerances


@settings
class GripSettings(GoalTolerances):
    """Tolerances, and how much of the friction pushes may use."""

    friction_trust: float = bounded(
        0.85,
        low=0.1,
        high=1.0,
        doc="Fraction of the believed contact friction that pushes may use. They never use more "
        "than the lower end of its believed interval (dimensionless).",
    )


@settings
class StableNmpcSettings(GripSettings):
    """What pushes may use, and the programme."""

    period: float = bounded(
        0.2, low=0.01, high=5.0, doc="Time between two solves of the nonlinear programme (s)."
    )


@dataclass(frozen=True)
class Grip:
    """A side with the bumper on it: pose ``(3,)`` of the object's centre of mass in the robot's
    frame; stable curvatures of the robot's path."""

    side: Side
    grasp: Array
    limits: CurvatureLimits


def grips(friction_trust: float, belief: Belief, robot: RobotSpec, name: str) -> tuple[Grip, ...]:
    """Of all sides of an object that can be pushed without slipping, as far as is believed."""
    item, found = belief.object(name), []
    friction = belief.interval(name, "contact_friction")
    mu = min(friction_trust * friction.value, friction.low)
    for side in pushable_sides(item.geometry, robot):
        contact = contact_on_side(side, robot.flat_bumper.width)
        limits = curvature_limits(contact, robot.push_distance, mu, item.limit_surface())
        if limits is not None:
            ahead = robot.push_distance + float(contact.centre[0])
            found.append(Grip(side, np.array([ahead, contact.centre[1], contact.heading]), limits))
    return tuple(found)
