"""A task that is taken before there is a map, and begins when the map is there.

What the present method cannot tell is kept here, too: how a task ended that had no method, or one
that was made for an earlier map."""

from push_job.method import Task
from push_job.report import Status
from push_model.jobs import JobError, JobPhase

_WAITING = Status(int(JobPhase.PLANNING), JobPhase.PLANNING.name, "waiting for a map")


class EarlyTask:
    """At most one task, and how the last one ended. task: the one that waits."""

    def __init__(self) -> None:
        self.task: Task | None = None
        self._since = 0.0
        self._ended: Status | None = None

    @property
    def status(self) -> Status | None:
        """How it stands; None where there is nothing to say of it."""
        return _WAITING if self.task is not None else self._ended

    def wait(self, task: Task, now: float) -> None:
        """A task begins to wait, at a time [s]."""
        self.task, self._since, self._ended = task, now, None

    def waited(self, now: float) -> float:
        """[s] for which the task has waited; 0 where there is none."""
        return 0.0 if self.task is None else now - self._since

    def end(self, code: JobError, reason: str) -> None:
        """The task that waits ends without having begun."""
        self.task = None
        self._ended = Status(int(JobPhase.IDLE), JobPhase.IDLE.name, reason, int(code))

    def keep(self, status: Status) -> None:
        """A method that is replaced tells this last; it stands until the next task begins."""
        self._ended = status

    def forget(self) -> Task | None:
        """The task that has waited begins now, or another one does."""
        task, self.task, self._ended = self.task, None, None
        return task
