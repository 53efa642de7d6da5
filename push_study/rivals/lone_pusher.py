"""What rivals share in which one robot pushes a side of the object: task, frames, contact, end."""

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np

from push_estimation.dead_reckoning import DeadReckoning
from push_job.method import Arena, Certificate, Command, Refusal, Seen, Task, Told
from push_job.report import Drawable, Figure, Report, Status
from push_model import se2
from push_model.arrays import Array
from push_model.belief import POSES, Belief
from push_model.jobs import GoalRefused, JobError, JobPhase
from push_model.settings import bounded, settings
from push_study.rivals.side_contact import SideContact

_FILTER = 0.2  # [s] time constant of where the object is on the bumper
_GAP, _TURN = 0.015, 0.25  # [m], [rad] from where it was touched: contact is in doubt
_TICK, _BREAK = 0.01, 0.25  # [s] assumed between first frames; after which a robot has stopped
STILL = 0.3
"""[s] from the last command of a push to the verdict."""


@settings
class GoalTolerances:
    """When an object is at its goal."""

    position_tolerance: float = bounded(
        0.02,
        low=1e-3,
        high=1.0,
        doc="Greatest position error at which the goal counts as reached (m).",
    )
    orientation_tolerance: float = bounded(
        0.1,
        low=1e-3,
        high=3.2,
        doc="Greatest heading error at which the goal counts as reached (rad).",
    )


