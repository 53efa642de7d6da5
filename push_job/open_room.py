"""Hosts a law that gives robots velocities: one position after another, in an open room.

The rivals of the studies and the swarm with own sensing are such laws. Each is a file that says how
robots move; the rest is the same for all. A law that leads the object round walls says how long the
way is that is left (``WalledLaw``), because the object may have to go away from its target first. A
law whose robots have memories of their own is told which robots it moves (``NamedLaw``). A law that
steers robots with two wheels itself says how fast they drive and turn (``TwistLaw``).
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol, runtime_checkable

import numpy as np

from push_job.method import Arena, Certificate, MethodSpec, Refusal, Seen, Task, Told, Unsuited
from push_job.report import Figure, Report, Status, discs
from push_model.arrays import Array
from push_model.belief import Belief
from push_model.jobs import JobError, JobPhase
from push_model.settings import bounded, settings
from push_model.specs import ObjectSpec

_LEAD = 0.025  # [m] of the point ahead of the axle that is driven
_STEP = 0.02  # [s] between decisions, as in the published simulations
_CLOSER = 5e-3  # [m] that the object must come closer for it to count as progress


@settings
class OpenRoomSettings:
    """What all laws in an open room have."""

    position_tolerance: float = bounded(
        0.1,
        low=1e-3,
        high=10.0,
        doc="Distance of the object from a target at which the target counts as reached (m).",
    )
    orientation: bool = bounded(
        False,
        doc="Whether the headings of goals matter. It must be false, because this method controls "
        "only positions. If it is true, goals with a heading are refused.",
    )
    stalled: float = bounded(
        120.0,
        low=1.0,
        high=3600.0,
        doc="Time after which the job fails if the object has come no closer to its target (s). "
        "In a room with inner walls, the distance to the target is the length of the route around "
        "them",
    )
    seed: int = bounded(0, low=0, high=2**31 - 1, doc="Seed of the random numbers of this method.")


@dataclass(frozen=True)
class OpenRoom:
    """Where a law works, with the origin in the middle of the room.

    size: [m] of the room. item: the object. radius [m], speed [m/s]: of the robots.
    target ``(2,)`` [m]. seed: of what it draws.
    """

    size: tuple[float, float]
    item: ObjectSpec
    radius: float
    speed: float
    target: Array
    seed: int


class VelocityLaw(Protocol):
    """Moves robots that go in any direction."""

    def velocities(self, time: float, pose: Array, robots: Array) -> Array:
        """``(n, 2)`` [m/s]. time: [s]; pose ``(3,)`` of the object's centre of mass; robots
        ``(n, 3)``: poses."""
        ...


@runtime_checkable
class WalledLaw(Protocol):
    """A law for rooms with walls in them."""

    def left(self, pose: Array) -> float:
        """[m] of way that an object with its centre of mass at ``(3,)`` has to its target; inf if
        it is not known yet."""
        ...


@runtime_checkable
class TwistLaw(Protocol):
    """A law that steers robots with two wheels itself."""

    def twists(self, time: float, pose: Array, robots: Array) -> Array:
        """``(n, 2)`` speeds ahead [m/s] and turn rates [rad/s]; see VelocityLaw."""
        ...


@runtime_checkable
class NamedLaw(Protocol):
    """A law that remembers something of each robot, also while it is not seen."""

    def meet(self, names: tuple[str, ...]) -> None:
        """Names of the robots of the calls of ``velocities`` that follow, in their order."""
        ...


class NoWay(Exception):
    """Raised by a law: walls separate the object from its target."""


Ways = Callable[[ObjectSpec, Array, Array], None]
"""Raises NoWay if an object cannot go from one point ``(2,)`` [m] to another one, as of
``OpenRoom``."""


class OpenRoomMethod:
    """A method whose robots move as a law says."""

    def __init__(
        self,
        name: str,
        make: Callable[[OpenRoom], VelocityLaw],
        arena: Arena,
        ways: Ways | None = None,
    ) -> None:
        """ways: where the room has walls in it."""
        self._name, self._make, self._arena, self._ways = name, make, arena, ways
        self._settings = arena.section("", OpenRoomSettings)
        self._law: VelocityLaw | None = None
        self._walled: WalledLaw | None = None
        self._named: NamedLaw | None = None
        self._twisting: TwistLaw | None = None
        self._targets: tuple[Array, ...] = ()
        self._index, self._code = 0, JobError.NONE
        self._reason, self._busy = "waiting for a goal", False
        self._next = -math.inf
        self._held = np.zeros((0, 2))
        self._nearest, self._closer = math.inf, math.nan
        self._item = arena.item
        self._names: tuple[str, ...] = ()
        extent = arena.grid.free_extent
        if extent is None:
            raise Unsuited("the map has no free cell")
        x0, x1, y0, y1 = extent
        self._middle = 0.5 * np.array([x0 + x1, y0 + y1])
        self._size = x1 - x0, y1 - y0

    @property
    def status(self) -> Status:
        """See Method."""
        phase = JobPhase.PUSHING if self._busy else JobPhase.IDLE
        count = len(self._targets)
        progress = self._index / count if count else float(not self._busy)
        index = min(self._index, max(0, count - 1))
        return Status(int(phase), phase.name, self._reason, int(self._code), progress, index, count)

    def assess(self, task: Task, belief: Belief, seen: Seen | None) -> Certificate | Refusal:
        """See Method: positions only."""
        if task.times or not all(math.isnan(t[2]) for t in task.targets):
            text = f"the method '{self._name}' takes positions, without headings or times"
            return Refusal(JobError.INVALID_GOAL, text)
        if self._ways is not None and seen is not None:
            item = belief.object(self._arena.object)
            places = [item.mass_pose(seen.object)[:2], *(t[:2] for t in task.targets)]
            try:
                for start, end in pairwise(places):
                    self._ways(item, start - self._middle, end - self._middle)
            except NoWay as problem:
                return Refusal(JobError.PLANNING_FAILED, str(problem))
        return Certificate()

    def begin(self, task: Task, belief: Belief) -> None:
        """See Method."""
        self._targets, self._index, self._code = task.targets, 0, JobError.NONE
        self._busy = True
        self._aim(belief)

    def _aim(self, belief: Belief) -> None:
        robot, self._item = self._arena.robot, belief.object(self._arena.object)
        self._reason = f"target {self._index + 1} of {len(self._targets)}"
        self._next, self._held = -math.inf, np.zeros((0, 2))
        self._nearest, self._closer = math.inf, math.nan
        law = self._law = self._make(
            OpenRoom(
                self._size,
                self._item,
                robot.footprint_radius,
                robot.max_speed,
                self._targets[self._index][:2] - self._middle,
                self._settings.seed,
            )
        )
        self._walled = law if isinstance(law, WalledLaw) else None
        self._named = law if isinstance(law, NamedLaw) else None
        self._twisting = law if isinstance(law, TwistLaw) else None

    def step(self, seen: Seen, belief: Belief) -> Told:
        """See Method."""
        if not self._busy:
            return Told()
        names = tuple(n for n in self._arena.robots if n in seen.robots)
        away, _ = self.errors(seen)
        if away < self._settings.position_tolerance:
            self._index += 1
            if self._index >= len(self._targets):
                self.end(JobError.NONE, f"at the goal: {1e3 * away:.0f} mm")
                return Told()
            self._aim(belief)
            away, _ = self.errors(seen)
        origin = np.array([*self._middle, 0.0])
        pose = self._item.mass_pose(seen.object) - origin
        left = away if self._walled is None else self._walled.left(pose)
        if not self._progresses(seen.time, left):
            text = f"the object has not come closer for {self._settings.stalled:g} s"
            self.end(JobError.EXECUTION_FAILED, text)
        if not names or self._law is None:
            return Told()
        robot, robots = self._arena.robot, np.array([seen.robots[n] for n in names])
        waits = 1e-9 < self._next - seen.time < _STEP + 1e-9  # else time has jumped back
        if not waits or names != self._names:
            self._next, self._names = seen.time + _STEP, names
            if self._named is not None:
                self._named.meet(names)
            try:
                self._held = self._decided(self._law, seen.time, pose, robots - origin)
            except NoWay as problem:
                self.end(JobError.PLANNING_FAILED, str(problem))
                return Told()
        told = self._held
        if robot.kinematics is not None and self._twisting is None:
            told = robot.kinematics.follow(told, robots[:, 2], _LEAD)
        return Told({n: (float(a), float(b)) for n, (a, b) in zip(names, told, strict=True)})

    def _decided(self, law: VelocityLaw, now: float, pose: Array, robots: Array) -> Array:
        """``(n, 2)`` velocities, or twists of robots with two wheels whose law steers them."""
        robot = self._arena.robot
        if robot.kinematics is not None and self._twisting is not None:
            return self._twisting.twists(now, pose, robots)
        chosen = law.velocities(now, pose, robots)
        slowed: Array = chosen / np.maximum(np.hypot(*chosen.T) / robot.max_speed, 1.0)[:, None]
        return slowed

    def _progresses(self, now: float, left: float) -> bool:
        if math.isnan(self._closer) or left < self._nearest - _CLOSER:
            self._nearest, self._closer = left, now
        limit: float = self._settings.stalled
        return now - self._closer <= limit

    def report(self, seen: Seen) -> Report | None:
        """See Method."""
        if not self._busy:
            return None
        away, _ = self.errors(seen)
        target = discs("target", self._targets[self._index][None, :2], 0.02)
        return Report("push", (Figure("to the target", away, "m"),), (target,))

    def end(self, code: JobError, reason: str) -> None:
        """See Method."""
        if self._busy:
            self._busy, self._code, self._reason, self._law = False, code, reason, None

    def revive(self) -> None:
        """See Method: a law does not know which robots fail."""

    def release(self) -> frozenset[str]:
        """See Method."""
        return frozenset() if self._busy else frozenset(self._arena.robots)

    def errors(self, seen: Seen) -> tuple[float, float]:
        """See Method."""
        if not self._targets:
            return math.inf, math.inf
        target = self._targets[min(self._index, len(self._targets) - 1)]
        here = self._arena.item.mass_pose(seen.object)
        return math.hypot(here[0] - target[0], here[1] - target[1]), 0.0

    def facts(self) -> Mapping[str, Any]:
        """See Method."""
        return {"target": f"{self._index + 1} of {len(self._targets)}"}


def open_room_method(name: str, make: Callable[[OpenRoom], VelocityLaw]) -> MethodSpec:
    """The row of a method whose law has no settings of its own."""
    return MethodSpec(name, lambda arena: OpenRoomMethod(name, make, arena), {"": OpenRoomSettings})
