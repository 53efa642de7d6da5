"""The finite state machine of section 2.5. Events in, commands out; no ROS, no clock, no geometry.

States S1-S6 are those of Fig. 2.24. Beyond the thesis: a push that goes wrong is followed by a
retreat and a new plan from where the object is, a plan is dropped when the object was moved by
somebody else, and every job ends with a code.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

from push_model.jobs import JobError
from push_supervisor.settings import SupervisorSettings


class State(IntEnum):
    """S1-S6 of Fig. 2.24b."""

    IDLE = 1
    PLANNING = 2
    POSITIONING = 3
    APPROACH = 4
    PUSHING = 5
    DETACHING = 6


class Event(IntEnum):
    """What can happen to the machine. The payload is in the keyword arguments of ``handle``."""

    GOAL = 1  # goal, plan_only
    EXECUTE = 2
    CANCEL = 3
    PLANNED = 4  # segments
    PLAN_FAILED = 5  # code, message, retry: whether a pre-emptive push could help, crowded
    PATH = 6  # trajectory
    PATH_FAILED = 7  # message, crowded: whether other bodies may stand in the way
    MOTION_DONE = 8
    MOTION_FAILED = 9  # message, lost: whether the controller itself is gone
    DISPLACED = 10  # message
    NEW_MAP = 11  # problem: why what is left of the plan cannot be done on it, or empty
    CLOCK_RESET = 12
    ABORT = 13  # code, message: end the job for a reason of the owner's


class Command(IntEnum):
    """What the machine asks of its owner. The payload comes with it."""

    PLAN = 1  # goal, preemptive: a push that leads away first, later: wait a while before
    CANCEL_PLAN = 2
    PATH = 3  # segment, later
    FOLLOW_PATH = 4  # trajectory
    FOLLOW_APPROACH = 5  # segment
    FOLLOW_PUSH = 6  # segment
    FOLLOW_RETREAT = 7
    STOP = 8
    FINISH = 9  # code, message


Handler = Callable[..., None]


@dataclass
class Machine:
    """One job at a time.

    at_goal: tells whether the object is within tolerance of a goal now, and describes the error.
    touching: tells whether the robot may be touching the object now, whoever left it there.
    pushes, replans: of this job so far.
    """

    settings: SupervisorSettings
    at_goal: Callable[[Any], tuple[bool, str]]
    touching: Callable[[], bool]
    state: State = State.IDLE
    reason: str = "waiting for a goal"
    goal: Any = None
    segments: list[Any] = field(default_factory=list)
    index: int = 0
    replans: int = 0
    pushes: int = 0
    error: JobError = JobError.NONE
    busy: bool = False

    def __post_init__(self) -> None:
        self._out: list[tuple[Command, dict[str, Any]]] = []
        self._preemptive = False  # what the planner was asked for
        self._retries = 0
        self._losses = 0
        self._waits = 0
        self._recovering = ""  # why a new plan follows the retreat under way
        self._backing_off = ""  # why a plan, no new one, follows it
        self._execute = False
        self._table: dict[Event, tuple[frozenset[State], Handler]] = {
            Event.GOAL: (frozenset(State), self._on_goal),
            Event.EXECUTE: (frozenset({State.IDLE}), self._on_execute),
            Event.CANCEL: (frozenset(State), self._on_cancel),
            Event.PLANNED: (frozenset({State.PLANNING}), self._on_planned),
            Event.PLAN_FAILED: (frozenset({State.PLANNING}), self._on_plan_failed),
            Event.PATH: (frozenset({State.POSITIONING}), self._on_path),
            Event.PATH_FAILED: (frozenset({State.POSITIONING}), self._on_path_failed),
            Event.MOTION_DONE: (_MOVING, self._on_motion_done),
            Event.MOTION_FAILED: (_MOVING, self._on_motion_failed),
            Event.DISPLACED: (frozenset({State.POSITIONING, State.APPROACH}), self._on_displaced),
            Event.NEW_MAP: (frozenset(State), self._on_new_map),
            Event.CLOCK_RESET: (frozenset(State), self._on_clock_reset),
            Event.ABORT: (frozenset(State), self._on_abort),
        }

    @property
    def plan_ready(self) -> bool:
        """Whether a plan waits for the execute command."""
        return self.state is State.IDLE and bool(self.segments)

    @property
    def segment(self) -> Any:
        """The push under way or next."""
        return self.segments[self.index]

    @property
    def remaining(self) -> list[Any]:
        """The pushes that are not done yet."""
        done = self.state is State.DETACHING and not self._backing_off
        return self.segments[self.index + done :]

    def handle(self, event: Event, **payload: Any) -> list[tuple[Command, dict[str, Any]]]:
        """React to an event; one that means nothing in this state changes nothing."""
        states, handler = self._table[event]
        self._out = []
        if self.state in states:
            handler(**payload)
        return self._out

    def _say(self, command: Command, **payload: Any) -> None:
        self._out.append((command, payload))

    def _enter(self, state: State, reason: str) -> None:
        self.state, self.reason = state, reason

    def _finish(self, code: JobError, message: str) -> None:
        self.error = code
        self.busy = False
        self.segments, self.index = [], 0
        self._enter(State.IDLE, message)
        self._say(Command.FINISH, code=code, message=message)

    def _halt(self) -> None:
        if self.state is State.PLANNING:
            self._say(Command.CANCEL_PLAN)
        elif self.state is not State.IDLE:
            self._say(Command.STOP)

    def _on_goal(self, goal: Any, plan_only: bool = False) -> None:
        self._halt()
        if self.busy:
            self._finish(JobError.PREEMPTED, "a new goal replaces this one")
        self.goal, self.busy, self.error = goal, True, JobError.NONE
        self._execute = self.settings.auto_execute and not plan_only
        self.replans = self.pushes = self._retries = self._losses = self._waits = 0
        self._plan("planning for a new goal")

    def _plan(self, reason: str, backed_off: bool = False) -> None:
        """Ask for a plan from where the object is.

        A robot at the object would be in the way of its own plan: it backs off before, unless it
        has just done so, or could not, or is not to move yet.
        """
        self.segments, self.index = [], 0
        self._recovering = self._backing_off = ""
        there, error = self.at_goal(self.goal)
        if there:
            self._finish(JobError.NONE, f"the object is at the goal: {error}")
        elif self._execute and not backed_off and self.touching():
            self._back_off(reason)
        else:
            self._ask_plan(reason)

    def _back_off(self, reason: str) -> None:
        """Away from the object before anything else, for a reason to plan or to position."""
        self._backing_off = reason
        self._enter(State.DETACHING, f"backing off first; {reason}")
        self._say(Command.FOLLOW_RETREAT)

    def _backed_off(self, failure: str = "") -> None:
        """Go on with what the robot backed off for, also when it could not."""
        reason = "; ".join(filter(None, [self._backing_off, failure]))
        self._backing_off = ""
        if self.segments:
            self._position(reason)
        else:
            self._plan(reason, backed_off=True)

    def _ask_plan(self, reason: str, preemptive: bool = False, later: bool = False) -> None:
        self._preemptive = preemptive
        self._enter(State.PLANNING, reason)
        self._say(Command.PLAN, goal=self.goal, preemptive=preemptive, later=later)

    def _on_planned(self, segments: list[Any]) -> None:
        self.segments, self.index = list(segments), 0
        if not self._execute:
            self._enter(State.IDLE, "a plan is ready; waiting for the execute command")
            return
        self._position("a plan was found")

    def _on_plan_failed(
        self, code: JobError, message: str, retry: bool = False, crowded: bool = False
    ) -> None:
        if retry and not self._preemptive:
            self._ask_plan(f"{message}; looking for a pre-emptive push", preemptive=True)
        elif crowded and self._may_wait():
            self._ask_plan(f"{message}; waiting for others to make way", later=True)
        else:
            self._finish(code, message)

    def _may_wait(self) -> bool:
        """Count another wait for other bodies; False when there have been enough."""
        self._waits += 1
        return self._waits <= self.settings.max_waits

    def _on_execute(self) -> None:
        if self.plan_ready:
            self._execute = True
            why = "execution was commanded"
            if self.touching():
                self._back_off(why)
            else:
                self._position(why)

    def _position(self, reason: str, later: bool = False) -> None:
        self._enter(State.POSITIONING, reason)
        self._say(Command.PATH, segment=self.segment, later=later)

    def _on_path(self, trajectory: Any) -> None:
        self._enter(State.POSITIONING, f"going to side {self.segment.side}")
        self._say(Command.FOLLOW_PATH, trajectory=trajectory)

    def _on_path_failed(self, message: str, crowded: bool = False) -> None:
        why = f"no way to side {self.segment.side}: {message}"
        self._retry(why, move_away=True, crowded=crowded)

    def _retry(self, message: str, move_away: bool, crowded: bool = False) -> None:
        """Another try at positioning; the robot first backs off when that may help."""
        self._retries += 1
        if self._retries > self.settings.max_retries and crowded and self._may_wait():
            self._position(f"{message}; waiting for others to make way", later=True)
        elif self._retries > self.settings.max_retries:
            self._say(Command.STOP)
            self._finish(JobError.POSITIONING_FAILED, message)
        elif move_away:
            self._retreat(message)
        else:
            self._position(message)

    def _retreat(self, why: str) -> None:
        self._recovering = why
        self._enter(State.DETACHING, why)
        self._say(Command.FOLLOW_RETREAT)

    def _on_motion_done(self) -> None:
        self._losses = 0
        if self.state is State.POSITIONING:
            self._enter(State.APPROACH, f"approaching side {self.segment.side}")
            self._say(Command.FOLLOW_APPROACH, segment=self.segment)
        elif self.state is State.APPROACH:
            self._retries = 0
            self._push()
        elif self.state is State.PUSHING:
            self.pushes += 1
            self._waits = 0
            following = self.index + 1
            if (
                following < len(self.segments)
                and self.segments[following].side == self.segment.side
            ):
                self.index = following
                self._push()
            else:
                self._enter(State.DETACHING, f"push {following} of {len(self.segments)} is done")
                self._say(Command.FOLLOW_RETREAT)
        else:
            self._detached()

    def _push(self) -> None:
        self._enter(
            State.PUSHING,
            f"push {self.index + 1} of {len(self.segments)} on side {self.segment.side}",
        )
        self._say(Command.FOLLOW_PUSH, segment=self.segment)

    def _detached(self) -> None:
        if self._recovering:
            self._replan(self._recovering, backed_off=True)
            return
        if self._backing_off:
            self._backed_off()
            return
        self.index += 1
        if self.index < len(self.segments):
            self._position("on to the next side")
            return
        there, error = self.at_goal(self.goal)
        if there:
            self._finish(JobError.NONE, f"the goal is reached: {error}")
        else:
            why = f"the object is off its goal: {error}"
            self._replan(why, JobError.OFF_TARGET, backed_off=True)

    def _replan(
        self, why: str, code: JobError = JobError.EXECUTION_FAILED, backed_off: bool = False
    ) -> None:
        self.replans += 1
        if self.replans > self.settings.max_replans:
            self._say(Command.STOP)
            self._finish(code, f"{why}; gave up after {self.replans - 1} new plans")
        else:
            self._plan(f"planning anew: {why}", backed_off)

    def _on_motion_failed(self, message: str, lost: bool = False) -> None:
        if lost:
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
        self._losses += 1
        if self._losses > self.settings.max_losses:
            self._say(Command.STOP)
            self._finish(JobError.NODE_LOST, message)
        elif self.state is State.POSITIONING:
            self._position(message)
        elif self._backing_off:
            self._say(Command.FOLLOW_RETREAT)
        else:
            self._retreat(self._recovering or message)

    def _on_displaced(self, message: str) -> None:
        self._say(Command.STOP)
        self._replan(message)

    def _on_new_map(self, problem: str) -> None:
        """A plan that is still being made is the planner's to begin anew."""
        if not problem:
            if self.state is State.POSITIONING:  # the way there may lead through a wall now
                self._say(Command.STOP)
                self._position("the map has changed")
        elif self.plan_ready:
            self._plan(f"planning anew: {problem}")
        elif self.state is State.DETACHING:
            self._recovering, self._backing_off = self._recovering or problem, ""
        elif self.state is State.PUSHING:
            self._retreat(problem)
        elif self.state in (State.POSITIONING, State.APPROACH):
            self._on_displaced(problem)

    def _on_cancel(self) -> None:
        self._on_abort(JobError.CANCELED, "canceled")

    def _on_clock_reset(self) -> None:
        self._on_abort(JobError.CLOCK_RESET, "the clock went back")

    def _on_abort(self, code: JobError, message: str) -> None:
        self._halt()
        if self.busy or self.segments:
            self._finish(code, message)


_MOVING = frozenset({State.POSITIONING, State.APPROACH, State.PUSHING, State.DETACHING})
