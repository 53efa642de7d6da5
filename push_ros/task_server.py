"""An action by which a client asks a method's node for a task, beside ``move_object``."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from push_job.method import Task
from push_job.report import Status
from push_model.jobs import GoalRefused, JobError
from push_ros.actions import GoalServer
from push_ros.validation import InvalidMessage


@dataclass(frozen=True)
class TaskAction:
    """An action type and how it becomes a task.

    name: of the action. parse: the task of a request; raises InvalidMessage or GoalRefused.
    result: of the fields error_code, error_msg, position_error, orientation_error, and the status
    that the task ended with. feedback: of the status and the distance [m] to the target.
    """

    action: Any
    name: str
    parse: Callable[[Any], Task]
    result: Callable[[dict[str, Any], Status], Any]
    feedback: Callable[[Status, float], Any]


class TaskHost(Protocol):
    """The node that works on tasks."""

    def consider_task(self, task: Task, answer: Callable[[GoalRefused | None], None]) -> None:
        """Answer, now or later, with why a task is refused, with None where it can be worked on."""
        ...

    def take_task(self, task: Task) -> None:
        """Begin a task; none is under way."""
        ...

    def end_job(self, code: JobError, message: str) -> None:
        """End the task under way."""
        ...


class TaskServer:
    """Serves one ``TaskAction``."""

    def __init__(
        self,
        node: Any,
        name: str,
        spec: TaskAction,
        host: TaskHost,
        refused: Callable[[str, str], None],
    ) -> None:
        """name: full name of the action. refused: told the action's name and why, of requests that
        make no sense."""
        self._spec, self._host, self._refused = spec, host, refused
        self._server = GoalServer(
            node,
            spec.action,
            name,
            check=lambda request: None,
            consider=self._consider,
            start=lambda request: host.take_task(spec.parse(request)),
            cancel=lambda: host.end_job(JobError.CANCELED, "canceled"),
            preempt=lambda request: host.end_job(
                JobError.PREEMPTED, f"a new request on {spec.name} replaces this task"
            ),
        )

    def feedback(self, status: Status, away: float) -> None:
        """To the client that waits, if there is one."""
        if self._server.active:
            self._server.feedback(self._spec.feedback(status, away))

    def finish(self, common: dict[str, Any], status: Status) -> None:
        """Tell the client that waits, if there is one, how the task ended."""
        if self._server.active:
            success = common["error_code"] == int(JobError.NONE)
            self._server.finish(self._spec.result(common, status), success=success)

    def _consider(self, request: Any, answer: Callable[[Any], None]) -> None:
        """Answer with the result for a task that cannot be, with None where it can."""

        def judged(refusal: GoalRefused | None) -> None:
            answer(None if refusal is None else self._answer(refusal.code, str(refusal)))

        try:
            task = self._spec.parse(request)
        except InvalidMessage as error:
            self._refused(self._spec.name, str(error))
            judged(GoalRefused(JobError.INVALID_GOAL, str(error)))
        except GoalRefused as refusal:
            judged(refusal)
        else:
            self._host.consider_task(task, judged)

    def _answer(self, code: JobError, text: str) -> Any:
        return self._spec.action.Result(error_code=int(code), error_msg=text)
