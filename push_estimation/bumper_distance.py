"""The distance from a robot's axle to its bumper: from a touch, while it pushes straight.

In contact, the bumper lies on the side of the object. The distance is therefore that of the axle's
middle to the line of that side, along the robot's heading.
"""

import math

import numpy as np

from push_estimation.intervals import TooLittle, interval_of_mean
from push_estimation.tracks import Track
from push_model import se2
from push_model.arrays import Array
from push_model.belief import Interval

_MOVES = 0.005  # [m/s] of an object that is pushed
_WINDOW = 12  # samples
_SHARED = 1e-4  # [m] error of all trials: the outline, the object's marker frame


def side_ahead(robot: Array, item: Array, outline: Array) -> tuple[float, Array, Array]:
    """The side of a convex outline ``(n, 2)`` [m], object frame, that a ray ahead of a robot hits
    first: distance along the ray [m], outward unit normal ``(2,)`` and a point ``(2,)``, map frame.

    Raises
    ------
    TooLittle: the robot does not face the object.
    """
    corners = se2.transform(item, outline)
    ahead = np.array([math.cos(robot[2]), math.sin(robot[2])])
    found: list[tuple[float, Array, Array]] = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = (b - a) / float(np.hypot(*(b - a)))
        normal = np.array([along[1], -along[0]])  # of a counter-clockwise outline
        closing = -float(ahead @ normal)
        if closing <= 1e-6:
            continue
        distance = float((robot[:2] - a) @ normal) / closing
        at = float((robot[:2] + distance * ahead - a) @ along)
        if distance > 0.0 and 0.0 <= at <= float(np.hypot(*(b - a))):
            found.append((distance, normal, a))
    if not found:
        raise TooLittle("the robot does not face the object")
    return min(found, key=lambda f: f[0])


def bumper_distance(pushes: list[Track], outline: Array) -> Interval:
    """[m] D, one trial a push: straight pushes against a flat side.

    Raises
    ------
    TooLittle: fewer than three pushes in which the object moved.
    """
    trials = []
    for push in pushes:
        if len(push.time) < 3 * _WINDOW:
            continue
        # over a window, or noise would be taken for motion; poses may be missing in it
        step = push.item[_WINDOW:, :2] - push.item[:-_WINDOW, :2]
        speed = np.hypot(*step.T) / (push.time[_WINDOW:] - push.time[:-_WINDOW])
        moving = np.flatnonzero(speed > _MOVES) + _WINDOW // 2
        if len(moving) < 2 * _WINDOW:
            continue
        chosen = moving[len(moving) // 2 : -_WINDOW // 2]  # it has settled on the bumper by then
        found = [side_ahead(push.robot[k], push.item[k], outline)[0] for k in chosen]
        trials.append(float(np.median(found)))
    return interval_of_mean(np.array(trials), _SHARED)
