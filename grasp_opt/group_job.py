"""The job of a group: bring an object to a pose, step by step. No ROS, no clock.

A step is planned from where everybody is, the robots go to their places, push a piece of the way,
and back off; then the next one. What goes wrong in a step is met by planning the next one; a robot
that does not move although it is told to is left where it is, and the others go on without it.
"""

import math
from dataclasses import replace

import numpy as np

from grasp_opt.contact_outline import ContactOutline
from grasp_opt.group_control import GroupControlSettings
from grasp_opt.group_push import GroupPush, GroupPushSettings, GroupStep, Phase
from grasp_opt.job_state import NOBODY, MoveWatch, Request, Step, Tally, Task, without
from grasp_opt.moves import Mover, MoveSettings, back_off
from grasp_opt.object_trajectory import ObjectTrajectory
from grasp_opt.prediction import GroupPrediction
from grasp_opt.slip_watch import SlipWatch
from grasp_opt.step_planner import GroupPlan
from push_model import se2
from push_model.arrays import Array
from push_model.jobs import JobError, JobPhase
from push_model.settings import bounded, settings
from push_model.specs import ObjectSpec, RobotSpec
from push_model.stick_certificate import ContactBelief


@settings
class GroupJobSettings:
    """When a job is done, and when it is given up."""

    position_tolerance: float = bounded(
        5e-3,
        low=1e-4,
        high=1.0,
        doc="Distance of the object from the goal position within which the job is done (m).",
    )
    orientation_tolerance: float = bounded(
        0.03,
        low=1e-3,
        high=3.2,
        doc="Angle of the object from the goal orientation within which the job is done (rad).",
    )
    failures: int = bounded(
        4,
        low=0,
        high=100,
        doc="Number of failed steps in a row that a job tolerates; one more ends the job. A step "
        "is one push and the motions of the robots before it.",
    )
    steps: int = bounded(40, low=1, high=1000, doc="Maximum number of pushes in a job.")
    moving: float = bounded(
        180.0,
        low=1.0,
        high=3600.0,
        doc="Time limit for the robots to reach their places between two pushes (s).",
    )


