"""What can happen to the state machine of section 2.5: a kind of event each."""

from dataclasses import dataclass

from push_model.arrays import Array
from push_model.jobs import JobError
from push_model.push_segment import PushSegment
from push_model.trajectory import Trajectory


@dataclass(frozen=True)
class GoalGiven:
    """goal: ``(3,)`` pose of the object; plan_only: wait for the execute command; item: name of the
    object."""

    goal: Array
    plan_only: bool = False
    item: str = ""


@dataclass(frozen=True)
class ExecuteCommanded:
    """The plan that waits may be carried out."""


@dataclass(frozen=True)
class CancelCommanded:
    """The job is no longer wanted."""


@dataclass(frozen=True)
class PlanFound:
    """segments: the pushes, in order. improving: whether the planner goes on to improve it."""

    segments: tuple[PushSegment, ...]
    improving: bool = False


@dataclass(frozen=True)
class PlanFailed:
    """retry: a pre-emptive push could help; crowded: other bodies may stand in the way."""

    code: JobError
    message: str
    retry: bool = False
    crowded: bool = False


@dataclass(frozen=True)
class PathFound:
    """trajectory: the robot's way to the pushed side."""

    trajectory: Trajectory


@dataclass(frozen=True)
class PathFailed:
    """crowded: other bodies may stand in the way."""

    message: str
    crowded: bool = False


@dataclass(frozen=True)
class MotionDone:
    """The controller has reached the end of the trajectory under way."""


@dataclass(frozen=True)
class MotionFailed:
    """lost: the controller itself is gone."""

    message: str
    lost: bool = False


@dataclass(frozen=True)
class ObjectMoved:
    """Somebody else moved the object while the robot was on its way to it."""

    message: str


@dataclass(frozen=True)
class MapChanged:
    """problem: why what is left of the plan cannot be done on the new map; empty when it can."""

    problem: str = ""


@dataclass(frozen=True)
class WayBlocked:
    """Another body stands on the way of the pushes that are still to do."""

    message: str


@dataclass(frozen=True)
class PushLeft:
    """A push goes on for a job that another goal was to follow, and none has."""


@dataclass(frozen=True)
class RepairLate:
    """The robot comes to where a new plan is to begin, and it is not complete yet."""


@dataclass(frozen=True)
class ClockReset:
    """The clock of the poses went back."""


@dataclass(frozen=True)
class JobAborted:
    """The owner of the machine ends the job for a reason of its own."""

    code: JobError
    message: str


Event = (
    GoalGiven
    | ExecuteCommanded
    | CancelCommanded
    | PlanFound
    | PlanFailed
    | PathFound
    | PathFailed
    | MotionDone
    | MotionFailed
    | ObjectMoved
    | MapChanged
    | WayBlocked
    | PushLeft
    | RepairLate
    | ClockReset
    | JobAborted
)
