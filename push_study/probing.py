"""A robot that weaves behind an object to learn its friction and its centre of mass, as a method.

It runs in the graph by the name ``NAME``. The job ends when the robot has gone far enough, or when
the object is no longer at the bumper. Where the object ends is of no importance.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from push_estimation.line_push_model import Bumper
from push_estimation.probing_push import ProbingPush, ProbingSettings
from push_job.method import Arena, Certificate, MethodSpec, Refusal, Seen, Task, Told
from push_job.report import Figure, Report, Status
from push_model.arrays import Array
from push_model.belief import Belief
from push_model.bumpers import FlatBumper
from push_model.jobs import JobError, JobPhase
from push_model.settings import SettingsError, bounded, settings
from push_model.specs import ObjectSpec, RobotSpec

NAME = f"{__name__}:METHOD"
"""As ``LockstepRun`` takes it."""
_LOST = 0.5  # [s] for which the object may be away from the bumper


@settings
class ProbingWaySettings:
    """How far a probing push goes."""

    way: float = bounded(1.0, low=0.05, high=100.0, doc="Length of the robot's path (m).")


class Probing:
    """One probing push at a time."""

    def __init__(self, arena: Arena) -> None:
        self._arena = arena
        self._way = arena.section("", ProbingWaySettings).way
        self._values = arena.section("weave", ProbingSettings)
        (self._name,) = arena.robots
        robot = arena.robot
        self._bumper = Bumper(robot.push_distance, robot.flat_bumper.width / 2.0)
        self._law: ProbingPush | None = None
        self._goal: Array | None = None
        self._code, self._reason = JobError.NONE, "waiting for a goal"
        self.gone = 0.0
        """[m] that the robot has gone in this push."""
        self._time = math.nan  # [s] of the last frame
        self._lost = 0.0  # [s] for which the object has been away from the bumper

    @property
    def status(self) -> Status:
        """See Method."""
        phase = JobPhase.IDLE if self._law is None else JobPhase.PUSHING
        progress = min(1.0, self.gone / self._way)
        return Status(int(phase), phase.name, self._reason, int(self._code), progress)

    def assess(self, task: Task, belief: Belief, seen: Seen | None) -> Certificate | Refusal:
        """See Method."""
        return Certificate(seconds=self._way / self._values.speed)

    def begin(self, task: Task, belief: Belief) -> None:
        """See Method."""
        outline = belief.object(self._arena.object).outline
        self._law = ProbingPush(outline, self._bumper, self._values)
        self._goal, self.gone = task.goal, 0.0
        self._code, self._reason = JobError.NONE, "weaving"
        self._time, self._lost = math.nan, 0.0

    def step(self, seen: Seen, belief: Belief) -> Told:
        """See Method."""
        pose = seen.robots.get(self._name)
        if self._law is None or pose is None:
            return Told()
        dt = 0.0 if math.isnan(self._time) else min(0.1, max(0.0, seen.time - self._time))
        self._time = seen.time
        v, omega = self._law.step(dt, pose, seen.object)
        self.gone += v * dt
        self._lost = self._lost + dt if self._law.off else 0.0
        if self.gone >= self._way:
            self.end(JobError.NONE, f"pushed over {self.gone:.2f} m")
        elif self._lost > _LOST:
            self.end(JobError.EXECUTION_FAILED, "the object is no longer at the bumper")
        return Told({self._name: (v, omega)}) if self._law is not None else Told()

    def report(self, seen: Seen) -> Report | None:
        """See Method."""
        if self._law is None:
            return None
        return Report("push", (Figure("way", self.gone, "m"),), ())

    def end(self, code: JobError, reason: str) -> None:
        """See Method."""
        if self._law is not None:
            self._law, self._code, self._reason = None, code, reason

    def revive(self) -> None:
        """See Method: nobody is known to fail."""

    def release(self) -> frozenset[str]:
        """See Method."""
        return frozenset() if self._law is not None else frozenset({self._name})

    def errors(self, seen: Seen) -> tuple[float, float]:
        """See Method."""
        goal = seen.object if self._goal is None else self._goal
        return float(np.hypot(*(seen.object - goal)[:2])), 0.0

    def facts(self) -> Mapping[str, Any]:
        """See Method."""
        return {"way [m]": f"{self.gone:.2f}"}


def check_team(robots: Mapping[str, RobotSpec], item: ObjectSpec) -> None:
    """Raise SettingsError unless one robot with wheels and a flat bumper is given."""
    if len(robots) != 1:
        raise SettingsError(f"has {len(robots)} robots; a probing push takes one")
    (robot,) = robots.values()
    if not isinstance(robot.bumper, FlatBumper) or robot.kinematics is None:
        raise SettingsError("has a robot without wheels or flat bumper; a probing push needs both")


METHOD = MethodSpec(
    "probing", Probing, {"": ProbingWaySettings, "weave": ProbingSettings}, check_team, "line"
)
