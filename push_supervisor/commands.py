"""What the state machine asks of its owner: a kind of command each."""

from dataclasses import dataclass

from push_model.arrays import Array
from push_model.jobs import JobError
from push_model.push_segment import PushSegment
from push_model.trajectory import Trajectory


@dataclass(frozen=True)
class MakePlan:
    """Plan from where the object is.

    preemptive: with a push first that leads away. later: after a wait, for others to make way.
    """

    goal: Array
    preemptive: bool = False
    later: bool = False


@dataclass(frozen=True)
class FindPath:
    """Find the robot's way to the side that a push begins at. later: after a wait."""

    segment: PushSegment
    later: bool = False


@dataclass(frozen=True)
class FollowPath:
    """Drive along a way."""

    trajectory: Trajectory


@dataclass(frozen=True)
class FollowApproach:
    """Drive to contact."""

    segment: PushSegment


@dataclass(frozen=True)
class FollowPush:
    """Push. going_on: the push begins like the one under way; go on where that one is."""

    segment: PushSegment
    going_on: bool = False


@dataclass(frozen=True)
class FollowTurn:
    """Push on a corner, so that the object turns."""

    segment: PushSegment


@dataclass(frozen=True)
class FollowRetreat:
    """Back off from the object."""


@dataclass(frozen=True)
class Repair:
    """Plan from the end of the push that is under way, while the robot goes on with it."""

    goal: Array
    segment: PushSegment


@dataclass(frozen=True)
class CancelRepair:
    """The plan that is made while the robot pushes is not wanted any more."""


@dataclass(frozen=True)
class CancelPlan:
    """No plan is wanted any more."""


@dataclass(frozen=True)
class Stop:
    """Stop the robot."""


@dataclass(frozen=True)
class Finish:
    """Tell whoever waits how the job ended. going_on: the robot goes on pushing for the next job,
    whose goal follows at once."""

    code: JobError
    message: str
    going_on: bool = False


Motion = FollowPath | FollowApproach | FollowPush | FollowTurn | FollowRetreat
"""Commands that a controller carries out."""

Question = MakePlan | FindPath | Motion
"""Commands that another node answers."""

Command = Question | Repair | CancelRepair | CancelPlan | Stop | Finish
