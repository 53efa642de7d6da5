"""The friction between bumper and object, from pushes in a curve during which the object slides.

Under an ellipsoidal limit surface the force on the object has the direction of the velocity of its
centre of mass, (3.4). Where the contact slides, the force is at the edge of the friction cone. The
ratio of the tangential to the normal component of that velocity is then mu, whatever the floor. An
error of the direction of the normal adds to the ratio in curves to one side and takes off in curves
to the other; with both, it is estimated beside mu.
"""

import math

import numpy as np

from push_estimation.bumper_distance import side_ahead
from push_estimation.intervals import TooLittle, solve_with_intervals
from push_estimation.tracks import Track, motion
from push_model import se2
from push_model.arrays import Array
from push_model.belief import Interval

_SPAN = 0.2  # [s] of a window
_SLIDES = 0.0025  # [m/s] along the bumper
_FLUSH = math.radians(2.0)  # between bumper and side
_PUSHES = 0.01  # [m/s]
_SHARED = 0.01  # of mu: inertia, and pressure that is not that of the ellipsoid


def sliding_ratios(push: Track, outline: Array, com: Array, distance: float) -> Array:
    """``(k,)`` signed ratios of the centre of mass's velocity along and against the bumper, for
    windows in which the contact slides.

    com: ``(2,)`` [m] in the object's frame. distance: [m] of the bumper from the axle.
    """
    found = []
    start = float(push.time[0]) if len(push.time) else 0.0
    while len(push.time) and start + _SPAN <= push.time[-1]:
        part = push.between(start, start + _SPAN)
        start += _SPAN
        if len(part.time) < 8:
            continue
        robot, item = motion(part.time, part.robot), motion(part.time, part.item)
        ahead = np.array([math.cos(robot.pose[2]), math.sin(robot.pose[2])])
        left = np.array([-ahead[1], ahead[0]])
        try:
            gap, normal, _ = side_ahead(robot.pose, item.pose, outline)
        except TooLittle:
            continue
        skew = math.atan2(*(float(v) for v in (-normal @ left, -normal @ ahead)))
        if abs(skew) > _FLUSH or gap > distance + 0.002:
            continue
        touch = robot.pose[:2] + gap * ahead
        centre = se2.transform(item.pose, com[None])[0]
        of_object = _velocity_at(item.twist, touch - item.pose[:2])
        of_robot = _velocity_at(robot.twist, touch - robot.pose[:2])
        slide = float((of_object - of_robot) @ left)
        v = _velocity_at(item.twist, centre - item.pose[:2])
        inward = -normal
        along = np.array([-inward[1], inward[0]])
        into = float(v @ inward)
        # friction on the object is opposite to its sliding
        if abs(slide) > _SLIDES and into > _PUSHES and slide * float(v @ along) < 0.0:
            found.append(float(v @ along) / into)
    return np.array(found)


def contact_friction(pushes: list[Track], outline: Array, com: Array, distance: float) -> Interval:
    """mu of the contact, from curved pushes to both sides.

    Raises
    ------
    TooLittle: not enough pushes in which the object slid along the bumper.
    """
    ratios = [sliding_ratios(p, outline, com, distance) for p in pushes]
    means = np.array([float(np.median(r)) for r in ratios if len(r) >= 2])
    sides = np.sign(means)
    if min((sides > 0).sum(), (sides < 0).sum()) < 2:
        raise TooLittle(
            "the object has to slide along the bumper in two curves to each side; "
            f"it did in {int((sides > 0).sum())} and {int((sides < 0).sum())}"
        )
    rows = np.column_stack([sides, np.ones(len(means))])
    shared = np.array([_SHARED * float(np.abs(means).mean()), 0.0])
    mu, _ = solve_with_intervals(rows, means, shared)
    return mu


def _velocity_at(twist: Array, arm: Array) -> Array:
    """``(2,)`` [m/s] of a point at an arm ``(2,)`` [m] from where a twist ``(3,)`` is given."""
    return np.array([twist[0] - twist[2] * arm[1], twist[1] + twist[2] * arm[0]])
