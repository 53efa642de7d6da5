"""A way for the robot alone between two poses: turns on the spot and straight lines."""

import math
from enum import IntEnum

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.disc_way import disc_way, reliefs
from push_model.distance_field import DistanceField
from push_model.obstacles import disc_capsules, scaled_capsules
from push_model.room import room_at
from push_model.specs import RobotSpec
from push_model.trajectory import Trajectory, concatenate, line, rotation
from push_planner.settings import PlannerSettings


class RobotPathError(IntEnum):
    """Codes of the PlanRobotPath service."""

    NONE = 0
    START_BLOCKED = 1
    GOAL_BLOCKED = 2
    NO_PATH = 3


class NoRobotPath(Exception):
    """Raised when the robot has no way; carries the code."""

    def __init__(self, code: int, message: str) -> None:
        super().__init__(message)
        self.code = code


def plan_robot_path(
    field: DistanceField,
    robot: RobotSpec,
    settings: PlannerSettings,
    start: Array,
    goal: Array,
    circles: Array,
) -> Trajectory:
    """Short way that keeps the robot's turning circle clear of the map and of circles.

    It keeps ``safety_distance`` as well, but where start or goal has less it keeps what they have
    until it has come away from them.

    Parameters
    ----------
    start, goal: ``(3,)`` poses of the axle midpoint.
    circles: ``(n, 3)`` [m] x, y and the least distance of the axle midpoint to that point.

    Raises
    ------
    NoRobotPath
    """
    body = robot.footprint_radius * field.args[2]
    need = settings.safety_distance * field.args[2]
    # A bumper's corners reach farther than the body: with it in between, the robot can still leave.
    least = (robot.body_radius - robot.footprint_radius) * field.args[2]
    capsules = scaled_capsules(disc_capsules(circles), field.args[:2], field.args[2])
    tips = field.lattice(start[:2]), field.lattice(goal[:2])
    for tip, code, what in (
        (tips[0], RobotPathError.START_BLOCKED, "the robot stands"),
        (tips[1], RobotPathError.GOAL_BLOCKED, "the robot's goal is"),
    ):
        room = room_at(field.values, capsules, body, tip[0], tip[1])
        if room < least:
            raise NoRobotPath(
                code,
                f"{what} too close to an obstacle: its distance is "
                f"{(room + body) * field.spacing:.3f} m, but the radius of the robot is "
                f"{robot.body_radius:.3f} m",
            )
    ends = reliefs(field.values, capsules, body, need, least, tips)
    way = disc_way(field.values, capsules, body, *tips, ends, need)
    if not len(way):
        raise NoRobotPath(
            RobotPathError.NO_PATH,
            "no path of the robot connects start and goal; the robot needs passages of at least "
            f"{2.0 * (robot.footprint_radius + settings.safety_distance):.3f} m",
        )
    points = np.vstack([start[:2], way[1:-1] * field.spacing + field.args[:2], goal[:2]])
    return _drive(points, start, goal, settings)


def _drive(points: Array, start: Array, goal: Array, settings: PlannerSettings) -> Trajectory:
    parts: list[Trajectory] = []
    heading = float(start[2])

    def turn(at: Array, target: float) -> float:
        angle = se2.wrap(target - heading)
        if abs(angle) > 1e-3:
            pose = np.array([at[0], at[1], heading])
            parts.append(rotation(pose, angle, settings.turn_rate, settings.turn_acceleration))
        return heading + angle

    for a, b in zip(points[:-1], points[1:], strict=True):
        gap = float(np.hypot(*(b - a)))
        if gap < 2e-3:
            continue
        heading = turn(a, math.atan2(b[1] - a[1], b[0] - a[0]))
        pose = np.array([a[0], a[1], heading])
        parts.append(line(pose, gap, settings.move_speed, settings.move_acceleration))
    heading = turn(goal[:2], float(goal[2]))
    if not parts:
        parts.append(rotation(start, 1e-4, settings.turn_rate, settings.turn_acceleration))
    return concatenate(parts)