class GroupJob:
    """One job at a time of ``count`` robots of one type.

    state, reason, error: as in JobState. request: a step to be planned, answered by ``planned`` or
    ``failed``. dead: indices of robots that do not move. Poses are those of the frame that is
    answered; ``pose_delay`` later they are no longer true, which the job makes good.
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
        """item, robot: as believed."""
        self.settings = s = settings or GroupJobSettings()
        self._item, self._robot, self._count = item, robot, count
        self._believed: ContactBelief | None = None
        self._asked_for: tuple[ObjectSpec, ContactBelief | None] = item, None
        self._push_settings = push or GroupPushSettings()
        self._control, self._moves = control or GroupControlSettings(), moves or MoveSettings()
        self._outline = ContactOutline(item.geometry)
        self.state, self.reason, self.error = JobPhase.IDLE, "waiting for a goal", JobError.NONE
        self.request: Request | None = None
        self.dead: tuple[int, ...] = ()
        self._task, self._tally, self._step = Task(), Tally(), Step()
        p = self._push_settings
        self._watch = MoveWatch(count, p.dead, p.dead_way, s.moving)
        self._prediction = GroupPrediction(count, self._control.pose_delay)

    @property
    def busy(self) -> bool:
        """Whether a job is under way."""
        return self.state is not JobPhase.IDLE

    @property
    def goal(self) -> Array | None:
        """``(3,)`` of the centre of mass, of the last job; None before the first one."""
        return self._task.goal

    @property
    def pushes(self) -> int:
        """Pushes of this job that were begun."""
        return self._tally.pushes

    @property
    def replans(self) -> int:
        """Steps of this job that were planned anew because one failed."""
        return self._tally.replans

    @property
    def left(self) -> int:
        """Pieces of the way that the last plan had, less those that are done."""
        return self._tally.left

    @property
    def plan(self) -> GroupPlan | None:
        """The last step that was planned."""
        return self._step.plan

    @property
    def last(self) -> GroupStep | None:
        """The last tick of the push under way; None between pushes."""
        return self._step.last

    @property
    def watch(self) -> SlipWatch | None:
        """What the belief says of the last step that was planned."""
        return self._step.watch

    @property
    def slip_in(self) -> float:
        """[s] until the contacts may no longer hold the object; inf as far as they do."""
        step = self._step
        return (
            math.inf
            if step.last is None or step.watch is None
            else step.watch.ahead(step.last.time)
        )

    @property
    def pose_delay(self) -> float:
        """[s] from the measurement of a frame to the command that answers it; may change at any
        time."""
        return self._prediction.delay

    @pose_delay.setter
    def pose_delay(self, seconds: float) -> None:
        self._prediction.delay = seconds
        self._control = replace(self._control, pose_delay=seconds)
        if self._step.push is not None:
            self._step.push.pose_delay = seconds

    def begin(self, goal: Array) -> None:
        """Take a goal ``(3,)`` of the centre of mass; no job is under way."""
        self._begin(Task(goal))

    def begin_along(self, trajectory: ObjectTrajectory) -> None:
        """Take a trajectory of the centre of mass instead: one push, or several where the robots
        must change places on it."""
        self._begin(Task(trajectory.pose[-1], trajectory, True))

    def _begin(self, task: Task) -> None:
        self.error = JobError.NONE
        self._task, self._tally, self._step = task, Tally(), Step()
        self._watch.since = None
        self._enter(JobPhase.DETACHING, "robots back off from the object")

    def end(self, code: JobError, message: str) -> None:
        """End the job under way."""
        if self.busy:
            self.error, self.request = code, None
            self._enter(JobPhase.IDLE, message)

    def revive(self) -> None:
        """Believe in all robots again: the world was reset, or somebody saw to them."""
        self.dead = ()

    def believe(
        self, item: ObjectSpec, robot: RobotSpec, believed: ContactBelief | None = None
    ) -> None:
        """Go on with another object and robot type than before; a push under way too. believed:
        intervals of friction and centre of mass."""
        if (item, robot, believed) == (self._item, self._robot, self._believed):
            return
        moved = np.subtract(item.com, self._item.com)
        self._item, self._robot, self._believed = item, robot, believed
        if moved.any():
            self._task.about(moved)
            if self.request is not None:
                self.request, self._asked_for = self.request.about(moved), (item, believed)
        before, self._outline = self._outline, ContactOutline(item.geometry)
        self._step.believe(before, self._outline, moved)
        if self._step.watch is not None:
            self._step.watch.believe(item, believed)
        if self._step.push is not None:
            self._step.push.believe(item, robot, moved)

    def planned(self, plan: GroupPlan) -> None:
        """The answer to a request."""
        if self.request is None:
            return
        self.request, self._tally.left = None, plan.left
        watch = SlipWatch(plan.placement.contacts, plan.trajectory, *self._asked_for)
        mover = Mover(plan.batches, self._robot.differential, self._moves)
        self._step = Step(plan, watch, mover)
        if self._asked_for != (self._item, self._believed):
            before = ContactOutline(self._asked_for[0].geometry)
            watch.believe(self._item, self._believed)
            self._step.believe(before, self._outline, np.zeros(2))
        count = len(plan.pushers)
        self._enter(JobPhase.POSITIONING, f"{count} robots go to their places")

    def failed(self, code: JobError, message: str) -> None:
        """The answer to a request that cannot be met; with all robots it may be."""
        if self.request is None:
            return
        self.request = None
        if self.dead and not self._tally.revived:
            self._tally.revived = True
            self.dead = ()
            self._enter(JobPhase.DETACHING, f"{message}; robots that did not move are tried again")
            return
        if self.dead and code is JobError.TOO_HEAVY:  # for all robots together it may not be
            code, message = JobError.EXECUTION_FAILED, without(self.dead, self._count, message)
        self.end(code, message)

    def rest(self, now: float) -> None:
        """A frame at a time [s] that is answered with zero commands, as when a pose is missing."""
        self._prediction.frame(now)
        self._prediction.answer(np.zeros((self._count, 2)))
        if self._step.push is not None:
            self._step.push.rest(now)

    def step(self, now: float, pose: Array, robots: Array) -> Array:
        """Twists ``(n, 2)`` v [m/s], omega [rad/s] of a tick.

        Parameters
        ----------
        now: [s] stamp of the frame. pose ``(3,)`` of the centre of mass, robots ``(n, 3)``: in it.
        """
        self._prediction.frame(now)
        twists = self._tick(now, pose, robots)
        self._prediction.answer(twists)
        return twists

    def _tick(self, now: float, pose: Array, robots: Array) -> Array:
        if self.state in (JobPhase.IDLE, JobPhase.PLANNING):
            self._watch.since = now
            return np.zeros((self._count, 2))
        if self.state in (JobPhase.APPROACH, JobPhase.PUSHING):
            return self._push_on(now, pose, robots)
        there = self._prediction.robots(robots)
        if self.state is JobPhase.DETACHING:
            twists = self._detach(pose, there)
        else:
            twists = self._go(pose, there)
        if self.state not in (JobPhase.DETACHING, JobPhase.POSITIONING):
            return twists
        return twists if self._obeyed(now, robots, twists) else 0.0 * twists

    def _enter(self, state: JobPhase, reason: str) -> None:
        self.state, self.reason = state, reason
        self._watch.renew()
        if state is not JobPhase.POSITIONING:
            self._step.mover = None
        if state not in (JobPhase.APPROACH, JobPhase.PUSHING):
            self._step.push = self._step.last = None

    def _obeyed(self, now: float, robots: Array, twists: Array) -> bool:
        """Whether all robots move as commanded; else the step is planned anew without the others.

        robots ``(n, 3)``: as measured. Predicted poses contain the commands themselves.
        """
        still, late = self._watch.step(now, robots, twists)
        if not still and not late:
            return True
        self._lost(still, "robots did not reach their places in time" if late else "")
        return False

    def _cut(self, now: float, time: float) -> bool:
        """Whether the push ends at a time [s] of its trajectory, before the object may slip."""
        left, s = self.slip_in, self._push_settings
        if left > s.slip_warning or not s.stop_before_slip:
            return False
        self._watch.since = now
        self._task.done_until(time, more=True)
        self._tally.failed()
        reason = (
            f"the contacts may not hold the object in {left:.1f} s, for what is believed now: a "
            "new plan is needed"
        )
        if self._tally.failures > self.settings.failures:
            self.end(JobError.EXECUTION_FAILED, reason)
        else:
            self._enter(JobPhase.DETACHING, reason)
        return True

    def _lost(self, dead: tuple[int, ...], reason: str) -> None:
        """A step went wrong."""
        self.dead = tuple(sorted({*self.dead, *dead}))
        if dead and len(self.dead) == self._count:
            self.end(JobError.EXECUTION_FAILED, NOBODY)
            return
        if dead:
            reason = f"going on without {len(self.dead)} of {self._count} robots: " + (
                reason or "it does not move although commanded to"
            )
        tally = self._tally
        tally.failed()
        if tally.failures > self.settings.failures or (self._task.following and tally.pushes):
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
        """End the job if the object is at the goal, and otherwise decide what to do next."""
        task, tally, s = self._task, self._tally, self.settings
        assert task.goal is not None
        off = se2.between(task.goal, pose)
        away, turned = float(np.hypot(off[0], off[1])), abs(float(off[2]))
        if away <= s.position_tolerance and turned <= s.orientation_tolerance:
            self.end(JobError.NONE, f"at the goal: {1e3 * away:.1f} mm, {turned:.3f} rad")
            return
        if tally.pushes >= s.steps or task.over:
            error = f"{1e3 * away:.1f} mm and {turned:.3f} rad"
            text = f"the object is {error} from the goal after {tally.pushes} pushes"
            self.end(JobError.OFF_TARGET, text)
            return
        self._enter(JobPhase.PLANNING, "planning the next step")
        self._asked_for = self._item, self._believed  # when the request was made
        self.request = Request(
            pose.copy(), task.goal, robots.copy(), self.dead, task.along, tally.fewest
        )

    def _go(self, pose: Array, robots: Array) -> Array:
        mover, plan = self._step.mover, self._step.plan
        assert mover is not None and plan is not None
        twists = mover.step(robots)
        if not mover.done:
            return twists
        gone = se2.between(plan.trajectory.pose[0], pose)
        if np.hypot(gone[0], gone[1]) > 0.02 or abs(gone[2]) > 0.1:
            self._lost((), "the object was moved while robots went to their places")
            return 0.0 * twists
        self._step.push = GroupPush(
            self._item,
            self._robot,
            plan.placement.way,
            plan.trajectory,
            self._push_settings,
            self._control,
        )
        self._enter(JobPhase.APPROACH, "robots approach the object")
        return 0.0 * twists

    def _push_on(self, now: float, pose: Array, robots: Array) -> Array:
        push, plan = self._step.push, self._step.plan
        assert push is not None and plan is not None
        pushers = list(plan.pushers)
        step = self._step.last = push.step(now, pose, robots[pushers])
        twists = np.zeros((self._count, 2))
        twists[pushers] = step.twists
        if step.phase is Phase.PUSH and self.state is JobPhase.APPROACH:
            self._tally.pushes += 1
            self._enter(JobPhase.PUSHING, f"{len(pushers)} robots push")
        if step.phase is Phase.DONE:
            self._tally.pushed()
            self._task.done_until(plan.trajectory.duration, more=self._tally.left > 0)
            self._watch.since = now
            self._enter(JobPhase.DETACHING, "the push is done")
        elif step.phase is Phase.FAILED:
            self._watch.since = now
            # A robot that was only held fast moves when it backs off; one that does not is dead.
            self._tally.fewest = len(pushers) + 1
            self._lost((), step.reason)
        else:
            return 0.0 * twists if self._cut(now, step.time) else twists
        return twists
