"""The job of a group: bring an object to a pose, step by step. No ROS, no clock.

A step is planned from where everybody is, the robots go to their places, push a piece of the way,
and back off; then the next one. What goes wrong in a step is met by planning the next one; a robot
that does not move although it is told to is left where it is, and the others go on without it.
"""

from dataclasses import dataclass

import numpy as np

from grasp_opt.contact_outline import ContactOutline
from grasp_opt.group_control import GroupControlSettings
from grasp_opt.group_push import GroupPush, GroupPushSettings, GroupStep, Phase
from grasp_opt.moves import Mover, MoveSettings, back_off
from grasp_opt.object_trajectory import ObjectTrajectory
from grasp_opt.step_planner import GroupPlan
from push_estimation.actuation_monitor import ActuationMonitor
from push_model import se2
from push_model.arrays import Array
from push_model.jobs import JobError, JobPhase
from push_model.settings import bounded, settings
from push_model.specs import ObjectSpec, RobotSpec


@settings
class GroupJobSettings:
    """When a job is done, and when it is given up."""

    position_tolerance: float = bounded(5e-3, low=1e-4, high=1.0, doc="[m] of the goal")
    orientation_tolerance: float = bounded(0.03, low=1e-3, high=3.2, doc="[rad] likewise")
    failures: int = bounded(4, low=0, high=100, doc="steps that may go wrong one after the other")
    steps: int = bounded(40, low=1, high=1000, doc="at most")
    moving: float = bounded(180.0, low=1.0, high=3600.0, doc="[s] at most between two pushes")


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


