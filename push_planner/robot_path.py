"""A way for the robot alone between two poses: turns on the spot and straight lines."""

import math
from enum import IntEnum

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from push_model import se2
from push_model.arrays import Array
from push_model.specs import RobotSpec
from push_model.trajectory import Trajectory, concatenate, line, rotation
from push_planner.distance_field import DistanceField
from push_planner.settings import PlannerSettings

_CELL = 0.02  # [m] of the search grid


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
    """Shortest way that keeps the robot's turning circle clear of the map and of circles.

    Parameters
    ----------
    start, goal: ``(3,)`` poses of the axle midpoint.
    circles: ``(n, 3)`` [m] x, y and the least distance of the axle midpoint to that point.

    Raises
    ------
    NoRobotPath
    """

    def clearance(x: Array, y: Array) -> Array:
        room = np.array([field.at(a, b) for a, b in zip(x, y, strict=True)])
        room -= robot.footprint_radius
        for cx, cy, radius in circles:
            room = np.minimum(room, np.hypot(x - cx, y - cy) - radius)
        return room

    ends = clearance(np.array([start[0], goal[0]]), np.array([start[1], goal[1]]))
    # The robot may already stand closer than it would like: ask no more than both ends have.
    slack = robot.footprint_radius - robot.body_radius
    needed = min(settings.safety_distance, float(ends.min()) - 1e-9)
    if ends[0] < -slack:
        raise NoRobotPath(RobotPathError.START_BLOCKED, "the robot stands too close to an obstacle")
    if ends[1] < -slack:
        raise NoRobotPath(
            RobotPathError.GOAL_BLOCKED, "the robot's goal is too close to an obstacle"
        )
    points = _grid_path(field, start, goal, circles, robot.footprint_radius + needed, needed)
    points = _straighten(points, field, circles, robot.footprint_radius + needed, needed)
    return _drive(points, start, goal, settings)


def _grid_path(
    field: DistanceField, start: Array, goal: Array, circles: Array, wall: float, extra: float
) -> Array:
    x0, x1, y0, y1 = field.grid.extent
    nx, ny = int((x1 - x0) / _CELL), int((y1 - y0) / _CELL)
    x = x0 + (np.arange(nx) + 0.5) * _CELL
    y = y0 + (np.arange(ny) + 0.5) * _CELL
    stride_x = np.clip(((x - x0) / field.grid.resolution).astype(int), 0, None)
    stride_y = np.clip(((y - y0) / field.grid.resolution).astype(int), 0, None)
    free = field.values[np.ix_(stride_y, stride_x)] >= wall
    gx, gy = np.meshgrid(x, y)
    for cx, cy, radius in circles:
        free &= np.hypot(gx - cx, gy - cy) >= radius + extra
    index = np.arange(nx * ny).reshape(ny, nx)
    rows, columns, weights = [], [], []
    for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1), (2, 1), (1, 2), (2, -1), (1, -2)):
        a = (slice(max(0, -dy), ny - max(0, dy)), slice(0, nx - dx))
        b = (slice(max(0, dy), ny - max(0, -dy)), slice(dx, nx))
        both = free[a] & free[b]
        rows.append(index[a][both])
        columns.append(index[b][both])
        weights.append(np.full(int(both.sum()), math.hypot(dx, dy) * _CELL))
    # Start and goal join the free cells around them.
    tips = [nx * ny, nx * ny + 1]
    for tip, pose in zip(tips, (start, goal), strict=True):
        gap = np.hypot(gx - pose[0], gy - pose[1])
        near = free & (gap < 3.0 * _CELL)
        rows.append(np.full(int(near.sum()), tip))
        columns.append(index[near])
        weights.append(gap[near] + 1e-9)
    graph = coo_array(
        (np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))),
        shape=(nx * ny + 2, nx * ny + 2),
    ).tocsr()
    distance, before = dijkstra(graph, directed=False, indices=tips[0], return_predecessors=True)
    if not np.isfinite(distance[tips[1]]):
        raise NoRobotPath(RobotPathError.NO_PATH, "no way for the robot between start and goal")
    cells = []
    cell = before[tips[1]]
    while cell != tips[0]:
        cells.append(cell)
        cell = before[cell]
    cells.reverse()
    inner = np.column_stack([gx.ravel()[cells], gy.ravel()[cells]]).reshape(-1, 2)
    return np.vstack([start[:2], inner, goal[:2]])


def _straighten(
    points: Array, field: DistanceField, circles: Array, wall: float, extra: float
) -> Array:
    def clear(a: Array, b: Array) -> bool:
        if field.segment(a, b, wall) < wall - 1e-9:
            return False
        along = b - a
        for cx, cy, radius in circles:
            t = np.clip(((cx - a[0]) * along[0] + (cy - a[1]) * along[1]) / (along @ along), 0, 1)
            if np.hypot(*(a + t * along - (cx, cy))) < radius + extra - 1e-9:
                return False
        return True

    kept = [points[0]]
    i = 0
    while i < len(points) - 1:
        j = len(points) - 1
        while j > i + 1 and not clear(points[i], points[j]):
            j -= 1
        kept.append(points[j])
        i = j
    return np.array(kept)


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
