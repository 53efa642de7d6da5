"""A way for the robot alone between two poses."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.disc_way import disc_way, reliefs
from push_model.distance_field import DistanceField
from push_model.obstacles import disc_capsules, scaled_capsules
from push_model.outlines import distance, inside
from push_model.room import chain_keeps, room_at
from push_model.shapes import densified
from push_model.specs import RobotSpec
from push_model.trajectory import Trajectory
from push_planner.robot_drive import Room, fastest_drive
from push_planner.settings import PlannerSettings

OUTLINE_SLACK = 5e-3
"""[m] by which circles that stand for an outline may ask for too much room."""
_OUTLINE_SPACING = 0.01  # [m] of points between which distances are interpolated


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
    found = _find_way(field, robot, settings.safety_distance, start, goal, disc_capsules(circles))
    capsules, ends, body, need = found.capsules, found.ends, found.body, found.need

    def keeps(chords: Array, margin: float) -> bool:
        at = (chords - field.args[:2]) * field.args[2]
        wanted = need + margin * field.args[2]
        return bool(chain_keeps(field.values, capsules, body, ends, wanted, at))

    tight = bool(ends[:, 2].any())
    room = _outline_room(field, robot, circles) if tight else None
    return fastest_drive(found.corners, start, goal, keeps, robot.differential, settings, room)


@dataclass(frozen=True)
class _Way:
    """Corners ``(n, 2)`` [m] and what a check of curves along them needs, see ``room.py``."""

    corners: Array
    capsules: Array
    body: float
    need: float
    ends: Array


def has_way(
    field: DistanceField,
    robot: RobotSpec,
    settings: PlannerSettings,
    start: Array,
    goal: Array,
    outline: Array,
    spare: float = 0.0,
) -> bool:
    """Whether the robot has a way between two poses ``(3,)`` around an outline ``(n, 2)`` [m].

    True also where it stands too close to something to plan a way: it has to back off first.
    spare: [m] that the passages are wider than ``plan_robot_path`` asks for, by twice as much.
    """
    capsules = np.column_stack(
        [
            outline,
            np.roll(outline, -1, axis=0),
            np.full(len(outline), robot.footprint_radius + OUTLINE_SLACK),
        ]
    )
    try:
        _find_way(field, robot, settings.safety_distance + spare, start, goal, capsules)
    except NoRobotPath as error:
        return error.code == RobotPathError.START_BLOCKED
    return True


def _find_way(
    field: DistanceField,
    robot: RobotSpec,
    margin: float,
    start: Array,
    goal: Array,
    capsules: Array,
) -> _Way:
    """margin: [m] that the turning circle keeps. capsules: ``(n, 5)`` [m] that the axle midpoint
    stays out of.

    Raises
    ------
    NoRobotPath
    """
    body = robot.footprint_radius * field.args[2]
    need = margin * field.args[2]
    # A bumper's corners reach farther than the body: with it in between, the robot can still leave.
    least = (robot.body_radius - robot.footprint_radius) * field.args[2]
    capsules = scaled_capsules(capsules, field.args[:2], field.args[2])
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
            f"{2.0 * (robot.footprint_radius + margin):.3f} m",
        )
    corners = np.vstack([start[:2], way[1:-1] * field.spacing + field.args[:2], goal[:2]])
    return _Way(corners, capsules, body, need, ends)


def _outline_room(field: DistanceField, robot: RobotSpec, circles: Array) -> Room:
    """The least distance [m] of the robot's outline to the map and the circles over a motion."""
    outline = densified(robot.outline, _OUTLINE_SPACING)
    reach = float(np.hypot(*outline.T).max())
    beside = circles[:, 2] - robot.footprint_radius  # [m] that the outline is to stay off

    def room(poses: Array) -> float:
        least = float(field.clearances(outline, poses).min())
        for (x, y, _), keep in zip(circles, beside, strict=True):
            away = poses[np.hypot(poses[:, 0] - x, poses[:, 1] - y) < least + keep + reach]
            if len(away):
                seen = np.array(
                    [se2.transform(se2.inverse(p), np.array([[x, y]]))[0] for p in away]
                )
                gap = distance(robot.outline, seen) * np.where(inside(robot.outline, seen), -1.0, 1)
                least = min(least, float(gap.min()) - keep)
        return least

    return room
