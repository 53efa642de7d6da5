"""What a method's node tells of its task."""

from dataclasses import replace
from unittest.mock import MagicMock

from push_job.report import Status
from push_model.jobs import JobPhase
from push_ros.task_outputs import TaskOutputs


def test_progress_is_published_and_not_logged_again():
    """A push over one metre wrote two thousand equal lines into the log."""
    intake, lines = MagicMock(), []
    outputs = TaskOutputs(intake, (), lambda: (0.1, 0.2), lines.append)
    status = Status(int(JobPhase.PUSHING), "PUSHING", "weaving")
    for k in range(50):
        outputs.tell(replace(status, progress=k / 50), 0.1 * k, ["r"])
        outputs.tell(replace(status, progress=k / 50), 0.1 * k, ["r"])
    assert lines == ["PUSHING: weaving"]
    published = [call.kwargs["progress"] for call in intake.publish.call_args_list]
    assert published == [k / 50 for k in range(50)]
    outputs.tell(replace(status, reason="done"), 9.0, ["r"])
    assert lines[1:] == ["PUSHING: done"]
