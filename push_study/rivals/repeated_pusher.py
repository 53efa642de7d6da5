"""What rivals share in which one robot pushes again and again until the object is at its goal."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from push_job.method import Arena, Task
from push_job.report import Status
from push_model import se2
from push_model.arrays import Array
from push_model.belief import Belief
from push_model.jobs import JobError
from push_model.settings import bounded, settings
from push_model.specs import RobotSpec
from push_study.rivals.lone_pusher import STILL, GoalTolerances, LonePusher

ACCELERATION = 0.3
"""[m/s^2] of a push."""
CREEP = 5e-3
"""[m/s] of the end of a push."""
_LOST = 0.3  # [s] in doubt until contact counts as lost
_WATCH, _STUCK = 1.0, 0.3  # [s]; of the commanded way, less than which the object moves in it


@settings
class RepeatedSettings(GoalTolerances):
    """Tolerances, and how often and how fast it pushes."""

    push_speed: float = bounded(0.125, low=1e-3, high=1.0, doc="Speed of a push (m/s).")
    attempts: int = bounded(6, low=1, high=1000, doc="Number of pushes after which the job fails.")


class RepeatedPusher(LonePusher):
    """Drives to a side, touches it, and steers; then backs off and begins anew."""

    def __init__(self, arena: Arena, name: str, own: RepeatedSettings) -> None:
        super().__init__(arena, name, own)
        self._repeated = own
        self._pushes = 0

    @abstractmethod
    def _choose(self, robot: Array, seen: Array, belief: Belief, spec: RobotSpec) -> str:
        """Choose a push and call ``_set_out``; why none is possible, empty if one is."""

    @abstractmethod
    def _steered(self, now: Array, item: Array) -> tuple[float, float]:
        """Speed [m/s] and turn rate [rad/s] of a robot at ``(3,)`` with the object's centre of mass
        at ``(3,)``; no speed at the end of a push."""

    @property
    def status(self) -> Status:
        """See Method."""
        return replace(super().status, pushes=self._pushes)

    def begin(self, task: Task, belief: Belief) -> None:
        """See Method."""
        super().begin(task, belief)
        self._pushes, self._backed = 0, False

    def _look(self, robot: Array, seen: Array, belief: Belief) -> None:
        """Choose a push, and set out."""
        spec, near = belief.robot(self._name), self._side.near
        near.believe(spec, self._item)
        missed = self._off(self._item.mass_pose(seen))
        if not missed:
            self.end(JobError.NONE, "at the goal")
        elif self._pushes >= self._repeated.attempts:
            text = f"the object is {missed} after {self._pushes} pushes"
            self.end(JobError.OFF_TARGET, text)
        elif near.touching(robot, seen) and not self._backed:
            self._backed = True  # once: there may be no room
            self._back_off(robot, seen)
        elif blocked := self._choose(robot, seen, belief, spec):
            self.end(JobError.PLANNING_FAILED, blocked)

    def _touched(self, item: Array) -> None:
        self._pushes += 1
        self._over = 0.0
        self._watched, self._since, self._asked = item[:2].copy(), 0.0, 0.0
        self._stuck = self._backed = False

    def _push(self, dt: float, now: Array, item: Array, lost: Array) -> tuple[float, float]:
        v, omega = self._steered(now, se2.compose(now, self._measured))
        self._watch(dt, item)
        if self._doubt > _LOST or self._stuck or v <= 0.0:
            self._over += dt
            if self._over > STILL:
                self._look_again()
            return 0.0, 0.0
        slower = min(1.0, (self._in_force[0] + ACCELERATION * dt) / v)
        return self._arena.robot.differential.saturate(slower * v, slower * omega)

    def _watch(self, dt: float, item: Array) -> None:
        """Whether something holds robot and object fast."""
        self._since, self._asked = self._since + dt, self._asked + dt * self._in_force[0]
        if self._since >= _WATCH:
            moved = float(np.hypot(*(item[:2] - self._watched)))
            self._stuck = self._stuck or moved < _STUCK * self._asked
            self._watched, self._since, self._asked = item[:2].copy(), 0.0, 0.0

    def facts(self) -> Mapping[str, Any]:
        """See Method."""
        return {"pushes": self._pushes}