class GroupJob:
    """One job at a time of ``count`` robots of one type.

    state, reason, error: as in JobState. request: a step to be planned, answered by ``planned`` or
    ``failed``. dead: robots that do not move. pushes, replans: of this job; left: pieces that the
    last plan had; last: what the last tick of a push came from.
    """

    def __init__(
        self,
        item: ObjectSpec,
        robot: RobotSpec,
        count: int,
        settings: GroupJobSettings | None = None,
        push: GroupPushSettings | None = None,
        control: GroupControlSettings | None = None,
        moves: MoveSettings | None = None,
    ) -> None:
        self.settings = settings or GroupJobSettings()
        self._item, self._robot, self._count = item, robot, count
        self._push_settings = push or GroupPushSettings()
        self._control, self._moves = control, moves or MoveSettings()
        self._outline = ContactOutline(item.geometry)
        self.state, self.reason, self.error = JobPhase.IDLE, "waiting for a goal", JobError.NONE
        self.goal: Array | None = None
        self.request: Request | None = None
        self.dead: tuple[int, ...] = ()
        self.pushes = self.replans = self.left = 0
        self.plan: GroupPlan | None = None
        self.last: GroupStep | None = None
        self._failures = 0
        self._revived = False
        self._along: ObjectTrajectory | None = None  # what is left of the one that was given
        self._following = False
        self._fewest = 0  # robots that are to push at least: fewer have failed
        self._push: GroupPush | None = None
        self._mover: Mover | None = None
        self._watch: ActuationMonitor | None = None
        self._since = 0.0

    @property
    def busy(self) -> bool:
        """Whether a job is under way."""
        return self.state is not JobPhase.IDLE

    def begin(self, goal: Array) -> None:
        """Take a goal ``(3,)`` of the centre of mass; no job is under way."""
        self.goal, self.error = goal, JobError.NONE
        self.pushes = self.replans = self._failures = self.left = 0
        self.plan, self._along, self._revived = None, None, False
        self._following, self._fewest = False, 0
        self._enter(JobPhase.DETACHING, "robots come away from the object")

    def begin_along(self, trajectory: ObjectTrajectory) -> None:
        """Take a trajectory of the centre of mass instead: one push, or several where the robots
        must change places on it."""
        self.begin(trajectory.pose[-1])
        self._along, self._following = trajectory, True

    def end(self, code: JobError, message: str) -> None:
        """End the job under way."""
        if self.busy:
            self.error, self.request, self.last = code, None, None
            self._enter(JobPhase.IDLE, message)

    def revive(self) -> None:
        """Believe in all robots again: the world was reset, or somebody saw to them."""
        self.dead = ()

    def believe(self, item: ObjectSpec, robot: RobotSpec) -> None:
        """Go on with another object and robot type than before; a push under way too."""
        if item == self._item and robot == self._robot:
            return
        self._item, self._robot = item, robot
        self._outline = ContactOutline(item.geometry)
        if self._push is not None:
            self._push.believe(item, robot)

    def planned(self, plan: GroupPlan) -> None:
        """The answer to a request."""
        if self.request is None:
            return
        self.request, self.plan, self.left = None, plan, plan.left
        self._mover = Mover(plan.batches, self._robot.differential, self._moves)
        count = len(plan.pushers)
        self._enter(JobPhase.POSITIONING, f"{count} robots go to their places")

    def failed(self, code: JobError, message: str) -> None:
        """The answer to a request that cannot be met; with all robots it may be."""
        if self.request is None:
            return
        self.request = None
        if self.dead and not self._revived:
            self._revived = True
            self.dead = ()
            self._enter(JobPhase.DETACHING, f"{message}; those that did not move are tried again")
            return
        self.end(code, message)

    def step(self, now: float, pose: Array, robots: Array) -> Array:
        """Twists ``(n, 2)`` of a tick. pose ``(3,)`` of the centre of mass, robots ``(n, 3)``."""
        if self.state in (JobPhase.IDLE, JobPhase.PLANNING):
            self._since = now
            return np.zeros((self._count, 2))
        if self.state is JobPhase.DETACHING:
            twists = self._detach(pose, robots)
        elif self.state is JobPhase.POSITIONING:
            twists = self._go(now, pose, robots)
        else:
            return self._push_on(now, pose, robots)
        return twists if self._obeyed(now, robots, twists) else 0.0 * twists

    def _enter(self, state: JobPhase, reason: str) -> None:
        self.state, self.reason = state, reason
        self._watch = ActuationMonitor(
            self._count, self._push_settings.dead, self._push_settings.dead_way
        )
        if state is not JobPhase.POSITIONING:
            self._mover = None
        if state not in (JobPhase.APPROACH, JobPhase.PUSHING):
            self._push = self.last = None

    def _obeyed(self, now: float, robots: Array, twists: Array) -> bool:
        """Whether all do as they are told; else the step is planned anew without who does not."""
        assert self._watch is not None
        told = self._watch.step(now, robots, twists)
        late = now - self._since > self.settings.moving
        if not told and not late:
            return True
        self._since = now
        self._lost(told, "robots take too long to their places" if late else "")
        return False

    def _lost(self, dead: tuple[int, ...], reason: str) -> None:
        """A step went wrong."""
        self.dead = tuple(sorted({*self.dead, *dead}))
        if dead:
            reason = f"going on without {len(self.dead)} of {self._count} robots: " + (
                reason or "it does not move although told to"
            )
        self._failures += 1
        self.replans += 1
        if self._failures > self.settings.failures or (self._following and self.pushes):
            self.end(JobError.EXECUTION_FAILED, reason)
            return
        self._enter(JobPhase.DETACHING, reason)

    def _detach(self, pose: Array, robots: Array) -> Array:
        local = se2.transform(se2.inverse(pose), robots[:, :2])
        way, away = self._outline.nearest(local)
        normals = self._outline.at(way).normals @ se2.rotation_matrix(float(pose[2])).T
        ahead = normals[:, 0] * np.cos(robots[:, 2]) + normals[:, 1] * np.sin(robots[:, 2])
        alive = [i for i in range(self._count) if i not in self.dead]
        radius = self._robot.footprint_radius
        gaps, room = away - radius, 2.0 * radius + 4e-3
        twists = back_off(robots, gaps, ahead, alive, room, self._moves)
        if not twists.any():
            self._look(pose, robots)
        return twists

    def _look(self, pose: Array, robots: Array) -> None:
        """At the goal, or what next."""
        assert self.goal is not None
        off = se2.between(self.goal, pose)
        away, turned = float(np.hypot(off[0], off[1])), abs(float(off[2]))
        s = self.settings
        if away <= s.position_tolerance and turned <= s.orientation_tolerance:
            self.end(JobError.NONE, f"at the goal: {1e3 * away:.1f} mm, {turned:.3f} rad")
            return
        if self.pushes >= s.steps or (self._following and self._along is None):
            text = f"{1e3 * away:.1f} mm and {turned:.3f} rad off after {self.pushes} pushes"
            self.end(JobError.OFF_TARGET, text)
            return
        self._enter(JobPhase.PLANNING, "planning the next step")
        self.request = Request(
            pose.copy(), self.goal, robots.copy(), self.dead, self._along, self._fewest
        )

    def _go(self, now: float, pose: Array, robots: Array) -> Array:
        assert self._mover is not None and self.plan is not None
        twists = self._mover.step(robots)
        if not self._mover.done:
            return twists
        gone = se2.between(self.plan.trajectory.pose[0], pose)
        if np.hypot(gone[0], gone[1]) > 0.02 or abs(gone[2]) > 0.1:
            self._lost((), "the object was moved while robots went to their places")
            return 0.0 * twists
        self._push = GroupPush(
            self._item,
            self._robot,
            self.plan.placement.way,
            self.plan.trajectory,
            self._push_settings,
            self._control,
        )
        self._enter_push(JobPhase.APPROACH, "robots look for contact")
        return 0.0 * twists

    def _enter_push(self, state: JobPhase, reason: str) -> None:
        push = self._push
        self._enter(state, reason)
        self._push = push

    def _push_on(self, now: float, pose: Array, robots: Array) -> Array:
        assert self._push is not None and self.plan is not None
        pushers = list(self.plan.pushers)
        step = self._push.step(now, pose, robots[pushers])
        self.last = step
        twists = np.zeros((self._count, 2))
        twists[pushers] = step.twists
        if step.phase is Phase.PUSH and self.state is JobPhase.APPROACH:
            self.pushes += 1
            self._enter_push(JobPhase.PUSHING, f"{len(pushers)} robots push")
            self.last = step
        elif step.phase is Phase.DONE:
            self._failures = 0
            self.left = max(0, self.left - 1)
            if self._along is not None:
                begin, end = self.plan.trajectory.duration, self._along.duration
                self._along = self._along.between(begin, end) if self.left else None
            self._since = now
            self._enter(JobPhase.DETACHING, "the piece is done")
        elif step.phase is Phase.FAILED:
            self._since = now
            # Who was only held fast moves when it backs off; who does not is dead.
            self._fewest = len(pushers) + 1
            self._lost((), step.reason)
        return twists
