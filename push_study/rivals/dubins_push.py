"""Dubins pushes: the planner of ReloPush (Ahn and Mavrogiannis, arXiv 2409.18231) for one object.

The object stays where it is on the bumper as long as the robot's path bends no more than a stable
push allows. A push from a side is therefore a Dubins path of the robot, from behind the object to
where it stands when the object is at its goal. Of all sides, the shortest path that is clear is
taken. If no path is clear, the object is first pushed straight ahead, from another side, to a place
from which one is (pre-relocation): the plan that is shortest in all.

Filled in, or other than in ReloPush:

- ReloPush plans for several objects, and moves others out of the way; here there is one, and
  obstacles cannot be moved. Its graph is a search over its one or two pushes.
- The bend is the tightest that an ellipsoidal limit surface allows with ``friction_trust`` of the
  believed friction. ReloPush has one turning radius for its car and its boxes.
- There, a controller of a car follows the path; here the robot steers by how far it is from the
  path and from its direction, within the bends of a stable push.
- ReloPush plans once; here the robot plans anew after each push that ends off the goal.
- The robot drives to a side by this project's planner and tracker, and touches it straight on.

Bodies that are not on the map are not avoided in a push.
"""

import math
from collections.abc import Iterator

import numpy as np
from ompl import base

from push_job.method import Arena, MethodSpec, Seen, Task
from push_job.report import Figure, Report, polyline
from push_model import se2
from push_model.arrays import Array
from push_model.belief import Belief
from push_model.settings import settings
from push_model.specs import RobotSpec
from push_study.rivals.repeated_pusher import (
    ACCELERATION,
    CREEP,
    RepeatedPusher,
    RepeatedSettings,
)
from push_study.rivals.side_contact import SECTIONS, check_team
from push_study.rivals.stable_grips import Grip, GripSettings, grips

_EVERY, _RELOCATED = 0.01, 0.1  # [m] between poses of a path, and between places tried
_FARTHEST, _LONGEST = 3.0, 20.0  # [m] that an object is relocated; of a path
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
        item = self._item.mass_pose(seen)
        blocked = "no Dubins path is clear, also after a straight push"
        for offers in (self._direct, self._relocating):
            for _, grip, path in sorted(offers(item, found, spec), key=lambda p: p[0]):
                to = f"side {grip.side.index}"
                blocked = self._set_out(robot, seen, grip.grasp, belief, to)
                if not blocked:
                    self._grip, self._path = grip, path
                    return ""
        return blocked

    def _direct(
        self, item: Array, found: tuple[Grip, ...], spec: RobotSpec
    ) -> Iterator[tuple[float, Grip, Array]]:
        """Length [m] and poses ``(n, 3)`` of the robot, for each side whose path is clear."""
        goal = self._item.mass_pose(self._goal)
        for grip in found:
            back = se2.inverse(grip.grasp)
            path, length = dubins(se2.compose(item, back), se2.compose(goal, back), _radius(grip))
            if length <= _LONGEST and self._clear(path, grip, spec):
                yield length, grip, path

    def _relocating(
        self, item: Array, found: tuple[Grip, ...], spec: RobotSpec
    ) -> Iterator[tuple[float, Grip, Array]]:
        """The same of plans that begin with a straight push; the path is that of this push."""
        for grip in found:
            start = se2.compose(item, se2.inverse(grip.grasp))
            for far in np.arange(_RELOCATED, _FARTHEST, _RELOCATED):
                along = np.linspace(0.0, far, max(2, round(far / _EVERY)))
                rows = np.column_stack([along, np.zeros((len(along), 2))])
                path = np.array([se2.compose(start, row) for row in rows])
                if not self._clear(path, grip, spec):
                    break
                there = se2.compose(path[-1], grip.grasp)
                others = tuple(g for g in found if g is not grip)
                lengths = [length for length, _, _ in self._direct(there, others, spec)]
                if lengths:
                    yield float(far) + min(lengths), grip, path

    def _clear(self, path: Array, grip: Grip, spec: RobotSpec) -> bool:
        """Whether object and robot keep away from obstacles of the map."""
        items = np.array([se2.compose(pose, grip.grasp) for pose in path])
        for outline, poses in ((self._item.geometry.outline, items), (spec.outline, path)):
            room = self._side.field.clearances(outline, poses)
            if room.min() < min(_CLEAR, room[0]):
                return False
        return True

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


def dubins(start: Array, goal: Array, radius: float) -> tuple[Array, float]:
    """Shortest path of bends no tighter than a radius [m] between poses ``(3,)``, by OMPL: poses
    ``(n, 3)``, about ``_EVERY`` apart (none where it is longer than ``_LONGEST``); its length [m].
    """
    space = base.DubinsStateSpace(radius)
    a, b, between = (space.allocState() for _ in range(3))
    for state, (x, y, heading) in ((a, start), (b, goal)):
        state.setX(float(x))
        state.setY(float(y))
        state.setYaw(float(se2.wrap(float(heading))))
    length = float(space.distance(a, b))
    if length > _LONGEST:
        return np.zeros((0, 3)), length
    poses = []
    for part in np.linspace(0.0, 1.0, max(2, math.ceil(length / _EVERY) + 1)):
        space.interpolate(a, b, float(part), between)
        poses.append((between.getX(), between.getY(), between.getYaw()))
    return np.array(poses), length


METHOD = MethodSpec(
    "dubins-push",
    DubinsPusher,
    {"": DubinsSettings, **SECTIONS},
    lambda robots, item: check_team(robots, item, "dubins-push"),
    "env1-target1",
)
