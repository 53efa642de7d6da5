"""Stable pushes: motions of a pusher during which the object does not move relative to it.

Lynch & Mason (1996). The pusher frame has x along the pushing direction and its origin at the
middle of the bumper; the object's side lies on x = 0. A differential drive rotates about points of
its axle line x = -axle_distance, which turns the region of stable rotation centres into limits on
the curvature of the robot's path (section 2.1.1, Fig. 2.2).

There are two methods. ``curvature_limits`` is exact for a known limit surface. If the direction of
its force is that of the centre of mass (the ellipsoid), the friction limit has a closed form:
the centre of mass, at (axle_distance + a, y) from the axle midpoint, moves along
(1 - kappa y, kappa (axle_distance + a)), which must lie in the friction cone. For the centred
object that is 1/kappa = (a + axle_distance)/mu; an offset y adds to the radius, as in (2.54).
``lynch_mason_stable`` is the construction that holds for every pressure distribution.
"""

import math
from dataclasses import dataclass

import numpy as np

from push_model.arrays import Array
from push_model.limit_surface import LimitSurface
from push_model.shapes import Shape, Side

_STRAIGHTEST = 1e-6  # [1/m], curvature that counts as straight


@dataclass(frozen=True)
class PusherContact:
    """A flat bumper against a side of an object, in the pusher frame.

    centre: ``(2,)`` [m] of mass; centre[0] > 0 is its distance from the contact line.
    right, left: [m] y of the contact's ends, right < left.
    heading: [rad] of the object in the pusher frame.
    """

    centre: Array
    right: float
    left: float
    heading: float

    @property
    def object_pose(self) -> Array:
        """``(3,)`` of the object in the pusher frame."""
        return np.array([self.centre[0], self.centre[1], self.heading])


@dataclass(frozen=True)
class CurvatureLimits:
    """Stable curvatures of the robot's path: minimum < 0 < maximum, both [1/m].

    minimum = 1/r_lim-, maximum = 1/r_lim+.
    """

    minimum: float
    maximum: float

    def scaled(self, factor: float) -> "CurvatureLimits":
        """The limits scaled by a fraction 0 < factor <= 1."""
        return CurvatureLimits(self.minimum * factor, self.maximum * factor)


def contact_on_side(side: Side, pusher_width: float, along: float | None = None) -> PusherContact:
    """Place the middle of a bumper on a side.

    Parameters
    ----------
    side: of the object.
    pusher_width: [m] of the flat bumper.
    along: [m] position of the bumper's middle from the side's start. By default the point of the
        side that is closest to the centre of mass, moved inward so that the bumper reaches beyond
        neither end of a side that is longer than the bumper, and to where it has room.
    """
    foot = float(-side.start @ side.tangent)  # of the centre of mass, along the side
    if along is None:
        rim = min(pusher_width / 2.0, side.length / 2.0)
        along = min(max(foot, rim), side.length - rim)
        if side.room is not None:
            along = min(max(along, side.room[0]), side.room[1])
    # Pusher x is the inward normal, so pusher y is minus the side's direction.
    half = pusher_width / 2.0
    left = min(along, half)
    right = -min(side.length - along, half)
    if side.supports:
        low, high = side.touched(along - half, along + half) or (along, along)
        left, right = along - low, along - high
    if right >= left:
        raise ValueError(f"the bumper does not touch side {side.index}")
    return PusherContact(np.array([side.distance, along - foot]), right, left, -side.heading)


def contact_margins(
    curvature: float,
    contact: PusherContact,
    axle_distance: float,
    friction: float,
    surface: LimitSurface,
) -> tuple[float, float]:
    """Margins of a motion against slipping and against pivoting about an end of the contact.

    Returns
    -------
    friction margin: mu - |ft|/fn, negative when the contact would slide, -inf when it would open.
    edge margin: [m] distance of the line of force to the nearer end, negative when outside.
    """
    x, y = axle_distance + contact.centre[0], contact.centre[1]
    vx, vy = 1.0 - curvature * y, curvature * x
    # The limit surface is defined in the object's frame.
    c, s = math.cos(contact.heading), math.sin(contact.heading)
    ox, oy, torque = surface.wrench(np.array([c * vx + s * vy, -s * vx + c * vy, curvature]))
    fx, fy = c * ox - s * oy, s * ox + c * oy
    if fx <= 0.0:
        return -math.inf, -math.inf
    at = contact.centre[1] - (contact.centre[0] * fy + torque) / fx
    return friction - abs(fy) / fx, min(at - contact.right, contact.left - at)


