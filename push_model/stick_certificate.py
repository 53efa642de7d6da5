"""Whether a push sticks for everything that is believed: all frictions, all centres of mass.

A push sticks while the curvature of the robot's path is within the stable curvatures of section
2.1.1. These depend on the friction at the bumper and on the object's centre of mass, of which only
intervals are known. A curvature is certified if it is stable for all of them.

Less friction makes the friction cone narrower, so the least friction decides. The stable curvatures
of a centre of mass in a box are bounded by those at its corners, up to a remainder that
``BEND`` covers (found by sampling, see the tests).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from push_model.belief import Belief, Interval
from push_model.pushable_sides import pushable_sides
from push_model.settings import SettingsError
from push_model.specs import ObjectSpec, RobotSpec
from push_model.stable_push import (
    CurvatureLimits,
    contact_on_side,
    curvature_limits,
    shifted_limits,
)

BEND = 0.99
"""Part of the least stable curvature at the corners that is stable in between, too."""


CONTACT_QUANTITIES = ("contact_friction", "com_x", "com_y")
"""Of the object, on which the stable curvatures depend."""


@dataclass(frozen=True)
class ContactBelief:
    """Intervals of the friction at the bumper and of the centre of mass [m], object frame."""

    friction: Interval
    com_x: Interval
    com_y: Interval

    @classmethod
    def of(cls, belief: Belief, item: str) -> "ContactBelief | None":
        """What is believed of an object; None where nobody has given an interval.

        Raises
        ------
        BeliefError: there is no such object.
        """
        found = cls(*(belief.interval(item, quantity) for quantity in CONTACT_QUANTITIES))
        return None if found.exact else found

    @property
    def exact(self) -> bool:
        """Whether nothing is uncertain."""
        return self.friction.width == self.com_x.width == self.com_y.width == 0.0

    def centres(self) -> Iterator[tuple[float, float]]:
        """Corners of the box of centres of mass."""
        for x in {self.com_x.low, self.com_x.high}:
            yield from ((x, y) for y in {self.com_y.low, self.com_y.high})


def certified_limits(
    item: ObjectSpec, robot: RobotSpec, belief: ContactBelief, side: int
) -> CurvatureLimits | None:
    """Curvatures at which a push on a side sticks whatever of the belief is true.

    The bumper is where a plan for the object as described by ``item`` puts it.

    Parameters
    ----------
    side: index of the side, as of ``pushable_sides``.

    Returns
    -------
    None where not even the straight push is certified, and where the intervals of the centre of
    mass reach beyond the object.

    Raises
    ------
    ValueError: the robot does not reach that side.
    """
    width, distance = robot.flat_bumper.width, robot.push_distance
    nominal = next((s for s in pushable_sides(item.geometry, robot) if s.index == side), None)
    if nominal is None:
        raise ValueError(f"the robot does not reach side {side}")
    centred = contact_on_side(nominal, width)
    # Along the side from its start, which no centre of mass moves.
    along = float(-nominal.start @ nominal.tangent) + float(centred.centre[1])
    low, high = -math.inf, math.inf
    for com in belief.centres():
        try:
            spec = replace(item, com=com)
        except SettingsError:  # outside the object
            return None
        moved = next((s for s in pushable_sides(spec.geometry, robot) if s.index == side), None)
        if moved is None:
            return None
        contact = contact_on_side(moved, width, along)
        limits = curvature_limits(contact, distance, belief.friction.low, spec.limit_surface())
        if limits is None:
            return None
        low, high = max(low, limits.minimum), min(high, limits.maximum)
    factor = 1.0 if belief.com_x.width == belief.com_y.width == 0.0 else BEND
    return CurvatureLimits(factor * low, factor * high)


def trusted_limits(
    stable: CurvatureLimits, trust: float, certified: CurvatureLimits | None
) -> CurvatureLimits:
    """Curvatures that may be used: a fraction of the stable ones, or the certified ones where these
    allow more.

    stable: of the believed values. trust: fraction of them. certified: None where there are none.
    """
    part = stable.scaled(trust)
    if certified is None:
        return part
    return CurvatureLimits(
        min(part.minimum, certified.minimum), max(part.maximum, certified.maximum)
    )


def stick_margin(
    limits: CurvatureLimits | None, v: float, omega: float, offset: float = 0.0
) -> float:
    """[rad/s] by which the turn rate of a push may change before it is not certified any more.

    Negative where it is not certified now.

    Parameters
    ----------
    v, omega: [m/s], [rad/s] of the robot. offset: [m] by which the object lies to the left of its
        nominal place on the bumper.
    """
    if limits is None:
        return -math.inf
    here = shifted_limits(limits, offset) if offset else limits
    return min(here.maximum * v - omega, omega - here.minimum * v)
