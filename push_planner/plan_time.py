"""The cost (2.10) of a plan, as the time that it takes.

The thesis adds lengths: of the pushes, and between the robot's places before and after a change of
the side. Here each push takes the time for its curve at the greatest speed that wheels and settings
allow. Pushes in a row on the same side are one run, in which the robot does not stop: a run takes
the time to speed up and to brake once. A change of the side takes the time of the robot's drive
around the object in free space, and that of backing off and approaching.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from push_model.arrays import Array
from push_model.distance_field import DistanceField
from push_model.occupancy import OccupancyGrid
from push_model.push_segment import PushSegment
from push_model.shapes import densified
from push_model.specs import RobotSpec
from push_planner.push_curve import PushCurve
from push_planner.robot_path import OUTLINE_SLACK, NoRobotPath, plan_robot_path
from push_planner.settings import PlannerSettings

_SAMPLES = 65  # along a curve
_SPACING = 0.01  # [m] of points on the outline that the robot drives around
_CELL = 0.02  # [m] of the empty map on which it does


class PlanTime:
    """Times of pushes and of changes of the side.

    pace: [s/m] of a straight push at full speed; no push takes less. begin: [s] that each run
    takes longer because it begins and ends at rest. changes: ``(sides, sides)`` [s], 0 on the
    diagonal. speeds: pace, half the track [m], greatest speed of a wheel [m/s].
    """

    def __init__(
        self,
        robot: RobotSpec,
        settings: PlannerSettings,
        outline: Array,
        behind: Mapping[int, Array],
    ) -> None:
        """outline: ``(n, 2)`` [m] of the object. behind: ``(3,)`` pose of the robot, behind each
        side and clear of it, in the frame of the outline, by the index of the side."""
        drive = robot.differential
        self._top, self._half = (
            (1.0 - settings.wheel_reserve) * drive.max_speed,
            drive.half_track,
        )
        self._speed, self._contact_time = settings.push_speed, settings.contact_time
        speed = min(self._speed, self._top)
        self.pace, self.begin = 1.0 / speed, speed / settings.push_acceleration
        self.speeds = self.pace, self._half, self._top
        corners = tuple((float(x), float(y)) for x, y in outline)
        poses = tuple((float(x), float(y), float(t)) for x, y, t in behind.values())
        self._numbers = {index: number for number, index in enumerate(behind)}
        drives = np.array(_drives(robot, settings, corners, poses))
        self.changes = drives + settings.contact_time * (1.0 - np.eye(len(poses)))

    def of_push(self, curve: PushCurve) -> float:
        """[s] of a push along a curve, at full speed from end to end."""
        points, _, curvature = curve.sample(_SAMPLES)
        pace = np.maximum(1.0 / self._speed, (1.0 + self._half * np.abs(curvature)) / self._top)
        parts = np.hypot(*np.diff(points, axis=0).T)
        mean = float(parts @ (0.5 * (pace[1:] + pace[:-1])) / parts.sum())
        return curve.length * mean

    def change(self, before: int, after: int) -> float:
        """[s] of a change from a side to another, by their indices."""
        return float(self.changes[self._numbers[before], self._numbers[after]])

    def first_change(self, on_side: int | None, first: int, change_weight: float = 1.0) -> float:
        """[s] until a plan's first push begins, by the index of its side.

        on_side: of the side on which the robot pushes when the plan begins. None, the same, or one
        on which nothing is planned: 0.
        """
        if on_side in (None, first) or on_side not in self._numbers:
            return 0.0
        return change_weight * self.change(on_side, first) + self.begin

    def of_plan(
        self,
        segments: Sequence[PushSegment],
        change_weight: float = 1.0,
        on_side: int | None = None,
    ) -> float:
        """[s] of pushes one after another: the cost of a plan.

        change_weight: fraction of the time of a change of the side that counts.
        on_side: index of the side on which the robot pushes when the plan begins.
        """
        total = self.first_change(on_side, segments[0].side, change_weight)
        before: PushSegment | None = None
        for s in segments:
            goes_on = before is not None and s.side == before.side and not (s.turns or before.turns)
            if s.turns:
                total += float(s.trajectory.time[-1])
            else:
                curve = PushCurve(s.robot_start, s.robot_end, s.k_start, s.k_end, s.length)
                total += self.of_push(curve) + self.begin * (not goes_on)
            if before is not None:
                change = self.change(before.side, s.side)
                # After a push on a corner the robot backs off, also if it goes on on the same side.
                total += change_weight * max(change, before.turns * self._contact_time)
            before = s
        return total


@lru_cache(maxsize=64)
def _drives(
    robot: RobotSpec,
    settings: PlannerSettings,
    corners: tuple[tuple[float, float], ...],
    poses: tuple[tuple[float, float, float], ...],
) -> tuple[tuple[float, ...], ...]:
    """[s] from each pose to each other one, around the outline."""
    points = densified(np.array(corners), _SPACING)
    radius = robot.footprint_radius + OUTLINE_SLACK
    circles = np.column_stack([points, np.full(len(points), radius)])
    reach = float(np.abs(points).max() + np.abs(np.array(poses)[:, :2]).max()) + 6.0 * radius
    cells = 2 * int(np.ceil(reach / _CELL))
    empty = OccupancyGrid(np.zeros((cells, cells), dtype=bool), _CELL, np.array([-reach, -reach]))
    field = DistanceField(empty)
    result = np.zeros((len(poses), len(poses)))
    for i, start in enumerate(poses):
        for j in range(i):
            begin, end = np.array(start), np.array(poses[j])
            try:
                way = plan_robot_path(field, robot, settings, begin, end, circles)
                result[i, j] = result[j, i] = way.time[-1]
            except NoRobotPath:  # out of a recess: straight
                apart = float(np.hypot(*(end - begin)[:2]))
                result[i, j] = result[j, i] = apart / settings.move_speed
    return tuple(tuple(row) for row in result.tolist())
