"""Stable pushing by one NMPC: Tang, Zhu, Potters, Wisse and Pan, RA-L 2023 (arXiv 2309.14295).

A robot on two wheels pushes with a line contact, on bends so wide that the object stays where it is
on the bumper. Together with the constraint of its wheels, that is one linear constraint between v
and omega. Robot and object are then one body, and a nonlinear programme steers it to the goal,
again and again, on one side of the object.

Only the abstract could be read. Filled in:

- The limits of omega / v are those of an ellipsoidal limit surface, with ``friction_trust`` of the
  believed friction, and with the object where it is seen on the bumper.
- The programme (``stable_programme.py``) covers the whole way in steps of equal, free duration. Its
  cost is the time, the squared error of the last pose, and changes of omega. IPOPT solves it every
  ``period``; between two solves the robot drives as planned.
- Obstacles: the object's outline, the robot's body and the corners of its bumper keep a margin from
  what the map has. Bodies that are not on the map are not avoided.
- The side is the first from which a solve reaches the goal. A solve begins with the shortest way of
  the object on the map, or with a cubic between start and goal.
- The robot drives to that side by this project's planner and tracker, and touches it straight on.
- Contact that is lost, and a goal that cannot be reached any more, end the task: the method makes
  no second push.
"""

import math
import time
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from push_job.method import Arena, MethodSpec, Seen, Task
from push_job.report import Figure, Report, polyline
from push_model import se2
from push_model.arrays import Array
from push_model.belief import Belief
from push_model.jobs import JobError, JobPhase
from push_model.specs import RobotSpec
from push_model.stable_push import shifted_limits
from push_planner.guide_path import lattice_path
from push_study.rivals.lone_pusher import STILL, LonePusher
from push_study.rivals.side_contact import SECTIONS, check_team
from push_study.rivals.stable_grips import Grip, StableNmpcSettings, grips
from push_study.rivals.stable_programme import ACCELERATION, MARGIN, Plan, StableProgramme, cubic

_LOST = 0.5  # [s] in doubt until contact counts as lost
_PATIENCE = 10  # solves in a row that do not reach the goal, or fail
_NEAR_TIME = 0.06  # [s] of a plan that is over
_CLEARANCES = (0.1, 0.07, 0.05)  # [m] of the object's way on the map, the first that leads there


