"""Who may touch whom. PyBullet lets two touch when either's group is in the other's mask.

Feet, wheels and casters touch the floor alone; discs touch everything but the floor.
"""

import pybullet as pb

BODY, FLOOR, DISC, SUPPORT, WALL = 1, 2, 4, 8, 16
_MASKS = {
    BODY: BODY | FLOOR | DISC | WALL,
    FLOOR: BODY | SUPPORT,
    DISC: BODY | DISC | WALL,
    SUPPORT: FLOOR,
    WALL: BODY | DISC,
}


def set_group(client: int, body: int, link: int, group: int) -> None:
    """Put a link of a PyBullet body (-1 for its base) into a group."""
    pb.setCollisionFilterGroupMask(body, link, group, _MASKS[group], physicsClientId=client)
