"""The course of a job: Algorithm 4 of the thesis, and new plans where it does not lead to the goal.

States S1-S6 are those of Fig. 2.24. Beyond the thesis: a push that goes wrong is followed by a
retreat and a new plan from where the object is, and every job ends with a code. A job whose last
push has brought the object to its goal ends with this push: the robot stays at the object, and
backs off when the next job begins. If the object has arrived, but not close to its goal, a further
plan corrects the error; where that fails, the object has still arrived.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from push_model.arrays import Array
from push_model.jobs import JobError
from push_model.push_segment import PushSegment
from push_supervisor import commands, events
from push_supervisor.arrival import Arrival
from push_supervisor.attempts import Attempts
from push_supervisor.commands import Command
from push_supervisor.settings import SupervisorSettings
from push_supervisor.state import State


@dataclass
class Course:
    """One job at a time.

    at_goal: tells whether the object is at a goal now.
    touching: tells whether the robot may be touching the object now, whoever left it there.
    pushes, replans: of this job so far. New plans are bounded between one progress and the next: a
    push that leaves fewer to do than ever before, since the goal came or the object was moved.
    Moves of the object by others are bounded likewise between one completed push and the next.
    """

    settings: SupervisorSettings
    at_goal: Callable[[Array | None], Arrival]
    touching: Callable[[], bool]
    state: State = State.IDLE
    reason: str = "waiting for a goal"
    goal: Array | None = None
    segments: list[PushSegment] = field(default_factory=list)
    index: int = 0
    replans: int = 0
    pushes: int = 0
    error: JobError = JobError.NONE
    busy: bool = False

    def __post_init__(self) -> None:
        self._out: list[Command] = []
        self._preemptive = False  # what the planner was asked for
        self._tried = Attempts(self.settings)
        self._recovering = ""  # why a new plan follows the retreat under way
        self._backing_off = ""  # why a plan, no new one, follows it
        self._execute = False

    @property
    def plan_ready(self) -> bool:
        """Whether a plan waits for the execute command."""
        return self.state is State.IDLE and bool(self.segments)

    @property
    def segment(self) -> PushSegment:
        """The push under way or next."""
        return self.segments[self.index]

    @property
    def remaining(self) -> list[PushSegment]:
        """The pushes that are not done yet."""
        done = self.state is State.DETACHING and not self._backing_off
        return self.segments[self.index + done :]

    def _say(self, command: Command) -> None:
        self._out.append(command)

    def _enter(self, state: State, reason: str) -> None:
        self.state, self.reason = state, reason

    def _finish(self, code: JobError, message: str, going_on: bool = False) -> None:
        self.error = code
        self.busy = False
        self.segments, self.index = [], 0
        self._enter(State.IDLE, message)
        self._say(commands.Finish(code, message, going_on))

    def _halt(self) -> None:
        if self.state is State.PLANNING:
            self._say(commands.CancelPlan())
        elif self.state is not State.IDLE:
            self._say(commands.Stop())

    def _plan(self, reason: str, backed_off: bool = False) -> None:
        """Ask for a plan from where the object is.

        A robot at the object would be in the way of its own plan: it backs off before, unless it
        has just done so, or could not, or is not to move yet.
        """
        self.segments, self.index = [], 0
        self._recovering = self._backing_off = ""
        arrived = self.at_goal(self.goal)
        if arrived.there and (arrived.close or not self._tried.correcting):
            self._finish(JobError.NONE, f"the object is at the goal: {arrived.text}")
        elif self._execute and not backed_off and self.touching():
            self._back_off(reason)
        else:
            self._ask_plan(reason)

    def _back_off(self, reason: str) -> None:
        """Away from the object before anything else, for a reason to plan or to position."""
        self._backing_off = reason
        self._enter(State.DETACHING, f"backing off first; {reason}")
        self._say(commands.FollowRetreat())

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
        assert self.goal is not None
        self._say(commands.MakePlan(self.goal, preemptive, later))

    def _on_plan(self, event: events.PlanFound) -> None:
        self.segments, self.index = list(event.segments), 0
        if not self._execute:
            self._enter(State.IDLE, "a plan is ready; waiting for the execute command")
            return
        self._position("a plan was found")

    def _on_plan_failed(self, event: events.PlanFailed) -> None:
        message = event.message
        if event.retry and not self._preemptive and not self._tried.correcting:
            self._ask_plan(f"{message}; looking for a pre-emptive push", preemptive=True)
        elif event.crowded and self._tried.may_wait():
            self._ask_plan(f"{message}; waiting for other bodies to make way", later=True)
        else:
            self._fail(event.code, message)

    def _position(self, reason: str, later: bool = False) -> None:
        self._enter(State.POSITIONING, reason)
        self._say(commands.FindPath(self.segment, later))

    def _on_path(self, event: events.PathFound) -> None:
        self._enter(State.POSITIONING, f"going to side {self.segment.side}")
        self._say(commands.FollowPath(event.trajectory))

    def _on_path_failed(self, event: events.PathFailed) -> None:
        why = f"no path to side {self.segment.side}: {event.message}"
        self._retry(why, move_away=True, crowded=event.crowded)

    def _retry(self, message: str, move_away: bool, crowded: bool = False) -> None:
        """Another try at positioning; the robot first backs off when that may help."""
        self._tried.retries += 1
        if self._tried.retries > self.settings.max_retries and crowded and self._tried.may_wait():
            self._position(f"{message}; waiting for other bodies to make way", later=True)
        elif self._tried.retries > self.settings.max_retries:
            self._give_up(JobError.POSITIONING_FAILED, message)
        elif move_away:
            self._retreat(message)
        else:
            self._position(message)

    def _retreat(self, why: str) -> None:
        self._recovering = why
        self._enter(State.DETACHING, why)
        self._say(commands.FollowRetreat())

    def _on_motion_done(self) -> None:
        self._tried.losses = 0
        if self.state is State.POSITIONING:
            self._enter(State.APPROACH, f"approaching side {self.segment.side}")
            self._say(commands.FollowApproach(self.segment))
        elif self.state is State.APPROACH:
            self._tried.retries = 0
            self._push()
        elif self.state is State.PUSHING:
            self.pushes += 1
            following = self.index + 1
            self._tried.progress(len(self.segments) - following)
            rest = [] if self.segment.turns else self.segments[following:]
            if rest and rest[0].side == self.segment.side:
                self.index = following
                self._push()
            else:
                self._pushed(following)
        else:
            self._detached()

    def _pushed(self, done: int) -> None:
        """The last push on this side is done; the robot backs off only if something follows."""
        why = f"push {done} of {len(self.segments)} is done"
        if done == len(self.segments):
            arrived = self.at_goal(self.goal)
            if arrived.there and not self._tried.worth_correcting(arrived):
                self._say(commands.Stop())
                self._finish(JobError.NONE, f"the goal is reached: {arrived.text}")
                return
            why = f"{why}; the object is {arrived.text} from its goal"
        self._enter(State.DETACHING, why)
        self._say(commands.FollowRetreat())

    def _push(self, going_on: bool = False) -> None:
        where = "a corner" if self.segment.turns else f"side {self.segment.side}"
        number = f"{self.index + 1} of {len(self.segments)}"
        self._enter(State.PUSHING, f"push {number} on {where}")
        if self.segment.turns:
            self._say(commands.FollowTurn(self.segment))
        else:
            self._say(commands.FollowPush(self.segment, going_on))

    def _detached(self) -> None:
        if self._recovering:
            self._replan(self._recovering, backed_off=True)
            return
        if self._backing_off:
            self._backed_off()
            return
        if self.segment.turns:
            self._replan("a push on a corner has turned the object", backed_off=True)
            return
        self.index += 1
        if self.index < len(self.segments):
            self._position("driving to the next side")
            return
        arrived = self.at_goal(self.goal)
        if not arrived.there:
            why = f"the object is outside the tolerances of the goal: {arrived.text}"
            self._replan(why, JobError.OFF_TARGET, backed_off=True)
        elif self._tried.worth_correcting(arrived):
            self._tried.corrections += 1
            self._plan_anew(f"the object is {arrived.text} from its goal", backed_off=True)
        else:
            self._finish(JobError.NONE, f"the goal is reached: {arrived.text}")

    def _replan(
        self, why: str, code: JobError = JobError.EXECUTION_FAILED, backed_off: bool = False
    ) -> None:
        self._tried.setbacks += 1
        if self._tried.setbacks > self.settings.max_replans:
            self._give_up(
                code, f"{why}; gave up after {self._tried.setbacks - 1} new plans in a row"
            )
        else:
            self._plan_anew(why, backed_off)

    def _plan_anew(self, why: str, backed_off: bool = False) -> None:
        self.replans += 1
        self._plan(f"making a new plan: {why}", backed_off)

    def _give_up(self, code: JobError, message: str) -> None:
        self._say(commands.Stop())
        self._fail(code, message)

    def _fail(self, code: JobError, message: str) -> None:
        """The job ends for a reason; after a correction that failed, the object may be there."""
        arrived = self.at_goal(self.goal)
        if self._tried.correcting and arrived.there:
            text = f"the goal is reached: {arrived.text}; the error was not corrected: {message}"
            self._finish(JobError.NONE, text)
        else:
            self._finish(code, message)
