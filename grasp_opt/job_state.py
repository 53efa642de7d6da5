"""What a group's job remembers: its task, the step it asks for, its count of pushes and failures,
the step under way."""

from dataclasses import dataclass, replace

import numpy as np

from grasp_opt.contact_outline import ContactOutline
from grasp_opt.group_push import GroupPush, GroupStep
from grasp_opt.moves import Mover
from grasp_opt.object_trajectory import ObjectTrajectory
from grasp_opt.slip_watch import SlipWatch
from grasp_opt.step_planner import GroupPlan
from push_estimation.actuation_monitor import ActuationMonitor
from push_model import se2
from push_model.arrays import Array

NOBODY = "no robot moves as commanded: the robots may be switched off, or the poses frozen"
"""Why a job ends when all robots stand."""


def without(dead: tuple[int, ...], count: int, message: str) -> str:
    """What is told of a failure when so many of ``count`` robots do not move."""
    those = f"{len(dead)} of {count} robots do not move although commanded to"
    return f"{those} (they may be switched off, or the poses frozen); without them: {message}"


@dataclass
class Task:
    """What a job is to reach.

    goal ``(3,)``: of the centre of mass. along: what is left of the trajectory that was given
    instead of a goal, None when all of it is done. following: whether a trajectory was given.
    """

    goal: Array | None = None
    along: ObjectTrajectory | None = None
    following: bool = False

    @property
    def over(self) -> bool:
        """Whether a trajectory was given and has been followed to its end."""
        return self.following and self.along is None

    def about(self, point: Array) -> None:
        """Tell it of another point ``(2,)`` [m] of the object: the centre of mass is believed to be
        there."""
        if self.goal is not None:
            self.goal = se2.compose(self.goal, np.array([*point, 0.0]))
        if self.along is not None:
            self.along = self.along.about(point)

    def done_until(self, time: float, more: bool) -> None:
        """The trajectory was followed until a time [s]; more: whether a part of it is left."""
        if self.along is not None:
            self.along = self.along.between(time, self.along.duration) if more else None


@dataclass(frozen=True)
class Request:
    """What the next step is to be planned for; poses of the centre of mass. trajectory: that is to
    be followed, where one was given instead of a goal. fewest: robots that are to push at least."""

    pose: Array
    goal: Array
    robots: Array
    dead: tuple[int, ...]
    trajectory: ObjectTrajectory | None = None
    fewest: int = 0

    def about(self, point: Array) -> "Request":
        """See ``Task.about``."""
        off = np.array([*point, 0.0])
        return replace(
            self,
            pose=se2.compose(self.pose, off),
            goal=se2.compose(self.goal, off),
            trajectory=self.trajectory and self.trajectory.about(point),
        )


@dataclass
class Tally:
    """How a job goes.

    pushes: that were begun. replans: steps that were planned anew because one failed. left: pieces
    of the way that the last plan had, less those that are done. failures: steps that failed one
    after the other. fewest: robots that must push at least, because fewer have failed. revived:
    whether robots that did not move have been tried a second time.
    """

    pushes: int = 0
    replans: int = 0
    left: int = 0
    failures: int = 0
    fewest: int = 0
    revived: bool = False

    def failed(self) -> None:
        """A step has failed."""
        self.failures += 1
        self.replans += 1

    def pushed(self) -> None:
        """A push has ended where its trajectory does."""
        self.failures = 0
        self.left = max(0, self.left - 1)


@dataclass
class Step:
    """The step under way: its plan, what the belief says of it, the robots' moves, then the push
    and its last tick."""

    plan: GroupPlan | None = None
    watch: SlipWatch | None = None
    mover: Mover | None = None
    push: GroupPush | None = None
    last: GroupStep | None = None

    def believe(self, before: ContactOutline, now: ContactOutline, moved: Array) -> None:
        """The plan for another outline, and another centre of mass by ``moved (2,)`` [m]."""
        if self.plan is None:
            return
        trajectory, placement = self.plan.trajectory, self.plan.placement
        if moved.any():
            trajectory = trajectory.about(moved)
        way = now.same_places(before, placement.way, moved)
        self.plan = replace(self.plan, trajectory=trajectory, placement=replace(placement, way=way))


class MoveWatch:
    """Tells which robots do not move as commanded between two pushes, and when it takes too long.

    since: [s] from when the time is counted; None: from the next frame on.
    """

    def __init__(self, count: int, patience: float, way: float, limit: float) -> None:
        """patience [s], way [m]: of the ActuationMonitor. limit: [s] between two pushes."""
        self._count, self._patience, self._way, self._limit = count, patience, way, limit
        self.since: float | None = None
        self.renew()

    def renew(self) -> None:
        """Forget the motion so far; the time is counted on."""
        self._monitor = ActuationMonitor(self._count, self._patience, self._way)

    def step(self, now: float, robots: Array, twists: Array) -> tuple[tuple[int, ...], bool]:
        """Indices of robots that do not move, and whether the time is over; see ActuationMonitor
        for the arguments. Either one restarts the time."""
        still = self._monitor.step(now, robots, twists)
        if self.since is None:
            self.since = now
        late = now - self.since > self._limit
        if still or late:
            self.since = now
        return still, late
