"""What people are told of a job: events while it runs, and how it ended."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.jobs import JobError


@dataclass(frozen=True)
class JobEvent:
    """Something to tell of a job.

    kind: "state" for a step of the job, "progress" for the distance every now and then, "silent"
    when the node that owns the job is missed, "returned" when it is there again.
    stamp: [s] of the newest poses. distance: [m] of the object to its goal, None when not known.
    """

    kind: str
    team: str
    stamp: float
    state: str
    reason: str
    distance: float | None


@dataclass(frozen=True)
class JobResult:
    """How a job ended.

    code: None when it did not end while somebody waited. plan_ready: it waits to be executed.
    position_error [m], orientation_error [rad]: of the object, as it was seen last; nan unseen.
    duration: [s] of pose time since the goal was sent. bag: what was recorded, if it was.
    """

    code: JobError | None
    reason: str
    goal: tuple[float, float, float]
    position_error: float
    orientation_error: float
    duration: float
    replans: int = 0
    refused: bool = False
    plan_ready: bool = False
    bag: Path | None = None
    team: str = ""

    @property
    def success(self) -> bool:
        """Whether the object is where it was to be brought, as the owner of the job judges."""
        return self.code is JobError.NONE and not self.plan_ready

    def __str__(self) -> str:
        name = "no end" if self.code is None else self.code.name
        errors = f"{1e3 * self.position_error:.1f} mm, {self.orientation_error:.3f} rad"
        where = f"team {self.team}: " if self.team else ""
        return f"{where}{name}: {self.reason} ({errors} from the goal, {self.duration:.1f} s)"


def errors_of(goal: Array | tuple[float, float, float], pose: Array | None) -> tuple[float, float]:
    """Position [m] and orientation [rad] error of a pose ``(3,)``; nan where it is not known."""
    if pose is None:
        return float("nan"), float("nan")
    local = se2.between(np.asarray(goal, dtype=np.float64), pose)
    return float(np.hypot(local[0], local[1])), abs(float(local[2]))


def result_of(
    state: Any,
    goal: tuple[float, float, float],
    pose: Array | None,
    duration: float,
    team: str = "",
    bag: Path | None = None,
) -> JobResult:
    """The result that a ``push_msgs/JobState`` of an ended job tells."""
    position, orientation = errors_of(goal, pose)
    return JobResult(
        code=JobError(int(state.error_code)),
        reason=str(state.reason),
        goal=goal,
        position_error=position,
        orientation_error=orientation,
        duration=duration,
        replans=int(state.replans),
        plan_ready=bool(state.plan_ready),
        bag=bag,
        team=team,
    )
