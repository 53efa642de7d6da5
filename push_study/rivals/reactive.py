"""A reactive pusher: one robot steers the object by where it is now, and predicts nothing.

A baseline of this project, for methods that plan. It knows neither friction nor limit surface.

- The path is the shortest way of the object on the map to a point straight behind the goal, and
  from there straight to the goal. An object turns with the robot that pushes its flat side, so each
  side has one direction in which the object arrives with the right heading. The robot takes the
  side whose path is shortest, where an angle counts as the length of a bend.
- It drives to that side by this project's planner and tracker, and touches it straight on.
- In contact, it steers the object's centre of mass towards the point of the path that is
  ``look_ahead`` farther on (pure pursuit), on bends no tighter than ``bend``.
- When the object leaves the bumper, or ends off the goal, the robot backs off and begins anew.

Bodies that are not on the map are not avoided in a push.
"""

import math

import numpy as np

from push_job.method import Arena, MethodSpec, Seen, Task
from push_job.report import Figure, Report, polyline
from push_model import se2
from push_model.arrays import Array
from push_model.belief import Belief
from push_model.pushable_sides import pushable_sides
from push_model.settings import bounded, settings
from push_model.specs import RobotSpec
from push_model.stable_push import contact_on_side
from push_planner.guide_path import lattice_path
from push_study.rivals.repeated_pusher import (
    ACCELERATION,
    CREEP,
    RepeatedPusher,
    RepeatedSettings,
)
from push_study.rivals.side_contact import SECTIONS, check_team

_CLEARANCES = (0.1, 0.07, 0.05)  # [m] of the object's way on the map, the first that leads there
_BEYOND = 0.3  # [m] of straight path that is aimed at beyond the goal


@settings
class ReactiveSettings(RepeatedSettings):
    """Tolerances, and how the object is steered."""

    look_ahead: float = bounded(
        0.15,
        low=0.01,
        high=2.0,
        doc="Distance along the path between the object and the point towards which it is steered "
        "(m).",
    )
    bend: float = bounded(
        2.5, low=0.01, high=20.0, doc="Greatest curvature of the robot's path in a push (1/m)."
    )
    runway: float = bounded(
        0.4, low=0.0, high=5.0, doc="Length of the straight end of the object's path (m)."
    )


class ReactivePusher(RepeatedPusher):
    """Drives to a side, touches it, and steers until the object is beside the goal."""

    def __init__(self, arena: Arena) -> None:
        self._own: ReactiveSettings = arena.section("", ReactiveSettings)
        super().__init__(arena, "reactive", self._own)
        self._path = np.zeros((0, 2))

    def begin(self, task: Task, belief: Belief) -> None:
        """See Method."""
        super().begin(task, belief)
        self._path = np.zeros((0, 2))

    def _choose(self, robot: Array, seen: Array, belief: Belief, spec: RobotSpec) -> str:
        """A side and a path."""
        blocked = "no way of the object leads to the goal"
        offers = self._offers(self._item.mass_pose(seen), spec)
        for _, grasp, path in sorted(offers, key=lambda o: o[0]):
            blocked = self._set_out(robot, seen, grasp, belief, "a side")
            if not blocked:
                self._path = path
                return ""
        return blocked

    def _offers(self, item: Array, spec: RobotSpec) -> list[tuple[float, Array, Array]]:
        """For each side: the length of its path with its turns, the grasp, and the path ``(n, 2)``
        of the centre of mass."""
        goal, found = self._item.mass_pose(self._goal), []
        for side in pushable_sides(self._item.geometry, spec):
            contact = contact_on_side(side, spec.flat_bumper.width)
            ahead = spec.push_distance + float(contact.centre[0])
            grasp = np.array([ahead, contact.centre[1], contact.heading])
            first, last = float(item[2] - grasp[2]), float(goal[2] - grasp[2])
            along = np.array([math.cos(last), math.sin(last)])
            behind = goal[:2] - self._own.runway * along
            way = self._way(item[:2], behind)
            if way is None or self._way(behind, goal[:2]) is None:
                continue
            path = np.vstack([way, goal[:2], goal[:2] + _BEYOND * along])
            legs = np.diff(path, axis=0)
            legs = legs[np.hypot(*legs.T) > 1e-6]
            headings = np.array([first, *np.arctan2(legs[:, 1], legs[:, 0])])
            turned = np.abs([se2.wrap(float(t)) for t in np.diff(headings)]).sum()
            length = float(np.hypot(*legs.T).sum()) + turned / self._own.bend
            found.append((length, grasp, path))
        return found

    def _way(self, start: Array, goal: Array) -> Array | None:
        ways = (lattice_path(self._side.field, start, goal, c) for c in _CLEARANCES)
        return next((w for w in ways if w is not None), None)

    def _touched(self, item: Array) -> None:
        super()._touched(item)
        self._gone = 0.0

    def _steered(self, now: Array, item: Array) -> tuple[float, float]:
        """Towards a point of the path; no speed once the object is past the goal."""
        s, path = self._own, self._path
        legs = np.diff(path, axis=0)
        lengths = np.maximum(np.hypot(*legs.T), 1e-9)
        before = np.concatenate([[0.0], lengths.cumsum()])
        part = ((item[:2] - path[:-1]) * legs).sum(axis=1) / lengths
        part = np.clip(part, 0.0, lengths)
        feet = path[:-1] + (part / lengths)[:, None] * legs
        # Where the path comes back to itself, the object is on the part that it has come to.
        allowed = before[:-1] + part >= self._gone - 1e-9
        allowed &= before[:-1] <= self._gone + 2.0 * s.look_ahead
        gaps = np.where(allowed, np.hypot(*(feet - item[:2]).T), math.inf)
        k = int(gaps.argmin())
        if math.isfinite(gaps[k]):
            self._gone = max(self._gone, float(before[k] + part[k]))
        end = before[-2]
        left = float(((path[-2] - item[:2]) * legs[-1]).sum() / lengths[-1])
        if self._gone > end - s.look_ahead and left <= 0.0:
            return 0.0, 0.0
        way = min(self._gone + s.look_ahead, before[-1])
        leg = min(int(np.searchsorted(before, way, side="right")) - 1, len(legs) - 1)
        aim = path[leg] + (way - before[leg]) / lengths[leg] * legs[leg]
        x, y = aim - item[:2]
        turn = float(np.clip(se2.wrap(math.atan2(y, x) - float(now[2])), -1.4, 1.4))
        bend = math.tan(turn) / float(self._grasp[0])
        bend = max(-s.bend, min(s.bend, bend))
        remaining = max(end - self._gone, 0.0)
        v = min(s.push_speed, math.sqrt(2.0 * ACCELERATION * remaining) + CREEP)
        return v, v * bend

    def report(self, seen: Seen) -> Report | None:
        """See Method."""
        shapes = (polyline("path", self._path),) if len(self._path) else ()
        return self._told_of(seen, Figure("pushes", float(self._pushes)), shapes)


METHOD = MethodSpec(
    "reactive",
    ReactivePusher,
    {"": ReactiveSettings, **SECTIONS},
    lambda robots, item: check_team(robots, item, "reactive"),
    "env1-target1",
)
