"""Goals of several objects, as they come in one message, and when they are the same."""

import math
from collections.abc import Collection, Mapping

from push_model import se2
from push_model.arrays import Array
from push_model.jobs import GoalRefused, JobError
from push_msgs.msg import Poses
from push_ros.conversions import poses_from_ros
from push_ros.validation import InvalidMessage, check_frame

_SAME = 1e-6  # [m], [rad] within which goals are those that are pursued


def goals_of(message: Poses, items: Collection[str]) -> dict[str, Array]:
    """Goals ``(3,)`` [m, m, rad] by name. items: names of the objects that there are.

    Raises
    ------
    GoalRefused: the message is malformed, or names other objects.
    """
    try:
        check_frame(message.header.frame_id, "the goals")
    except InvalidMessage as error:
        raise GoalRefused(JobError.UNKNOWN_FRAME, str(error)) from None
    unknown = [n for n in message.names if n not in items]
    if unknown:
        text = f"unknown objects: {', '.join(unknown)}; expected of: {', '.join(items)}"
        raise GoalRefused(JobError.UNKNOWN_OBJECT, text)
    try:
        goals, refused = poses_from_ros(message)
    except InvalidMessage as error:
        raise GoalRefused(JobError.INVALID_GOAL, str(error)) from None
    if refused or not goals:
        text = "; ".join(refused) or "no goals; name at least one object"
        raise GoalRefused(JobError.INVALID_GOAL, text)
    return goals


def same_goal(one: Array, two: Array) -> bool:
    """Whether two goals ``(3,)`` [m, m, rad] are one."""
    off = one - two
    return math.hypot(off[0], off[1]) < _SAME and abs(se2.wrap(float(off[2]))) < _SAME


def same_goals(one: Mapping[str, Array], two: Mapping[str, Array]) -> bool:
    """Whether goals ``(3,)`` [m, m, rad] by name are the same ones."""
    return one.keys() == two.keys() and all(same_goal(one[name], two[name]) for name in one)
