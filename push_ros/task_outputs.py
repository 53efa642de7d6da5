"""What a method's node tells of its task: the state of the job, feedback and results of actions."""

from collections.abc import Callable, Sequence

from push_job.report import Status
from push_model.jobs import JobError, JobPhase
from push_msgs.action import MoveObject
from push_ros.job_intake import JobIntake
from push_ros.task_server import TaskServer


class TaskOutputs:
    """Publishes a status when it differs from the one before.

    errors: [m], [rad] of the object to its target, inf where they are not known.
    """

    def __init__(
        self,
        intake: JobIntake,
        servers: Sequence[TaskServer],
        errors: Callable[[], tuple[float, float]],
        log: Callable[[str], object],
    ) -> None:
        self._intake, self._servers, self._errors, self._log = intake, servers, errors, log
        self._told: Status | None = None
        self._said = ""

    def tell(self, status: Status, stamp: float, robots: Sequence[str]) -> None:
        """Tell a status, if it is new, at a time [s] of the poses; and that the task has ended."""
        before = self._told
        if status == before:
            return
        self._told = status
        self._intake.publish(
            stamp,
            robots=list(robots),
            state=int(status.phase),
            state_name=status.name,
            reason=status.reason,
            error_code=int(status.code),
            progress=float(status.progress),
            step_index=int(status.index),
            step_count=int(status.count),
            replans=int(status.replans),
        )
        said = f"{status.name}: {status.reason}"
        if said != self._said:  # and not again for progress alone
            self._said = said
            self._log(said)
        if status.phase != JobPhase.IDLE:
            self._feedback(status)
        elif before is not None and before.phase != JobPhase.IDLE:
            self._finish(status)

    def _feedback(self, status: Status) -> None:
        away, _ = self._errors()
        told = MoveObject.Feedback(state=int(status.phase), state_name=status.name)
        told.push_index, told.push_count = int(status.index), int(status.count)
        told.distance_to_goal = away
        self._intake.feedback(told)
        for server in self._servers:
            server.feedback(status, away)

    def _finish(self, status: Status) -> None:
        away, turned = self._errors()
        common = {
            "error_code": int(status.code),
            "error_msg": "" if status.code == JobError.NONE else status.reason,
            "position_error": away,
            "orientation_error": turned,
        }
        for server in self._servers:
            server.finish(common, status)
        if self._intake.waited_for:
            done = {"pushes": int(status.pushes), "replans": int(status.replans)}
            self._intake.finish(MoveObject.Result(**done, **common))
