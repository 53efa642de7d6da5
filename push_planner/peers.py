"""The supervisor, which makes the moves of a rearrangement: a goal out, its end back."""

from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from push_model.arrays import Array
from push_model.jobs import JobError
from push_msgs.action import MoveObject
from push_msgs.msg import JobState
from push_planner.goal_messages import same_goal
from push_ros.actions import GoalClient
from push_ros.conversions import pose_stamped_to_ros
from push_ros.names import Names
from push_ros.qos import LATCHED
from push_ros.validation import InvalidMessage, stamped_pose


class Mover:
    """Has the supervisor bring one object to one goal at a time.

    ended: called once for each goal, with the code of its end and why; not after ``forget``.
    """

    def __init__(self, node: Node, names: Names, ended: Callable[[JobError, str], None]) -> None:
        self._ended = ended
        self._client = GoalClient(node, MoveObject, names.team("move_object"))
        self._asked: tuple[str, Array] | None = None
        self._begun = False  # whether the supervisor was seen to work on it
        self._gone = False  # whether it left the graph meanwhile
        node.create_subscription(JobState, names.team("job_state"), self._on_job, LATCHED)

    @property
    def ready(self) -> bool:
        """Whether the supervisor is there."""
        return bool(self._client.ready)

    def move(self, item: str, goal: Array, stamp: float) -> None:
        """Ask for an object at a goal ``(3,)``. stamp: [s] of the poses."""
        self._asked, self._begun, self._gone = (item, goal), False, False
        request = MoveObject.Goal(object=item, goal=pose_stamped_to_ros(goal, stamp))
        self._client.send(request, self._on_result)

    def forget(self) -> None:
        """Cancel what was asked for, if anything."""
        self._asked = None
        self._client.forget()

    def missed(self) -> None:
        """The supervisor is gone: if it comes back without a job, it has forgotten this one."""
        self._gone = True

    def _end(self, code: JobError, why: str) -> None:
        if self._asked is not None:
            self.forget()
            self._ended(code, why)

    def _on_result(self, result: Any) -> None:
        if result is None:
            self._end(JobError.NODE_LOST, "the supervisor rejected the goal")
        else:
            self._end(JobError(result.error_code), str(result.error_msg))

    def _on_job(self, state: JobState) -> None:
        """A supervisor that was restarted continues its job, but its answer is lost; or it has
        forgotten all jobs."""
        if self._asked is None:
            return
        if not state.goal.header.frame_id and (self._begun or self._gone):
            why = "the supervisor was restarted and does not continue the move"
            self._end(JobError.JOB_FORGOTTEN, why)
            return
        if state.object != self._asked[0]:
            return
        try:
            goal = stamped_pose(state.goal, "the goal")
        except InvalidMessage:
            return
        if not same_goal(goal, self._asked[1]):
            return
        idle = state.state == JobState.IDLE and not state.plan_ready
        if idle and self._begun:
            self._end(JobError(state.error_code), str(state.reason))
        self._begun = not idle
