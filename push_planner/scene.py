"""Robot, object and map together: what fits where, and what a push sweeps."""

import math
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from push_model import se2
from push_model.arrays import Array
from push_model.shapes import densified
from push_model.specs import ObjectSpec, RobotSpec
from push_model.stable_push import (
    CurvatureLimits,
    PusherContact,
    contact_on_side,
    curvature_limits,
)
from push_planner.distance_field import DistanceField, lookup, points_clearance
from push_planner.push_curve import PushCurve
from push_planner.settings import PlannerSettings

_OUTLINE_SPACING = 0.01  # [m]
_SWEEP_SPACING = 0.01  # [m]
_COARSEST = 16  # samples of a sweep from one of the first to the next


@numba.njit(cache=True, fastmath=True)
def push_clearance(
    start: Any,
    end: Any,
    k_start: float,
    k_end: float,
    count: int,
    needed: float,
    offset: Any,
    field: Any,
    robot_points: Any,
    object_points: Any,
    robot_radius: float,
    object_radius: float,
    ox: float,
    oy: float,
    scale: float,
) -> float:
    """Least clearance of robot and object on ``count`` poses of a push curve.

    Coarse samples come first, then those between them: a push that collides is found out early.
    Stops below ``needed``.
    """
    x0, y0, theta = start[0], start[1], start[2]
    dx, dy = end[0] - x0, end[1] - y0
    ct, st = math.cos(theta), math.sin(theta)
    x, y = ct * dx + st * dy, -st * dx + ct * dy
    turn = end[2] - theta
    c, s = k_end * math.cos(turn), k_end * math.sin(turn)
    cell = 1.0 / scale  # interpolated distances can fall faster than the way does
    least = 1e9
    stride = _COARSEST
    first = 0
    while stride >= 1:
        for k in range(first, count, _COARSEST if first == 0 else 2 * stride):
            t = k / (count - 1)
            h, hi, hf = t * t * (3.0 - 2.0 * t), t * (t - 1.0) ** 2, t * t * (t - 1.0)
            d, di, df = 6.0 * t * (1.0 - t), (t - 1.0) * (3.0 * t - 1.0), t * (3.0 * t - 2.0)
            u, v = h * x + hi * k_start + hf * c, h * y + hf * s
            heading = theta + math.atan2(d * y + df * s, d * x + di * k_start + df * c)
            px, py = x0 + ct * u - st * v, y0 + st * u + ct * v
            if lookup(field, px, py, ox, oy, scale) - robot_radius - cell < least:
                e = points_clearance(field, robot_points, px, py, heading, ox, oy, scale)
                least = min(least, e)
            ch, sh = math.cos(heading), math.sin(heading)
            qx = px + ch * offset[0] - sh * offset[1]
            qy = py + sh * offset[0] + ch * offset[1]
            if lookup(field, qx, qy, ox, oy, scale) - object_radius - cell < least:
                turned = heading + offset[2]
                e = points_clearance(field, object_points, qx, qy, turned, ox, oy, scale)
                least = min(least, e)
            if least < needed:
                return float(least)
        stride //= 2
        first = stride
    return float(least)


@numba.njit(cache=True, fastmath=True)
def _rooms(
    robots: Any,
    back: Any,
    turning: float,
    needed: float,
    field: Any,
    robot_points: Any,
    ox: float,
    oy: float,
    scale: float,
) -> Any:
    """Whether the robot at contact poses (n, 3) can back off by ``back`` (m,) and turn there."""
    result = np.zeros(robots.shape[0], dtype=np.bool_)
    for i in range(robots.shape[0]):
        x, y, theta = robots[i, 0], robots[i, 1], robots[i, 2]
        c, s = math.cos(theta), math.sin(theta)
        far = back[-1]
        if lookup(field, x - far * c, y - far * s, ox, oy, scale) < turning:
            continue
        good = True
        for b in back:
            d = points_clearance(field, robot_points, x - b * c, y - b * s, theta, ox, oy, scale)
            if d < needed:
                good = False
                break
        result[i] = good
    return result


@numba.njit(cache=True, fastmath=True)
def _clearances(field: Any, poses: Any, points: Any, ox: float, oy: float, scale: float) -> Any:
    """Least clearance of an outline at each of the poses (n, 3); 0 with its origin in a wall."""
    result = np.zeros(poses.shape[0])
    for i in range(poses.shape[0]):
        x, y = poses[i, 0], poses[i, 1]
        if lookup(field, x, y, ox, oy, scale) > 0.0:
            result[i] = points_clearance(field, points, x, y, poses[i, 2], ox, oy, scale)
    return result


