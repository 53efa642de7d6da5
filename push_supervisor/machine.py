"""The finite state machine of section 2.5. Events in, commands out; no ROS, no clock, no geometry.

The course of a job is that of ``Course``. This module adds what may happen meanwhile. A plan is
dropped when the object was moved by somebody else, and a controller that is lost is waited for.

When the goal moves or a later part of the plan is blocked during a push, the plan is repaired: the
robot goes on with the push for a while, and meanwhile a plan is made from where it will be then.
Where the push itself is blocked, or the plan fails or is late, the robot backs off and a plan is
made from there.
"""

from collections.abc import Callable
from dataclasses import dataclass

from push_model.arrays import Array
from push_model.jobs import JobError
from push_model.push_segment import PushSegment
from push_supervisor import commands, events
from push_supervisor.attempts import Attempts
from push_supervisor.commands import Command
from push_supervisor.course import Course
from push_supervisor.events import Event
from push_supervisor.state import MOVING, State

_LONGER = 1e-6  # [m]
_LATE = "the new plan was not ready in time"


@dataclass
class Machine(Course):
    """Takes events, one job at a time.

    beginning: of a push under way, up to where a new plan can begin; None if there is no room or no
    time to go on with it, or if it does not bring the object nearer to a goal, if one is given.
    """

    beginning: Callable[[PushSegment, Array | None], PushSegment | None] = lambda push, goal: None

    def __post_init__(self) -> None:
        super().__post_init__()
        self._item = ""  # that the job is about
        self._left: PushSegment | None = None  # push of a replaced job, which goes on
        self._repair: PushSegment | None = None  # push that goes on while a plan is made
        self._blocked = False  # whether the plan is repaired because it is blocked
        self._found: list[PushSegment] = []  # the plan so far, while it is still improved

    @property
    def left(self) -> bool:
        """Whether a push goes on after the end of its job, for a goal that is to follow at once."""
        return self._left is not None

    @property
    def repairing(self) -> bool:
        """Whether the robot goes on with a push while a new plan is made."""
        return self._repair is not None

    def handle(self, event: Event) -> list[Command]:
        """React to an event; one that means nothing in this state changes nothing."""
        self._out = []
        left, self._left = self._left, None
        repair = self._repair
        if isinstance(event, events.GoalGiven):
            self._on_goal(event, left)
        else:
            if left is not None:
                self._say(commands.Stop())
            self._dispatch(event, self.state)
        if self.state is not State.PUSHING:
            self._repair = None
        answered = isinstance(event, events.PlanFound | events.PlanFailed)
        if repair is not None and self._repair is not repair and not answered:
            self._out.insert(0, commands.CancelRepair())
        return self._out

    def _dispatch(self, event: Event, state: State) -> None:
        match event:
            case events.CancelCommanded():
                self._abort(JobError.CANCELED, "canceled")
            case events.ClockReset():
                self._abort(JobError.CLOCK_RESET, "the clock jumped back")
            case events.JobAborted():
                self._abort(event.code, event.message)
            case events.MapChanged():
                self._on_map(event.problem)
            case events.WayBlocked() if state is not State.PLANNING:
                self._on_others(event.message)
            case events.ExecuteCommanded() if state is State.IDLE:
                self._on_execute()
            case events.PlanFound(improving=True):
                self._found = list(event.segments) if self.repairing else []
            case events.PlanFound() if state is State.PLANNING:
                self._on_plan(event)
            case events.PlanFailed() if state is State.PLANNING:
                self._on_plan_failed(event)
            case events.PlanFound() if self.repairing:
                self._on_repaired(list(event.segments))
            case events.PlanFailed() if self.repairing:
                self._unrepaired(event.message)
            case events.PathFound() if state is State.POSITIONING:
                self._on_path(event)
            case events.PathFailed() if state is State.POSITIONING:
                self._on_path_failed(event)
            case events.RepairLate() if self.repairing and self._begins_here(self._found):
                self._on_repaired(self._found)
            case events.MotionDone() | events.RepairLate() if self.repairing:
                self._unrepaired(_LATE)
            case events.MotionDone() if state in MOVING:
                self._on_motion_done()
            case events.MotionFailed() if state in MOVING:
                self._on_motion_failed(event)
            case events.ObjectMoved() if state in (State.POSITIONING, State.APPROACH):
                self._on_moved(event.message)

    def _on_goal(self, event: events.GoalGiven, left: PushSegment | None) -> None:
        if self.busy:
            self._abort(JobError.PREEMPTED, "a new goal replaces this one")
            left, self._left = self._left, None
        self.goal, self.busy, self.error = event.goal, True, JobError.NONE
        self._execute = self.settings.auto_execute and not event.plan_only
        self.replans = self.pushes = 0
        self._tried = Attempts(self.settings)
        same, self._item = event.item == self._item, event.item
        why = "planning for a new goal"
        if left is not None and same and self._go_on(left, why, event.goal):
            return
        if left is not None:
            self._say(commands.Stop())
        self._plan(why)

    def _go_on(self, push: PushSegment, why: str, nearer: Array | None = None) -> bool:
        """Go on with a push while a new plan is made, if that is possible, and if it brings the
        object nearer to a goal, if one is given."""
        if push.turns or not self._execute or self.at_goal(self.goal).there:
            return False
        beginning = self.beginning(push, nearer)
        if beginning is None:
            return False
        assert self.goal is not None
        self._repair, self._blocked, self._found = push, False, []
        self.segments, self.index = [beginning], 0
        self._enter(State.PUSHING, f"pushing on meanwhile; {why}")
        self._say(commands.Repair(self.goal, beginning))
        return True

    def _unrepaired(self, why: str) -> None:
        """Back off and plan. A new goal whose plan did not come in time has had no setback yet."""
        if self._blocked:
            self._retreat(why)
        else:
            self.segments, self.index = [], 0
            self._back_off(f"planning for a new goal: {why}")

    def _begins_here(self, plan: list[PushSegment]) -> bool:
        """Whether a plan begins on the side of the push under way, which is longer with it.

        Where the robot has to back off anyway, a plan is not worth taking before it is complete.
        """
        return bool(plan) and plan[0].length > self.segment.length + _LONGER

    def _on_repaired(self, plan: list[PushSegment]) -> None:
        """The plan begins with the push under way."""
        self.segments, self.index, self._repair = plan, 0, None
        if self._blocked:
            self.replans += 1
            self._tried.setbacks += 1
        self._push(going_on=True)

    def _on_execute(self) -> None:
        if self.plan_ready:
            self._execute = True
            why = "execution was commanded"
            if self.touching():
                self._back_off(why)
            else:
                self._position(why)

    def _on_motion_failed(self, event: events.MotionFailed) -> None:
        message = event.message
        if event.lost:
            self._lost(message)
        elif self.state is State.PUSHING or self.state is State.APPROACH:
            self._retreat(message)
        elif self.state is State.POSITIONING:
            self._retry(message, move_away=False)
        elif self._backing_off:
            self._backed_off(f"could not back off: {message}")
        else:
            # Not even the way back is free: plan from here as it stands.
            self._replan(f"could not back off: {message}", backed_off=True)

    def _lost(self, message: str) -> None:
        """The controller is gone; whoever takes its place starts with the step that was cut off."""
        self._tried.losses += 1
        if self._tried.losses > self.settings.max_losses:
            self._say(commands.Stop())
            self._finish(JobError.NODE_LOST, message)
        elif self.state is State.POSITIONING:
            self._position(message)
        elif self._backing_off:
            self._say(commands.FollowRetreat())
        else:
            self._retreat(self._recovering or message)

    def _on_moved(self, message: str) -> None:
        """Somebody moved the object: the job begins anew from there."""
        self._tried.moves += 1
        if self._tried.moves > self.settings.max_replans:
            text = f"{message}; it was moved {self._tried.moves} times before a push was completed"
            self._give_up(JobError.OBJECT_MOVED, text)
            return
        self._say(commands.Stop())
        self._tried.renew()
        self._plan_anew(message)

    def _on_map(self, problem: str) -> None:
        self._found = []  # made on the map before
        if problem:
            self._on_blocked(problem)
        elif self.state is State.POSITIONING:  # the way there may lead through a wall now
            self._say(commands.Stop())
            self._position("the map has changed")

    def _on_others(self, problem: str) -> None:
        """New plans because of others are bounded like waits for them, not like setbacks."""
        if self.busy and not self._tried.may_wait():
            self._give_up(JobError.EXECUTION_FAILED, problem)
        else:
            self._tried.renew()
            self._on_blocked(problem)

    def _on_blocked(self, problem: str) -> None:
        """What is left of the plan cannot be done; one that is being made is the planner's."""
        if self.plan_ready:
            self._plan(f"making a new plan: {problem}")
        elif self.state is State.DETACHING:
            self._recovering, self._backing_off = self._recovering or problem, ""
        elif self.state is State.PUSHING:
            self._repair_blocked(problem)
        elif self.state in MOVING:
            self._say(commands.Stop())
            self._replan(problem)

    def _repair_blocked(self, problem: str) -> None:
        """A push under way, or a later one, is blocked."""
        bound = self._tried.setbacks >= self.settings.max_replans
        if (
            self.repairing
            or bound
            or not self._go_on(self.segment, f"making a new plan: {problem}")
        ):
            self._retreat(problem)
        else:
            self._blocked = True

    def _abort(self, code: JobError, message: str) -> None:
        """End the job; a push goes on if another goal replaces this one."""
        if code is JobError.PREEMPTED and self.state is State.PUSHING and self._execute:
            self._left = self._repair or self.segment
        else:
            self._halt()
        if self.busy or self.segments:
            self._finish(code, message, going_on=self._left is not None)
