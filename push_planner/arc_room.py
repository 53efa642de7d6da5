"""Where object and robot can be in a search over arcs: clear of obstacles, with room to turn."""

from typing import Any, NamedTuple

import numba

from push_model.arrays import Array
from push_planner.push_sweep import room_behind
from push_planner.run_bounds import run_time, stands
from push_planner.scene import LEAVING, TURNING, PushScene


class Room(NamedTuple):
    """Outlines ``(n, 2)`` [m], radii [m], and ``(sides, 2)`` [m] from contact to where the robot
    may turn; turning, keeps: [m] clearances there and on the way back. needed: [m] clearance of
    all poses, leaving: [m] that of the first ones, up to ``first`` [s] of cost. map: distance
    field."""

    object_points: Any
    robot_points: Any
    object_radius: float
    robot_radius: float
    backs: Any
    turning: float
    keeps: float
    needed: float
    leaving: float
    first: float
    map: Any


def room_of(scene: PushScene, pose: Array, backward: bool) -> Room:
    """What a search knows of the room.

    pose: ``(3,)`` [m, m, rad] of the object where the search begins. backward: whether that is the
    goal.
    """
    needed, time = scene.settings.safety_distance, scene.time
    return Room(
        *scene.bodies,
        scene.robot.footprint_radius + TURNING * needed,
        scene.robot_keeps(),
        needed,
        needed if backward else scene.leaving(pose),
        time.begin + run_time(LEAVING, 0.0, time.speeds),
        (scene.field.values, *scene.field.args),
    )


@numba.njit(cache=True)
def free(pose: Any, robot: Any, needed: float, room: Any) -> bool:
    """Whether object and robot keep ``needed`` [m] at a pose."""
    field, ox, oy, scale = room.map
    x, y, theta = robot
    if not stands(room.robot_points, room.robot_radius, x, y, theta, needed, field, ox, oy, scale):
        return False
    x, y, theta = pose
    return bool(
        stands(room.object_points, room.object_radius, x, y, theta, needed, field, ox, oy, scale)
    )


@numba.njit(cache=True)
def may_change(robot: Any, side: int, room: Any) -> bool:
    """Whether the robot can back off from a contact."""
    field, ox, oy, scale = room.map
    for back in room.backs[side]:
        if room_behind(
            robot, back, room.turning, room.keeps, field, room.robot_points, room.robot_radius,
            ox, oy, scale,
        ):  # fmt: skip
            return True
    return False
