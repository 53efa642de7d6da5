"""Robot, object and map together: what fits where, and what a push sweeps.

Poses of the object are those of its centre of mass here, as in all of the planner but at its
borders: mechanics works about it, and there are fewer frames to mix up.
"""

import copy
import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from push_model import se2
from push_model.arrays import Array
from push_model.distance_field import DistanceField
from push_model.pushable_sides import pushable_sides
from push_model.shapes import densified
from push_model.specs import ObjectSpec, RobotSpec
from push_model.stable_push import (
    CurvatureLimits,
    PusherContact,
    contact_on_side,
    curvature_limits,
)
from push_model.stick_certificate import ContactBelief, certified_limits, trusted_limits
from push_planner.plan_time import PlanTime
from push_planner.push_curve import PushCurve
from push_planner.push_sweep import SWEEP_LOSS, push_clearance, rooms_behind
from push_planner.settings import PlannerSettings

_OUTLINE_SPACING = 0.01  # [m] of points between which distances are interpolated
LEAVING = 0.15  # [m] of the first push, in which it may be nearer to obstacles than later
_LEAST = 0.003  # [m] that the robot keeps even then
_APART = 0.005  # [m] between poses of the robot that are looked at by themselves
_CLOSE = 0.5  # of the stand-off, where there is no room for all of it
TURNING = 0.25
"""Of the safety distance that the robot keeps where it turns, before a push."""


@dataclass(frozen=True)
class PushSide:
    """A side that can be pushed on: where the bumper goes and which curvatures are stable.

    index: of the ``Side``, see there. grasp: ``(3,)`` pose of the object's centre of mass in the
    robot frame when in contact. nominal: limits by the stable-push analysis; trusted: the part of
    them that plans may use. depth [m]: how far back beside the robot the object reaches.
    """

    index: int
    contact: PusherContact
    nominal: CurvatureLimits
    trusted: CurvatureLimits
    grasp: Array
    depth: float

    def robot_pose(self, object_pose: Array) -> Array:
        """Axle midpoint ``(3,)`` when in contact with the object at ``object_pose`` ``(3,)``."""
        return se2.compose(object_pose, se2.inverse(self.grasp))


def push_sides(
    robot: RobotSpec,
    item: ObjectSpec,
    friction_trust: float,
    believed: ContactBelief | None = None,
    certified_trust: float = 1.0,
) -> tuple[PushSide, ...]:
    """The sides that the robot reaches and on which at least the straight push is stable (S3).

    believed: intervals of what the curvatures depend on; a side's trusted curvatures are then at
    least the fraction ``certified_trust`` of those that are stable for all of the intervals.

    Raises
    ------
    SettingsError: the robot's bumper is not flat.
    """
    surface = item.limit_surface()
    ahead = np.array([robot.push_distance, 0.0, 0.0])
    sides = []
    for side in pushable_sides(item.geometry, robot):
        contact = contact_on_side(side, robot.flat_bumper.width)
        limits = curvature_limits(contact, robot.push_distance, item.contact_friction, surface)
        if limits is not None:
            sure = None
            if believed is not None:
                sure = certified_limits(item, robot, believed, side.index)
            trusted = trusted_limits(limits, friction_trust, sure and sure.scaled(certified_trust))
            grasp = contact.object_pose + ahead
            sides.append(PushSide(side.index, contact, limits, trusted, grasp, side.depth))
    return tuple(sides)


