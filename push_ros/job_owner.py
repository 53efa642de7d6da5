"""What ``JobIntake`` asks of the node that does the job."""

from collections.abc import Collection
from typing import Protocol

from push_model.arrays import Array
from push_model.jobs import JobError
from push_ros.job_memory import KeptJob


class JobOwner(Protocol):
    """Who does the job."""

    @property
    def busy(self) -> bool:
        """Whether a job is under way."""
        ...

    @property
    def plan_ready(self) -> bool:
        """Whether a plan waits for the execute command."""
        ...

    def check_goal(self, goal: Array) -> None:
        """Raise GoalRefused unless the goal ``(3,)`` could be worked on."""
        ...

    def take_goal(self, goal: Array, plan_only: bool) -> None:
        """Begin a job; none is under way."""
        ...

    def end_job(self, code: JobError, message: str) -> None:
        """End the job under way, or drop the plan that waits; answer with ``JobIntake.finish``."""
        ...

    def execute(self) -> None:
        """Carry out the plan that waits."""
        ...

    def resume(self, job: KeptJob) -> None:
        """Begin anew with a job that was under way when this node was started again."""
        ...


class ObjectChoice(Protocol):
    """An owner whose jobs may be about other objects than its own."""

    @property
    def names_of_objects(self) -> Collection[str]:
        """All objects, also its own."""
        ...

    def check_other(self, item: str, goal: Array) -> None:
        """Raise GoalRefused unless a goal ``(3,)`` of another object could be worked on."""
        ...

    def use(self, item: str) -> None:
        """Work on this object from now on; no job is under way."""
        ...
