"""A push under another belief than the one that it was planned with."""

import math
from dataclasses import replace

import numpy as np

from push_model import se2
from push_model.pushable_sides import pushable_sides
from push_model.shapes import Side
from push_model.specs import ObjectSpec, RobotSpec
from push_model.stable_push import contact_on_side, curvature_limits
from push_model.stick_certificate import ContactBelief, certified_limits
from push_mpc.line_contact import line_contact
from push_mpc.task import Push

_SAME_PLACE, _SAME_HEADING = 0.02, 0.2  # [m], [rad] by which a side's nominal contact may differ


class Unstable(Exception):
    """Raised when not even a straight push is stable; says why."""


def believed_push(
    push: Push, robot: RobotSpec, item: ObjectSpec, believed: ContactBelief | None
) -> Push:
    """The push with the stable curvatures and the contact that follow from robot and object.

    The side is the one whose nominal contact lies nearest to the push's; its curvatures are those
    of the stable-push analysis (S3). Where the contact lies at no side, the limits stay.

    believed: intervals of friction and centre of mass, for the certified curvatures; None without.

    Raises
    ------
    Unstable: the straight push would slip or tip over an end of the contact.
    """
    line = line_contact(robot, item, push.grasp)
    side = nearest_side(push, robot, item)
    if side is None:
        return replace(push, line=line)
    nearest = contact_on_side(side, robot.flat_bumper.width)
    limits = curvature_limits(
        nearest, robot.push_distance, item.contact_friction, item.limit_surface()
    )
    if limits is None:
        raise Unstable(
            f"with a contact friction of {item.contact_friction:g} not even a straight push is "
            "stable"
        )
    certified = None if believed is None else certified_limits(item, robot, believed, side.index)
    return replace(
        push, limits=limits, line=line, uncertain=believed is not None, certified=certified
    )


def nearest_side(push: Push, robot: RobotSpec, item: ObjectSpec) -> Side | None:
    """The side whose nominal contact lies nearest to that of a push; None where it lies at none."""
    place = se2.compose(push.grasp, se2.pose(*item.com, 0.0))
    ahead = np.array([robot.push_distance, 0.0, 0.0])
    nearest, gap = None, math.inf
    for side in pushable_sides(item.geometry, robot):
        contact = contact_on_side(side, robot.flat_bumper.width)
        off = se2.between(contact.object_pose + ahead, place)
        away = math.hypot(off[0], off[1])
        if away < min(gap, _SAME_PLACE) and abs(off[2]) < _SAME_HEADING:
            nearest, gap = side, away
    return nearest
