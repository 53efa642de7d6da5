"""The friction of contacts in PyBullet, which multiplies a coefficient of each of the two bodies.

Robots get the root of the friction among them, objects their friction with robots over that root,
and walls one body for robots and one for objects. Robot on robot, on object and on wall, and object
on wall then have the friction that they are given; that of object on object is divided by the
friction among robots. Where robots have a friction of 1 among them, nothing is changed.
"""

import math
from collections.abc import Iterable

from push_model.settings import SettingsError
from push_model.specs import RobotSpec


def robot_surface(robots: Iterable[RobotSpec]) -> float:
    """PyBullet's coefficient of every robot of a world; 1 where no two can touch.

    Raises
    ------
    SettingsError: the robots have different frictions among them.
    """
    found = [robot.robot_friction for robot in robots]
    if len(found) < 2:
        return 1.0
    if len(set(found)) > 1:
        raise SettingsError(
            "robot_friction: PyBullet's world needs one value for all robots, got "
            + ", ".join(f"{v:g}" for v in sorted(set(found)))
        )
    return math.sqrt(found[0])