def curvature_limits(
    contact: PusherContact,
    axle_distance: float,
    friction: float,
    surface: LimitSurface,
    tightest: float = 100.0,
) -> CurvatureLimits | None:
    """The interval of stable curvatures about the straight push, S3.

    Parameters
    ----------
    contact: bumper on the side.
    axle_distance: [m] D, from the wheel axle forward to the bumper's face.
    friction: of the contact.
    surface: of the object on the floor; only the ratios of its wrenches matter.
    tightest: [1/m] the greatest curvature that is of interest.

    Returns
    -------
    None when not even the straight push is stable.
    """

    def stable(curvature: float) -> bool:
        margins = contact_margins(curvature, contact, axle_distance, friction, surface)
        return min(margins) >= 0.0

    if not stable(0.0):
        return None

    def edge(sign: float) -> float:
        inside, outside = 0.0, sign * tightest
        for factor in np.geomspace(1e-3, 1.0, 60):  # find the first loss of stability
            if not stable(sign * tightest * factor):
                outside = sign * tightest * factor
                break
            inside = sign * tightest * factor
        else:
            return inside
        while abs(outside - inside) > 1e-10 * tightest:
            middle = 0.5 * (inside + outside)
            inside, outside = (middle, outside) if stable(middle) else (inside, middle)
        return inside

    return CurvatureLimits(min(edge(-1.0), -_STRAIGHTEST), max(edge(1.0), _STRAIGHTEST))


def shifted_limits(limits: CurvatureLimits, offset: float) -> CurvatureLimits:
    """(2.54): limits of a centred object for one whose centre lies ``offset`` [m] to the left.

    R_lim + y_or is the radius of the robot's axle midpoint; exact for friction limits under an
    ellipsoidal limit surface. Each radius is kept on its side of the axle midpoint.
    """
    right = min(1.0 / limits.minimum + offset, -1e-3)
    left = max(1.0 / limits.maximum + offset, 1e-3)
    return CurvatureLimits(1.0 / right, 1.0 / left)


def lynch_mason_stable(
    centres: Array, turn: int, contact: PusherContact, shape: Shape, friction: float
) -> "np.typing.NDArray[np.bool_]":
    """Which rotation centres are stable for every pressure distribution with the known centroid.

    Parameters
    ----------
    centres: ``(n, 2)`` [m] rotation centres, pusher frame.
    turn: +1 counter-clockwise, -1 clockwise.
    contact: bumper on the side; a bumper contact touches at its two ends at least.
    shape: the object, whose outline bounds the support.
    friction: of the contact.

    Notes
    -----
    Procedure STABLE of Lynch & Mason (1996): (a) the velocity of every support point lies in
    the friction cone's dual half-planes, i.e. outside the band of two lines perpendicular to each
    cone edge that hold the object between them; (b) for each end of the contact at distance p from
    the centre of mass, outside the band between the perpendicular bisector and the line at
    r^2/p beyond the centre of mass, r being the radius of the support, so that the force passes
    between the ends.
    """
    q = np.asarray(centres, dtype=np.float64)
    c, s = math.cos(contact.heading), math.sin(contact.heading)
    support = shape.outline @ np.array([[c, s], [-s, c]]) + contact.centre
    angle = math.atan(friction)
    ok = np.ones(len(q), dtype=bool)
    for inner in ((math.sin(angle), math.cos(angle)), (math.sin(angle), -math.cos(angle))):
        # velocity of p about q is turn * (-(py - qy), px - qx)
        velocity = turn * (
            -(support[None, :, 1] - q[:, None, 1]) * inner[0]
            + (support[None, :, 0] - q[:, None, 0]) * inner[1]
        )
        ok &= (velocity >= 0.0).all(axis=1)
    for y, side in ((contact.right, 1.0), (contact.left, -1.0)):
        arm = contact.centre - np.array([0.0, y])
        p = float(np.hypot(*arm))
        along = (q - contact.centre) @ arm / p
        beyond = along >= shape.circumradius**2 / p
        behind = along <= -p / 2.0
        ok &= beyond if side * turn > 0 else behind
    return ok
