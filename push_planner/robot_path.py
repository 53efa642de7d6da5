"""A way for the robot alone between two poses."""

import itertools
from enum import IntEnum

import numpy as np

from push_model.arrays import Array
from push_model.disc_way import disc_way, reliefs
from push_model.distance_field import DistanceField
from push_model.obstacles import disc_capsules, scaled_capsules
from push_model.room import room_at, segment_keeps
from push_model.specs import RobotSpec
from push_model.trajectory import Trajectory
from push_planner.robot_drive import fastest_drive
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
    """Fast way that keeps the robot's turning circle clear of the map and of circles.

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

    def keeps(chords: Array, margin: float) -> bool:
        at = (chords - field.args[:2]) * field.args[2]
        wanted = need + margin * field.args[2]
        return all(
            segment_keeps(field.values, capsules, body, ends, wanted, *a, *b)
            for a, b in itertools.pairwise(at)
        )

    return fastest_drive(points, start, goal, keeps, robot.differential, settings)
