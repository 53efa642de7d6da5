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
from push_model.settings import bounded, settings


class State(IntEnum):
    """S1-S6 of Fig. 2.24b."""

    IDLE = 1
    PLANNING = 2
    POSITIONING = 3
    APPROACH = 4
    PUSHING = 5
    DETACHING = 6


@settings
class SupervisorSettings:
    """Tolerances, patience and speeds of a job."""

    auto_execute: bool = True
    position_tolerance: float = bounded(
        0.012, low=1e-3, high=1.0, doc="[m] of the object at the goal"
    )
    orientation_tolerance: float = bounded(0.06, low=1e-3, high=3.2, doc="[rad] at the goal")
    displacement: float = bounded(
        0.02, low=1e-3, high=1.0, doc="[m] off its planned start at which a plan is dropped"
    )
    displacement_turn: float = bounded(0.12, low=1e-3, high=3.2, doc="[rad] likewise")
    max_replans: int = bounded(4, low=0, high=100, doc="new plans within one job")
    max_retries: int = bounded(2, low=0, high=100, doc="further tries to position in a row")
    max_losses: int = bounded(
        40, low=0, high=10000, doc="times in a row that the controller may be gone"
    )
    max_preemptive: int = bounded(
        8, low=0, high=100, doc="pre-emptive pushes offered to the planner"
    )
    approach_speed: float = bounded(0.04, low=1e-3, high=2.0, doc="[m/s] to contact and back")
    acceleration: float = bounded(0.1, low=1e-3, high=10.0, doc="[m/s^2] of those motions")
    detach_distance: float = bounded(0.06, low=5e-3, high=2.0, doc="[m] backed off after a push")
    obstacle_margin: float = bounded(0.008, low=0.0, high=1.0, doc="[m] robot body to obstacles")
    heartbeat_timeout: float = bounded(
        0.25, low=0.05, high=10.0, doc="[s] without the supervisor until a robot stops"
    )
    controller_timeout: float = bounded(
        1.0, low=0.2, high=60.0, doc="[s] without a sign of the controller until it counts as lost"
    )
    node_timeout: float = bounded(
        20.0, low=0.5, high=600.0, doc="[s] wall time to wait for a lost node to return"
    )
    answer_timeout: float = bounded(
        10.0, low=0.5, high=600.0, doc="[s] wall time without a sign of the planner: ask again"
    )
    pose_timeout: float = bounded(
        5.0, low=0.2, high=60.0, doc="[s] wall time without poses until they count as lost"
    )


class Event(IntEnum):
    """What can happen to the machine. The payload is in the keyword arguments of ``handle``."""

    GOAL = 1  # goal, plan_only
    EXECUTE = 2
    CANCEL = 3
    PLANNED = 4  # segments
    PLAN_FAILED = 5  # code, message, retry: whether another start could help
    OFFERS = 6  # segments: pre-emptive pushes
    PATH = 7  # trajectory
    PATH_FAILED = 8  # message
    MOTION_DONE = 9
    MOTION_FAILED = 10  # message, lost: whether the controller itself is gone
    DISPLACED = 11  # message
    CLOCK_RESET = 12
    ABORT = 13  # code, message: end the job for a reason of the owner's


class Command(IntEnum):
    """What the machine asks of its owner. The payload comes with it."""

    PLAN = 1  # start: None for the object's pose now; goal
    OFFER = 2  # pre-emptive pushes, goal
    CANCEL_PLAN = 3
    PATH = 4  # segment
    FOLLOW_PATH = 5  # trajectory
    FOLLOW_APPROACH = 6  # segment
    FOLLOW_PUSH = 7  # segment
    FOLLOW_RETREAT = 8
    STOP = 9
    FINISH = 10  # code, message


Handler = Callable[..., None]