class StableNmpcMethod(LonePusher):
    """Drives to a side, touches it, and pushes until the end of the plan."""

    def __init__(self, arena: Arena) -> None:
        self._own: StableNmpcSettings = arena.section("", StableNmpcSettings)
        super().__init__(arena, "stable-nmpc", self._own)
        self._nmpc = StableProgramme(arena.grid, arena.robot, arena.item)
        self._plan: Plan | None = None
        self.solves: list[float] = []  # [s] CPU time of each since the push began

    def begin(self, task: Task, belief: Belief) -> None:
        """See Method."""
        super().begin(task, belief)
        self.solves = []
        self._search: Iterator[tuple[Grip, Plan, Array]] | None = None

    def _look(self, robot: Array, seen: Array, belief: Belief) -> None:
        """One solve: the first side from which a plan reaches the goal, and the way to it."""
        spec, item = belief.robot(self._name), self._item.mass_pose(seen)
        if self._search is None:
            if not np.array_equal(self._item.geometry.outline, self._nmpc.outline):
                self._nmpc = StableProgramme(self._arena.grid, spec, self._item)
            self._side.near.believe(spec, self._item)
            self._search, self._blocked = self._offers(item, belief, spec), ""
            if not self._off(item):
                self.end(JobError.NONE, "it is at the goal already")
                return
        offer = next(self._search, None)
        if offer is None:
            text = f"no side of the object from which a stable push reaches it{self._blocked}"
            self.end(JobError.PLANNING_FAILED, text)
            return
        grip, plan, last = offer
        if self._misses(plan, last):
            return
        blocked = self._set_out(robot, seen, grip.grasp, belief, f"side {grip.side.index}")
        if blocked:
            self._blocked = f"; to one that does, {blocked}"
        else:
            self._grip, self._plan = grip, plan

    def _offers(
        self, item: Array, belief: Belief, spec: RobotSpec
    ) -> Iterator[tuple[Grip, Plan, Array]]:
        """Plans, and where the robot is to end; those first whose beginning and end turn least."""
        begins, goal = [], self._item.mass_pose(self._goal)
        ways = (lattice_path(self._side.field, item, goal, c) for c in _CLEARANCES)
        guide = next((w for w in ways if w is not None), None)
        for grip in grips(self._own.friction_trust, belief, spec, self._arena.object):
            robot, last = (se2.compose(p, se2.inverse(grip.grasp)) for p in (item, goal))
            for points in (guide, cubic(item, goal, grip.grasp[2])):
                if points is not None:
                    z, heading = self._nmpc.along(points, robot, grip.grasp)
                    off = abs(se2.wrap(last[2] - heading)) + abs(z[5] - robot[2])
                    begins.append((off, grip, robot, _beside(last, heading), z))
        for _, grip, robot, last, z in sorted(begins, key=lambda b: b[0]):
            plan = self._nmpc.solve(robot, last, grip.grasp, grip.limits, (0.0, 0.0), z)
            yield grip, plan, last

    def _misses(self, plan: Plan, goal: Array) -> str:
        """Why a plan does not reach the goal, in words; empty where it does."""
        off, s = plan.poses[-1] - goal, self._own
        away, turned = float(np.hypot(off[0], off[1])), abs(float(off[2]))
        if not plan.solved:
            return "the solver finds no push"
        if away > s.position_tolerance or turned > s.orientation_tolerance:
            return f"the best push ends {1e3 * away:.0f} mm, {turned:.2f} rad from the goal"
        return "" if plan.slack <= MARGIN else f"it lacks {1e3 * plan.slack:.0f} mm of room"

    def _touched(self, item: Array) -> None:
        self._since = self._waited = self._own.period
        self._failed, self._over = 0, 0.0

    def _push(self, dt: float, now: Array, item: Array, lost: Array) -> tuple[float, float]:
        assert self._plan is not None
        self._since, self._waited = self._since + dt, self._waited + dt
        if self._doubt > _LOST:
            text = f"{1e3 * lost[0]:.0f} mm ahead, {1e3 * abs(lost[1]):.0f} mm aside"
            self.end(JobError.EXECUTION_FAILED, f"contact was lost: the object is {text}")
            return 0.0, 0.0
        if self._over == 0.0 and self._waited >= self._own.period - 1e-9:
            self._solve(now)
            if self._plan is None:
                return 0.0, 0.0
        at = int(self._since / self._plan.step)
        if self._over > 0.0 or at >= len(self._plan.twists) or self._plan.duration < _NEAR_TIME:
            self._over += dt
            if self._over > STILL:
                missed = self._off(item)
                text = f"it ended {missed}" if missed else "at the goal"
                self.end(JobError.OFF_TARGET if missed else JobError.NONE, text)
            return 0.0, 0.0
        v, omega = self._plan.twists[at]
        most = self._in_force[0] + ACCELERATION * dt
        slower = min(1.0, most / max(v, 1e-9))
        return float(slower * v), float(slower * omega)

    def _solve(self, robot: Array) -> None:
        """The next plan, from where the object is on the bumper."""
        assert self._plan is not None
        began, self._waited = time.thread_time(), 0.0
        before = self._plan
        goal = se2.compose(self._item.mass_pose(self._goal), se2.inverse(self._measured))
        robot, goal = _beside(robot, before.poses[0, 2]), _beside(goal, before.poses[-1, 2])
        limits = shifted_limits(self._grip.limits, self._measured[1] - self._grip.grasp[1])
        begin = before.later(min(self._since, self._own.period))
        known = None if self._failed else before.multipliers
        plan = self._nmpc.solve(robot, goal, self._measured, limits, self._in_force, begin, known)
        self.solves.append(time.thread_time() - began)
        misses = self._misses(plan, goal)
        self._failed = self._failed + 1 if misses else 0
        if plan.solved:
            self._plan, self._since = plan, 0.0
        if self._failed >= _PATIENCE:
            self.end(JobError.EXECUTION_FAILED, f"no stable push reaches the goal: {misses}")

    def report(self, seen: Seen) -> Report | None:
        """See Method."""
        shapes = () if self._plan is None else (polyline("plan", self._plan.poses[:, :2]),)
        return self._told_of(seen, Figure("solves", float(len(self.solves))), shapes)

    def end(self, code: JobError, reason: str) -> None:
        """See Method."""
        super().end(code, reason)
        if self._phase is JobPhase.IDLE:
            self._plan = None

    def facts(self) -> Mapping[str, Any]:
        """See Method."""
        last = self.solves[-1] if self.solves else math.nan
        return {"solves": len(self.solves), "CPU time of the last solve": f"{1e3 * last:.0f} ms"}


def _beside(pose: Array, heading: float) -> Array:
    """The pose ``(3,)`` with the heading nearest to another one."""
    return np.array([*pose[:2], heading + se2.wrap(float(pose[2]) - heading)])


METHOD = MethodSpec(
    "stable-nmpc",
    StableNmpcMethod,
    {"": StableNmpcSettings, **SECTIONS},
    lambda robots, item: check_team(robots, item, "stable-nmpc"),
    "env1-target1",
)
