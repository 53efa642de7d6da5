"""The door of a method's node: tasks are judged before they are taken, in slices.

To judge a task may take half a second, e.g. to look for a way through a large room. A node goes on
with its other work meanwhile: ``go_on`` is called once for each frame of the pose stream and does a
few milliseconds of it. What is quickly known is answered at once.
"""

from collections.abc import Callable, Generator

from push_job.method import Task
from push_model.jobs import GoalRefused, JobError

Judge = Callable[[Task], Generator[int, None, None]]
"""Judges a task in slices: yields what each has cost, in microseconds of an idle machine, roughly;
raises GoalRefused."""
_BUDGET = 1500  # [microseconds] for each frame


class Door:
    """Judges one task at a time; one that comes meanwhile takes its place."""

    def __init__(self, judge: Judge) -> None:
        self._judge = judge
        self._answer: Callable[[GoalRefused | None], None] = lambda refusal: None
        self._work: Generator[int, None, None] | None = None

    @property
    def busy(self) -> bool:
        """Whether a task is being judged."""
        return self._work is not None

    def ask(self, task: Task, answer: Callable[[GoalRefused | None], None]) -> None:
        """Begin to judge a task; ``answer`` is called once, with why it is refused, or None."""
        self.drop(JobError.PREEMPTED, "a new goal replaces this one")
        self._work, self._answer = self._judge(task), answer
        self.go_on()

    def go_on(self) -> None:
        """Do one slice, if a task is being judged."""
        refusal, left = None, _BUDGET
        while self._work is not None and left > 0:
            try:
                left -= next(self._work)
                continue
            except StopIteration:
                pass
            except GoalRefused as error:
                refusal = error
            self._end(refusal)

    def drop(self, code: JobError, reason: str) -> None:
        """Refuse the task that is being judged, if there is one."""
        if self._work is not None:
            self._work.close()
            self._end(GoalRefused(code, reason))

    def _end(self, refusal: GoalRefused | None) -> None:
        self._work = None
        self._answer(refusal)
