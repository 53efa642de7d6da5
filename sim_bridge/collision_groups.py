"""Which bodies collide. In PyBullet two do if the group of either is in the mask of the other.

Feet, wheels and casters touch the floor alone; discs touch everything but the floor. A wall is one
body for everybody, or one for robots and another one for objects, where their frictions differ.
"""

import pybullet as pb

OBJECT, FLOOR, DISC, SUPPORT, WALL, ROBOT, ROBOT_WALL, OBJECT_WALL = (1 << k for k in range(8))
_MASKS = {
    OBJECT: OBJECT | ROBOT | FLOOR | DISC | WALL | OBJECT_WALL,
    ROBOT: OBJECT | ROBOT | FLOOR | DISC | WALL | ROBOT_WALL,
    DISC: OBJECT | ROBOT | DISC | WALL | ROBOT_WALL,
    FLOOR: OBJECT | ROBOT | SUPPORT,
    SUPPORT: FLOOR,
    WALL: OBJECT | ROBOT | DISC,
    ROBOT_WALL: ROBOT | DISC,
    OBJECT_WALL: OBJECT,
}


def set_group(client: int, body: int, link: int, group: int) -> None:
    """Put a link of a PyBullet body (-1 for its base) into a group."""
    pb.setCollisionFilterGroupMask(body, link, group, _MASKS[group], physicsClientId=client)