@numba.njit(cache=True)
def sweep_count(length: float) -> int:
    """Samples of the sweep of a push so long [m]."""
    return max(8, int(length / _SWEEP_SPACING) + 2)


@dataclass(frozen=True)
class PushSide:
    """A side that can be pushed on: where the bumper goes and which curvatures are stable.

    nominal: limits by the stable-push analysis; trusted: the part of them that plans may use.
    """

    index: int
    contact: PusherContact
    nominal: CurvatureLimits
    trusted: CurvatureLimits

    def robot_pose(self, object_pose: Array) -> Array:
        """Axle midpoint ``(3,)`` when in contact with the object at ``object_pose`` ``(3,)``."""
        return se2.compose(object_pose, se2.inverse(self.grasp))

    @property
    def grasp(self) -> Array:
        """Pose ``(3,)`` of the object in the robot frame when in contact."""
        return self._grasp

    _grasp: Array


def push_sides(robot: RobotSpec, item: ObjectSpec, friction_trust: float) -> tuple[PushSide, ...]:
    """The sides of the object on which at least the straight push is stable (S3)."""
    surface = item.limit_surface()
    sides = []
    for side in item.geometry.sides:
        contact = contact_on_side(side, robot.flat_bumper.width)
        limits = curvature_limits(contact, robot.push_distance, item.contact_friction, surface)
        if limits is not None:
            grasp = contact.object_pose + np.array([robot.push_distance, 0.0, 0.0])
            sides.append(
                PushSide(side.index, contact, limits, limits.scaled(friction_trust), grasp)
            )
    return tuple(sides)


class PushScene:
    """Collision questions of the planner."""

    def __init__(
        self, field: DistanceField, robot: RobotSpec, item: ObjectSpec, settings: PlannerSettings
    ) -> None:
        self.field = field
        self.robot = robot
        self.item = item
        self.settings = settings
        self.shape = item.geometry
        self.sides = push_sides(robot, item, settings.friction_trust)
        self._object_points = self.shape.dense_outline(_OUTLINE_SPACING)
        self._robot_points = densified(robot.outline, _OUTLINE_SPACING)
        self._robot_radius = float(np.hypot(*robot.outline.T).max())

    def object_clearance(self, pose: Array) -> float:
        """[m] of the object at a pose ``(3,)``; 0 when it overlaps an obstacle."""
        if self.field.at(pose[0], pose[1]) <= 0.0:
            return 0.0
        return self.field.clearance(self._object_points, pose)

    def robot_clearance(self, pose: Array) -> float:
        """[m] of the robot at a pose ``(3,)``."""
        return self.field.clearance(self._robot_points, pose)

    def object_clearances(self, poses: Array) -> Array:
        """[m] ``(n,)`` of the object at poses ``(n, 3)``; 0 where its centre is in a wall."""
        values: Array = _clearances(self.field.values, poses, self._object_points, *self.field.args)
        return values

    @property
    def sweep_arguments(self) -> tuple[Any, ...]:
        """What ``push_clearance`` takes after the grasp."""
        return (
            self.field.values,
            self._robot_points,
            self._object_points,
            self._robot_radius,
            self.shape.circumradius,
            *self.field.args,
        )

    def curve_clearance(self, curve: PushCurve, side: PushSide, needed: float) -> float:
        """[m] least clearance of a push along a curve; stops below ``needed``."""
        return float(
            push_clearance(
                curve.start,
                curve.end,
                curve.k_start,
                curve.k_end,
                sweep_count(curve.length),
                needed,
                side.grasp,
                *self.sweep_arguments,
            )
        )

    def standoff(self, contact_pose: Array) -> Array:
        """Robot pose ``(3,)`` behind a contact pose, where an approach begins."""
        return se2.compose(contact_pose, np.array([-self.settings.standoff, 0.0, 0.0]))

    def rooms(self, contact_poses: Array) -> NDArray[np.bool_]:
        """Whether the robot can back off from (and so come to) contact poses ``(n, 3)``."""
        result: NDArray[np.bool_] = _rooms(
            contact_poses,
            np.linspace(0.0, self.settings.standoff, 4),
            self.robot.footprint_radius,
            self.settings.safety_distance,
            self.field.values,
            self._robot_points,
            *self.field.args,
        )
        return result

    def has_room(self, contact_pose: Array) -> bool:
        """``rooms`` of one contact pose ``(3,)``."""
        return bool(self.rooms(contact_pose[None])[0])