class LonePusher(ABC):
    """A method (see ``push_job.method``): looks for a push, drives to its side, and pushes."""

    def __init__(self, arena: Arena, name: str, tolerances: GoalTolerances) -> None:
        (self._name,), self._arena = arena.robots, arena
        self._method, self._tolerances = name, tolerances
        self._side = SideContact(arena)
        self._item, self._goal = arena.item, np.full(3, math.nan)
        self._phase, self._reason, self._code = JobPhase.IDLE, "waiting for a goal", JobError.NONE
        self._in_force = (0.0, 0.0)
        self._grasp = np.zeros(3)
        """Pose of the centre of mass in the robot's frame, when the robot touches the side."""
        self._measured = np.zeros(3)
        """The same as it is seen in the push."""

    @abstractmethod
    def _look(self, robot: Array, seen: Array, belief: Belief) -> None:
        """Look for a push, of which a slice may be done at a time; robot, seen: poses ``(3,)``, of
        the object's frame. It ends the task, or calls ``_set_out``."""

    @abstractmethod
    def _touched(self, item: Array) -> None:
        """The robot has come to the side; item: pose of the centre of mass."""

    @abstractmethod
    def _push(self, dt: float, now: Array, item: Array, lost: Array) -> tuple[float, float]:
        """v [m/s], omega [rad/s] of a push, ``dt`` [s] later.

        now: pose of the robot now. item: of the centre of mass, at the time of the frame. lost
        ``(3,)``: how far it is in the robot's frame from where it was touched.
        """

    @property
    def status(self) -> Status:
        """See Method."""
        return Status(int(self._phase), self._phase.name, self._reason, int(self._code))

    def assess(self, task: Task, belief: Belief, seen: Seen | None) -> Certificate | Refusal:
        """See Method; whether a push leads to the goal is only known by trying."""
        if len(task.targets) > 1 or task.times:
            text = f"the method '{self._method}' accepts a single goal, without times"
            return Refusal(JobError.INVALID_GOAL, text)
        if not np.isfinite(task.goal).all():
            return Refusal(JobError.INVALID_GOAL, "the goal needs a heading")
        near = self._side.near
        try:
            near.believe(belief.robot(self._name), belief.object(self._arena.object))
            near.check_goal(task.goal)
        except GoalRefused as refusal:
            return Refusal(refusal.code, str(refusal))
        return Certificate()

    def begin(self, task: Task, belief: Belief) -> None:
        """See Method."""
        self._goal, self._code, self._reason = task.goal, JobError.NONE, "looking for a push"
        self._phase, self._time, self._shown = JobPhase.PLANNING, math.nan, math.nan
        self._item, self._doubt = belief.object(self._arena.object), 0.0
        self._in_force = (0.0, 0.0)
        tracker = self._side.tracker
        known = (POSES, "latency") in belief.values
        delay = belief.latency.value if known else tracker.settings.pose_delay
        tracker.believe(None, delay)
        self._reckoning = DeadReckoning(delay)

    def step(self, seen: Seen, belief: Belief) -> Told:
        """See Method."""
        robot, tracker = seen.robots.get(self._name), self._side.tracker
        if self._phase is JobPhase.IDLE:
            return Told()
        dt, age = seen.time - self._time, seen.ages.get(self._name, 0.0)
        if robot is not None or math.isnan(self._shown):
            self._shown = seen.time - age  # when the robot was measured last
        if stale := seen.time - self._shown > tracker.settings.give_up:
            self.end(JobError.POSES_STALE, f"no poses of '{self._name}' arrive")
        if stale or robot is None:
            return Told()
        if not 0.0 < dt <= _BREAK:
            dt, self._in_force = _TICK, (0.0, 0.0)
            self._reckoning.clear()
            tracker.halt()
        self._time, item = seen.time, self._item.mass_pose(seen.object)
        if self._phase is JobPhase.PLANNING:
            began = time.thread_time()
            self._look(robot, seen.object, belief)
            return Told({self._name: (0.0, 0.0)}, time.thread_time() - began)
        if self._phase is JobPhase.PUSHING:
            shown = seen.ages.get(self._arena.object, 0.0) <= 0.0
            command: Command = self._on(dt, robot, item if shown else None, age)
        else:
            command = self._drive(dt, robot, item, age)
        return Told({self._name: command})

    def _set_out(self, robot: Array, seen: Array, grasp: Array, belief: Belief, to: str) -> str:
        """Drive to a side, in words; why there is no way, empty if there is one."""
        spec, item = belief.robot(self._name), self._item.mass_pose(seen)
        blocked = self._side.begin(robot, seen, item, grasp, spec)
        if not blocked:
            self._grasp, self._phase = grasp, JobPhase.POSITIONING
            self._reason = f"on the way to {to}"
        return blocked

    def _back_off(self, robot: Array, seen: Array) -> None:
        """Drive away from the object, and look again."""
        self._phase, self._reason = JobPhase.DETACHING, "backing off"
        self._side.back_off(robot, seen)

    def _look_again(self) -> None:
        self._phase, self._reason = JobPhase.PLANNING, "looking for a push"

    def _drive(self, dt: float, robot: Array, item: Array, age: float) -> tuple[float, float]:
        """To the side, and straight on until contact; or away from it."""
        drive = self._side.tick(dt, robot, item, age)
        if drive.failure:
            self.end(JobError.POSITIONING_FAILED, drive.failure)
        elif drive.done and self._phase is JobPhase.DETACHING:
            self._look_again()
        elif drive.done:
            self._phase, self._reason = JobPhase.PUSHING, "pushing"
            self._measured, self._doubt = self._grasp.copy(), 0.0
            self._touched(item)
        elif self._side.ahead and self._phase is JobPhase.POSITIONING:
            self._phase, self._reason = JobPhase.APPROACH, "touching the object"
        self._in_force = drive.command
        self._reckoning.clear()
        return self._in_force

    def _on(self, dt: float, robot: Array, item: Array | None, age: float) -> tuple[float, float]:
        """A push goes on; item: None where the frame does not show it."""
        self._reckoning.record(dt, *self._in_force)
        there = self._reckoning.at_frame(robot, age)
        item = se2.compose(there, self._measured) if item is None else item
        seen = se2.between(there, item)
        off = seen - self._measured
        off[2] = se2.wrap(float(off[2]))
        self._measured += min(1.0, dt / _FILTER) * off
        now = self._reckoning.now(there)
        self._reckoning.forget(age)
        lost = seen - self._grasp
        half = 0.5 * self._arena.robot.flat_bumper.width
        far = lost[0] > _GAP or abs(lost[1]) > half or abs(se2.wrap(float(lost[2]))) > _TURN
        self._doubt = self._doubt + dt if far else 0.0
        self._in_force = self._push(dt, now, item, lost)
        return self._in_force

    def _off(self, item: Array) -> str:
        """How far the object is from its goal, in words; empty within the tolerances."""
        off, s = se2.between(self._item.mass_pose(self._goal), item), self._tolerances
        away, turned = float(np.hypot(off[0], off[1])), abs(float(off[2]))
        if away <= s.position_tolerance and turned <= s.orientation_tolerance:
            return ""
        return f"{1e3 * away:.0f} mm, {turned:.2f} rad from the goal"

    def _told_of(self, seen: Seen, figure: Figure, shapes: tuple[Drawable, ...]) -> Report | None:
        """The report of a task under way, with one figure of the method's own."""
        if self._phase is JobPhase.IDLE:
            return None
        away, turned = self.errors(seen)
        figures = Figure("to the goal", away, "m"), Figure("heading error", turned, "rad"), figure
        return Report(self._phase.name.lower(), figures, shapes)

    @abstractmethod
    def report(self, seen: Seen) -> Report | None:
        """See Method."""

    def end(self, code: JobError, reason: str) -> None:
        """See Method."""
        if self._phase is not JobPhase.IDLE:
            self._side.tracker.stop()
            self._phase, self._code, self._reason = JobPhase.IDLE, code, reason

    def revive(self) -> None:  # noqa: B027 (there is nothing to do)
        """See Method: the only robot is never given up."""

    def release(self) -> frozenset[str]:
        """See Method."""
        return frozenset(self._arena.robots if self._phase is JobPhase.IDLE else ())

    def errors(self, seen: Seen) -> tuple[float, float]:
        """See Method."""
        if not np.isfinite(self._goal).all():
            return math.inf, math.inf
        off = se2.between(self._goal, seen.object)
        return float(np.hypot(off[0], off[1])), abs(float(off[2]))

    @abstractmethod
    def facts(self) -> Mapping[str, Any]:
        """See Method."""
