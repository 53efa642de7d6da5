"""Dubins pushes: the planner of ReloPush (Ahn and Mavrogiannis, arXiv 2409.18231) for one object.

The object stays where it is on the bumper as long as the robot's path bends no more than a stable
push allows, so a push is a Dubins path of the robot: see ``dubins_plans``.

Filled in, or other than in ReloPush:

- ReloPush plans for several objects, and moves others out of the way; here there is one, and
  obstacles cannot be moved. Therefore an object is also relocated if obstacles block its path.
- The bend is the tightest that an ellipsoidal limit surface allows with ``friction_trust`` of the
  believed friction. ReloPush has one fixed radius for all pushes.
- The path is that of the robot's axle. In ReloPush, it is that of the object, and the car follows
  it.
- There, a controller of a car follows the path; here the robot steers by how far it is from the
  path and from its direction, within the bends of a stable push.
- ReloPush plans once; here the robot plans anew after each push that ends off the goal.
- The robot drives to a side by this project's planner and tracker, and touches it straight on.

Bodies that are not on the map are not avoided in a push.
"""

import math

import numpy as np

from push_job.method import Arena, MethodSpec, Seen, Task
from push_job.report import Figure, Report, polyline
from push_model import se2
from push_model.arrays import Array
from push_model.belief import Belief
from push_model.settings import settings
from push_model.specs import RobotSpec
from push_study.rivals.dubins_plans import DubinsPlan, Push, dubins_plans
from push_study.rivals.repeated_pusher import (
    ACCELERATION,
    CREEP,
    RepeatedPusher,
    RepeatedSettings,
)
from push_study.rivals.side_contact import SECTIONS, check_team
from push_study.rivals.stable_grips import Grip, GripSettings, grips

_CLEAR = 0.01  # [m] from obstacles of the map, if there is so much where a push begins
_WITHIN = 0.12  # [m] of a path in which a robot comes back to it


@settings
class DubinsSettings(RepeatedSettings, GripSettings):
    """What pushes may use, and how often and how fast it pushes."""


class DubinsPusher(RepeatedPusher):
    """Drives to a side, touches it, and follows a path until its end."""

    def __init__(self, arena: Arena) -> None:
        self._own: DubinsSettings = arena.section("", DubinsSettings)
        super().__init__(arena, "dubins-push", self._own)
        self._path = np.zeros((0, 3))

    def begin(self, task: Task, belief: Belief) -> None:
        """See Method."""
        super().begin(task, belief)
        self._path = np.zeros((0, 3))

    def _choose(self, robot: Array, seen: Array, belief: Belief, spec: RobotSpec) -> str:
        """The shortest plan whose first side can be reached."""
        found = grips(self._own.friction_trust, belief, spec, self._arena.object)
        if not found:
            return "no side of the object can be pushed without slipping"
        blocked = "no Dubins path is clear, also after a straight push"
        for plan in self._plans(self._item.mass_pose(seen), found, spec):
            grip = found[plan.push]
            to = f"side {grip.side.index}"
            blocked = self._set_out(robot, seen, grip.grasp, belief, to)
            if not blocked:
                self._grip, self._path = grip, plan.path
                return ""
        return blocked

    def _plans(self, item: Array, found: tuple[Grip, ...], spec: RobotSpec) -> list[DubinsPlan]:
        """For an object whose mass is at a pose ``(3,)``, best first; see ``dubins_plans``."""
        pushes = [Push(grip.grasp, _radius(grip)) for grip in found]
        goals = (self._item.mass_pose(self._goal),)
        return dubins_plans(item, goals, pushes, lambda p, k: self._clear(p, found[k], spec))

    def _clear(self, path: Array, grip: Grip, spec: RobotSpec) -> bool:
        """Whether the robot fits behind the object, and both keep away from obstacles."""
        field = self._side.field
        robot = field.clearances(spec.outline, path)
        items = np.array([se2.compose(pose, grip.grasp) for pose in path])
        item = field.clearances(self._item.geometry.outline, items)
        near = any(room.min() < min(_CLEAR, room[0]) for room in (robot, item))
        return bool(robot[0] > 0.0) and not near

    def _touched(self, item: Array) -> None:
        super()._touched(item)
        self._at = 0

    def _steered(self, now: Array, item: Array) -> tuple[float, float]:
        """Along the path; no speed at its end."""
        path, limits = self._path, self._grip.limits
        ahead = path[self._at : self._at + 20, :2] - now[:2]
        self._at += int(np.hypot(*ahead.T).argmin())
        k = min(self._at, len(path) - 2)
        here = path[k]
        step = se2.between(here, path[k + 1])
        length = max(float(np.hypot(step[0], step[1])), 1e-9)
        off = se2.between(here, now)
        remaining = length * (len(path) - 1 - k) - float(off[0])
        if remaining <= 0.0:
            return 0.0, 0.0
        bend = se2.wrap(float(step[2])) / length
        bend -= float(off[1]) / _WITHIN**2 + 2.0 * se2.wrap(float(off[2])) / _WITHIN
        bend = max(limits.minimum, min(limits.maximum, bend))
        v = min(self._own.push_speed, math.sqrt(2.0 * ACCELERATION * remaining) + CREEP)
        return v, v * bend

    def report(self, seen: Seen) -> Report | None:
        """See Method."""
        shapes = (polyline("path", self._path[:, :2]),) if len(self._path) else ()
        return self._told_of(seen, Figure("pushes", float(self._pushes)), shapes)


def _radius(grip: Grip) -> float:
    """[m] of the tightest bend to both sides."""
    return 1.0 / min(-grip.limits.minimum, grip.limits.maximum)


METHOD = MethodSpec(
    "dubins-push",
    DubinsPusher,
    {"": DubinsSettings, **SECTIONS},
    lambda robots, item: check_team(robots, item, "dubins-push"),
    "env1-target1",
)