@dataclass
class Machine:
    """One job at a time.

    at_goal: tells whether the object is within tolerance of a goal now, and describes the error.
    pushes, replans: of this job so far.
    """

    settings: SupervisorSettings
    at_goal: Callable[[Any], tuple[bool, str]]
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
        self._offers: list[Any] = []
        self._offers_asked = False
        self._prefix: list[Any] = []
        self._last_failure = "no plan was found"
        self._retries = 0
        self._losses = 0
        self._recovering = ""
        self._execute = False
        self._table: dict[Event, tuple[frozenset[State], Handler]] = {
            Event.GOAL: (frozenset(State), self._on_goal),
            Event.EXECUTE: (frozenset({State.IDLE}), self._on_execute),
            Event.CANCEL: (frozenset(State), self._on_cancel),
            Event.PLANNED: (frozenset({State.PLANNING}), self._on_planned),
            Event.PLAN_FAILED: (frozenset({State.PLANNING}), self._on_plan_failed),
            Event.OFFERS: (frozenset({State.PLANNING}), self._on_offers),
            Event.PATH: (frozenset({State.POSITIONING}), self._on_path),
            Event.PATH_FAILED: (frozenset({State.POSITIONING}), self._on_path_failed),
            Event.MOTION_DONE: (_MOVING, self._on_motion_done),
            Event.MOTION_FAILED: (_MOVING, self._on_motion_failed),
            Event.DISPLACED: (frozenset({State.POSITIONING, State.APPROACH}), self._on_displaced),
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
        self.replans = self.pushes = self._retries = self._losses = 0
        self._plan("planning for a new goal")

    def _plan(self, reason: str) -> None:
        self.segments, self.index = [], 0
        self._prefix, self._offers, self._offers_asked = [], [], False
        self._recovering = ""
        there, error = self.at_goal(self.goal)
        if there:
            self._finish(JobError.NONE, f"the object is at the goal: {error}")
            return
        self._enter(State.PLANNING, reason)
        self._say(Command.PLAN, start=None, goal=self.goal)

    def _on_planned(self, segments: list[Any]) -> None:
        self.segments = [*self._prefix, *segments]
        self.index = 0
        if not self._execute:
            self._enter(State.IDLE, "a plan is ready; waiting for the execute command")
            return
        self._position("a plan was found")

    def _on_plan_failed(self, code: JobError, message: str, retry: bool) -> None:
        self._last_failure = self._last_failure if self._prefix else message
        if not retry:
            self._finish(code, message)
        elif not self._offers_asked:
            self._offers_asked = True
            self._enter(State.PLANNING, f"{message}; looking for a pre-emptive push")
            self._say(Command.OFFER, goal=self.goal)
        else:
            self._next_offer()

    def _on_offers(self, segments: list[Any]) -> None:
        if self._offers_asked and not self._offers:
            self._offers = list(segments)[: self.settings.max_preemptive]
            self._next_offer()

    def _next_offer(self) -> None:
        if not self._offers:
            self._finish(JobError.PLANNING_FAILED, self._last_failure)
            return
        offer = self._offers.pop(0)
        self._prefix = [offer]
        self._enter(State.PLANNING, "planning from the end of a pre-emptive push")
        self._say(Command.PLAN, start=offer, goal=self.goal)

    def _on_execute(self) -> None:
        if self.plan_ready:
            self._execute = True
            self._position("execution was commanded")

    def _position(self, reason: str) -> None:
        self._enter(State.POSITIONING, reason)
        self._say(Command.PATH, segment=self.segment)

    def _on_path(self, trajectory: Any) -> None:
        self._enter(State.POSITIONING, f"going to side {self.segment.side}")
        self._say(Command.FOLLOW_PATH, trajectory=trajectory)

    def _on_path_failed(self, message: str) -> None:
        self._retry(f"no way to side {self.segment.side}: {message}", move_away=True)

    def _retry(self, message: str, move_away: bool) -> None:
        """Another try at positioning; the robot first backs off when that may help."""
        self._retries += 1
        if self._retries > self.settings.max_retries:
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
            self._replan(self._recovering)
            return
        self.index += 1
        if self.index < len(self.segments):
            self._position("on to the next side")
            return
        there, error = self.at_goal(self.goal)
        if there:
            self._finish(JobError.NONE, f"the goal is reached: {error}")
        else:
            self._replan(f"the object is off its goal: {error}", JobError.OFF_TARGET)

    def _replan(self, why: str, code: JobError = JobError.EXECUTION_FAILED) -> None:
        self.replans += 1
        if self.replans > self.settings.max_replans:
            self._say(Command.STOP)
            self._finish(code, f"{why}; gave up after {self.replans - 1} new plans")
        else:
            self._plan(f"planning anew: {why}")

    def _on_motion_failed(self, message: str, lost: bool = False) -> None:
        if lost:
            self._lost(message)
        elif self.state is State.PUSHING or self.state is State.APPROACH:
            self._retreat(message)
        elif self.state is State.POSITIONING:
            self._retry(message, move_away=False)
        else:
            # Not even the way back is free: plan from here as it stands.
            self._replan(f"could not back off: {message}")

    def _lost(self, message: str) -> None:
        """The controller is gone; whoever takes its place starts with the step that was cut off."""
        self._losses += 1
        if self._losses > self.settings.max_losses:
            self._say(Command.STOP)
            self._finish(JobError.NODE_LOST, message)
        elif self.state is State.POSITIONING:
            self._position(message)
        else:
            self._retreat(self._recovering or message)

    def _on_displaced(self, message: str) -> None:
        self._say(Command.STOP)
        self._replan(message)

    def _on_cancel(self) -> None:
        self._on_abort(JobError.CANCELED, "canceled")

    def _on_clock_reset(self) -> None:
        self._on_abort(JobError.CLOCK_RESET, "the clock went back")

    def _on_abort(self, code: JobError, message: str) -> None:
        self._halt()
        if self.busy or self.segments:
            self._finish(code, message)


_MOVING = frozenset({State.POSITIONING, State.APPROACH, State.PUSHING, State.DETACHING})
