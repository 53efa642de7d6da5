"""A method of your own: one robot that drives straight at the object and shoves it ahead.

``PYTHONPATH=examples planar-push launch bulldozer:METHOD --scenario short`` starts it as a node.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from push_job.method import Arena, Certificate, MethodSpec, Refusal, Seen, Task, Told
from push_job.report import Figure, Report, Status, polyline
from push_model.arrays import Array
from push_model.belief import Belief
from push_model.jobs import JobError, JobPhase
from push_model.settings import SettingsError, bounded, settings
from push_model.specs import ObjectSpec, RobotSpec

_MOST = 0.4  # [kg] that it shoves


@settings
class ShoveSettings:
    """How hard the bulldozer shoves."""

    speed: float = bounded(0.08, low=0.01, high=0.12, doc="Speed of a push (m/s).")
    within: float = bounded(
        0.05, low=0.001, high=1.0, doc="Distance from the goal at which the object has arrived (m)."
    )


class Bulldozer:
    """One robot that drives straight at an object which stands before it."""

    def __init__(self, arena: Arena) -> None:
        self._arena, self._settings = arena, arena.section("", ShoveSettings)
        self._goal: Array | None = None
        self._last: Array | None = None
        self._code, self._reason = 0, "waiting for a goal"

    @property
    def status(self) -> Status:
        """State, reason and code, as in ``/job_state``."""
        phase = JobPhase.PUSHING if self._goal is not None else JobPhase.IDLE
        return Status(int(phase), phase.name, self._reason, self._code)

    def assess(self, task: Task, belief: Belief, seen: Seen | None) -> Certificate | Refusal:
        """Whether it can: the object must not be too heavy."""
        if belief.object(self._arena.object).mass > _MOST:
            text = f"a bulldozer this small shoves no more than {_MOST:g} kg"
            return Refusal(JobError.TOO_HEAVY, text)
        return Certificate()

    def begin(self, task: Task, belief: Belief) -> None:
        """Take the task."""
        self._goal, self._code, self._reason = task.goal, 0, "shoving"

    def step(self, seen: Seen, belief: Belief) -> Told:
        """Drive at the object, until it is there."""
        away, _ = self.errors(seen)
        if away < self._settings.within:
            self.end(JobError.NONE, "there")
            return Told()
        (name,) = seen.robots
        robot = seen.robots[name]
        ahead = seen.object[:2] - robot[:2]
        turn = math.remainder(math.atan2(ahead[1], ahead[0]) - robot[2], 2.0 * math.pi)
        return Told({name: (self._settings.speed, 2.0 * turn)})

    def report(self, seen: Seen) -> Report | None:
        """What live view, bag and report show."""
        if self._goal is None:
            return None
        way = np.vstack([seen.object[:2], self._goal[:2]])
        figures = (Figure("still to go", self.errors(seen)[0], "m"),)
        return Report("shove", figures, (polyline("beeline", way),))

    def end(self, code: JobError, reason: str) -> None:
        """End the task under way, if there is one."""
        if self._goal is not None:
            self._last, self._goal = self._goal, None
            self._code, self._reason = int(code), reason

    def revive(self) -> None:
        """It never considers its robot dead."""

    def release(self) -> frozenset[str]:
        """Its robot is free between tasks."""
        return frozenset(self._arena.robots) if self._goal is None else frozenset()

    def errors(self, seen: Seen) -> tuple[float, float]:
        """[m] to the goal of this task or of the last one; headings do not count."""
        goal = self._last if self._goal is None else self._goal
        away = seen.object[:2] - (seen.object if goal is None else goal)[:2]
        return float(np.hypot(away[0], away[1])), 0.0

    def facts(self) -> dict[str, Any]:
        """For ``/diagnostics``."""
        return {"make": "yellow"}


def one_robot(robots: Mapping[str, RobotSpec], item: ObjectSpec) -> None:
    """Refuse a team of several robots."""
    if len(robots) != 1:
        raise SettingsError(f"has {len(robots)} robots; a bulldozer works alone")


METHOD = MethodSpec("bulldozer", Bulldozer, {"": ShoveSettings}, one_robot)