class PushScene:
    """Collision questions of the planner."""

    def __init__(
        self,
        field: DistanceField,
        robot: RobotSpec,
        item: ObjectSpec,
        settings: PlannerSettings,
        believed: ContactBelief | None = None,
    ) -> None:
        """Raises SettingsError where the robot cannot push: no flat bumper, no two wheels.

        believed: intervals of friction and centre of mass, see ``push_sides``.
        """
        self.field = field
        self.robot = robot
        self.item = item
        self.settings = settings
        self.drive = robot.differential
        self.shape = item.geometry
        self.believed = believed
        self.sides = push_sides(
            robot, item, settings.friction_trust, believed, settings.certified_trust
        )
        self._object_points = self.shape.dense_outline(_OUTLINE_SPACING)
        self._robot_points = densified(robot.outline, _OUTLINE_SPACING)
        self._robot_radius = float(np.hypot(*robot.outline.T).max())

    @cached_property
    def time(self) -> PlanTime:
        """Times of pushes and of changes of the side."""
        behind = {}
        for side in self.sides:
            back = np.array([-self.backs(side)[0], 0.0, 0.0])
            behind[side.index] = se2.compose(se2.inverse(side.grasp), back)
        return PlanTime(self.robot, self.settings, self.shape.outline, behind)

    def bending_less(self, part: float) -> "PushScene":
        """The same scene for plans that use only a part of the trusted curvatures."""
        scene = copy.copy(self)
        scene.sides = tuple(replace(side, trusted=side.trusted.scaled(part)) for side in self.sides)
        return scene

    def why_no_sides(self) -> str:
        """Why there is no side to push on, in words."""
        if not self.shape.sides:
            return "its outline is curved, and the robot's bumper is flat"
        reached = [str(side.index) for side in pushable_sides(self.shape, self.robot)]
        if not reached:
            return f"the robot's bumper reaches none of its {len(self.shape.sides)} sides"
        return (
            f"of its {len(self.shape.sides)} sides the robot's bumper reaches "
            f"{', '.join(reached)}, and on none of them is the straight push stable"
        )

    def object_clearance(self, pose: Array) -> float:
        """[m] of the object at a pose ``(3,)``; 0 when it overlaps an obstacle."""
        return self.field.clearance(self._object_points, pose)

    def robot_clearance(self, pose: Array) -> float:
        """[m] of the robot at a pose ``(3,)``."""
        return self.field.clearance(self._robot_points, pose)

    def object_clearances(self, poses: Array) -> Array:
        """[m] ``(n,)`` of the object at poses ``(n, 3)``; 0 where it overlaps an obstacle."""
        return self.field.clearances(self._object_points, poses)

    @property
    def bodies(self) -> tuple[Array, Array, float, float, Array]:
        """Outlines ``(n, 2)`` [m] of object and robot, their radii [m], and ``(sides, 2)`` [m] how
        far the robot may back off, see ``backs``."""
        backs = np.array([self.backs(side) for side in self.sides])
        points = self._object_points, self._robot_points
        return *points, self.shape.circumradius, self._robot_radius, backs

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
        """[m] clearance of a push all along a curve, never overestimated.

        Stops at the first pose with less than ``needed`` [m].
        """
        return float(
            push_clearance(
                curve.start,
                curve.end,
                curve.k_start,
                curve.k_end,
                curve.length,
                needed,
                side.grasp,
                *self.sweep_arguments,
            )
        )

    def leaving(self, pose: Array) -> float:
        """[m] kept on the way out of a start pose ``(3,)``: all that there is, where that is less
        than the safety distance. Somebody has put the object there."""
        there, needed = self.object_clearance(pose), self.settings.safety_distance
        return needed if there >= needed else max(1e-4, there - 1.2 * SWEEP_LOSS)

    def robot_keeps(self, leaving: float = math.inf) -> float:
        """[m] that the robot keeps where it comes to contact; see ``leaving``."""
        return min(self.settings.safety_distance, max(leaving, _LEAST))

    def kept(self, curve: PushCurve, side: PushSide, leaving: float) -> float | None:
        """[m] clearance of a push, None where it comes too near to an obstacle.

        leaving: [m] that will do over the first centimetres; see the method.
        """
        needed = self.settings.safety_distance
        if leaving >= needed:
            clearance = self.curve_clearance(curve, side, needed)
            return None if clearance < needed else clearance
        first, rest = curve, None
        if curve.length > LEAVING:
            first, rest = curve.split(LEAVING)
        clearance = self.curve_clearance(first, side, leaving)
        if clearance < leaving or self._robot_along(first) < self.robot_keeps(leaving):
            return None
        beyond = needed if rest is None else self.curve_clearance(rest, side, needed)
        return None if beyond < needed else min(clearance, beyond)

    def _robot_along(self, curve: PushCurve) -> float:
        """[m] clearance of the robot alone on a curve, at poses a few millimetres apart."""
        points, heading, _ = curve.sample(max(3, int(curve.length / _APART)))
        poses = np.column_stack([points, heading])
        return min(self.robot_clearance(pose) for pose in poses)

    def backs(self, side: PushSide) -> tuple[float, float]:
        """[m] from contact with a side to where the robot may turn: out of a recess, and on.

        The second, half as far from the object, is for where there is no room for the first.
        """
        return side.depth + self.settings.standoff, side.depth + _CLOSE * self.settings.standoff

    def room_to_back_off(self, contact_pose: Array, leaving: float = math.inf) -> float | None:
        """[m] that the robot can back off from a contact pose ``(3,)`` at a convex outline; None if
        it cannot. leaving: see ``rooms``."""
        far = self.settings.standoff
        for back in (far, _CLOSE * far):
            if self._rooms(contact_pose[None], back, self.robot_keeps(leaving))[0]:
                return back
        return None

    def standoff(self, contact_pose: Array, side: PushSide) -> Array:
        """Robot pose ``(3,)`` behind a contact pose, where an approach begins."""
        far, near = self.backs(side)
        back = far if self._rooms(contact_pose[None], far, _LEAST)[0] else near
        return se2.compose(contact_pose, np.array([-back, 0.0, 0.0]))

    def rooms(
        self, contact_poses: Array, side: PushSide, leaving: float = math.inf
    ) -> NDArray[np.bool_]:
        """Whether the robot can back off from (and so come to) contact poses ``(n, 3)``.

        leaving: [m] that the object has there, where that is less than the safety distance.
        """
        far, near = self.backs(side)
        result = self._rooms(contact_poses, far, self.robot_keeps(leaving))
        if not result.all():
            result[~result] = self._rooms(contact_poses[~result], near, self.robot_keeps(leaving))
        return result

    def _rooms(self, contact_poses: Array, back: float, keeps: float) -> NDArray[np.bool_]:
        """``rooms`` to back off so far [m], the robot keeping so much [m]."""
        result: NDArray[np.bool_] = rooms_behind(
            contact_poses,
            back,
            self.robot.footprint_radius + TURNING * self.settings.safety_distance,
            keeps,
            self.field.values,
            self._robot_points,
            *self.field.args,
        )
        return result

    def has_room(self, contact_pose: Array, side: PushSide, leaving: float = math.inf) -> bool:
        """``rooms`` of one contact pose ``(3,)``."""
        return bool(self.rooms(contact_pose[None], side, leaving)[0])
