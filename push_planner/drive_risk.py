"""Drives of the robot between two pushes that may be blocked.

A push may end up to a few millimetres beside its planned end. If the passages of the drive that
follows are only as wide as they must be, the drive is then blocked, and the job needs a new plan.
Searches therefore count such a drive as longer than it is.
"""

import math

from push_model import se2
from push_model.arrays import Array
from push_planner.robot_path import has_way
from push_planner.scene import PushScene, PushSide

_STRAY = 0.003  # [m] by which robot and object may end a push elsewhere than planned
TIGHT = 3.0
"""[s] that a drive counts more which may be blocked; a new plan takes about twice that."""


def drive_risk(scene: PushScene, pose: Array, before: PushSide, after: PushSide) -> float:
    """[s] that the drive from side to side of the object at a pose ``(3,)`` of its centre of mass
    counts more than it takes; infinite if there is no way."""
    start, goal = (scene.standoff(side.robot_pose(pose), side) for side in (before, after))
    outline = se2.transform(pose, scene.shape.outline)
    given = scene.field, scene.robot, scene.settings, start, goal, outline
    if has_way(*given, spare=_STRAY):
        return 0.0
    return TIGHT if has_way(*given) else math.inf
