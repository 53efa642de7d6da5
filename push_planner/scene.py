"""Robot, object and map together: what fits where, and what a push sweeps."""

from dataclasses import dataclass
from typing import Any

import numba
import numpy as np

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


@numba.njit(cache=True, fastmath=True)
def _sweep(
    field: Any,
    robots: Any,
    robot_points: Any,
    object_points: Any,
    object_radius: float,
    offset: Any,
    needed: float,
    ox: float,
    oy: float,
    scale: float,
) -> float:
    """Least clearance of robot and object over robot poses (n, 3); stops below ``needed``."""
    least = 1e9
    for i in range(robots.shape[0]):
        x, y, theta = robots[i, 0], robots[i, 1], robots[i, 2]
        d = points_clearance(field, robot_points, x, y, theta, ox, oy, scale)
        c, s = np.cos(theta), np.sin(theta)
        px = x + c * offset[0] - s * offset[1]
        py = y + s * offset[0] + c * offset[1]
        rough = lookup(field, px, py, ox, oy, scale) - object_radius
        if rough < min(d, least):
            e = points_clearance(field, object_points, px, py, theta + offset[2], ox, oy, scale)
            d = min(d, e)
        least = min(least, d)
        if least < needed:
            return float(least)
    return float(least)


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

    def object_clearance(self, pose: Array) -> float:
        """[m] of the object at a pose ``(3,)``; 0 when it overlaps an obstacle."""
        if self.field.at(pose[0], pose[1]) <= 0.0:
            return 0.0
        return self.field.clearance(self._object_points, pose)

    def robot_clearance(self, pose: Array) -> float:
        """[m] of the robot at a pose ``(3,)``."""
        return self.field.clearance(self._robot_points, pose)

    def sweep_clearance(self, robots: Array, side: PushSide, needed: float = 0.0) -> float:
        """[m] least clearance of robot and object over robot poses ``(n, 3)``."""
        return float(
            _sweep(
                self.field.values,
                robots,
                self._robot_points,
                self._object_points,
                self.shape.circumradius,
                side.grasp,
                needed,
                *self.field.args,
            )
        )

    def curve_clearance(self, curve: PushCurve, side: PushSide, needed: float) -> float:
        """[m] least clearance of a push along a curve."""
        count = max(8, int(curve.length / _SWEEP_SPACING) + 2)
        points, heading, _ = curve.sample(count)
        return self.sweep_clearance(np.column_stack([points, heading]), side, needed)

    def standoff(self, contact_pose: Array) -> Array:
        """Robot pose ``(3,)`` behind a contact pose, where an approach begins."""
        return se2.compose(contact_pose, np.array([-self.settings.standoff, 0.0, 0.0]))

    def has_room(self, contact_pose: Array) -> bool:
        """Whether the robot can back off from (and so come to) a contact pose ``(3,)``."""
        for back in np.linspace(0.0, self.settings.standoff, 4):
            pose = se2.compose(contact_pose, np.array([-back, 0.0, 0.0]))
            if self.robot_clearance(pose) < self.settings.safety_distance:
                return False
        standoff = self.standoff(contact_pose)
        turning = self.field.at(standoff[0], standoff[1]) - self.robot.footprint_radius
        return turning >= 0.0
