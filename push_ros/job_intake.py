"""Goals come in, the state of the job goes out: the same for one robot, a group and a swarm.

A goal comes on ``goal_pose`` or by the action ``move_object``. One that cannot be is refused at the
door, with a code and a sentence, and touches no job. One that is already being pursued changes
nothing. Any other one replaces the job under way.
"""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from std_msgs.msg import String
from std_srvs.srv import Trigger

from push_model import se2
from push_model.arrays import Array
from push_model.jobs import GoalRefused, JobError
from push_msgs.action import MoveObject
from push_msgs.msg import JobState
from push_ros.actions import GoalServer
from push_ros.diagnostics import Diagnostics
from push_ros.names import Names
from push_ros.qos import COMMAND, LATCHED
from push_ros.validation import FRAME, InvalidMessage, stamped_pose

_SAME = 1e-6  # [m], [rad] within which a goal is the one that is pursued


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


class JobIntake:
    """Owns ``goal_pose``, ``move_object``, ``execute``, ``cancel``, ``job_state``, ``status_text``.

    system: single, group or swarm; robots, item: whose job it is.
    """

    def __init__(
        self,
        node: Node,
        names: Names,
        diagnostics: Diagnostics,
        owner: JobOwner,
        system: str,
        robots: Sequence[str],
        item: str,
    ) -> None:
        self._node, self._owner, self._diagnostics = node, owner, diagnostics
        self._item = item
        self._goal: Array | None = None  # of the job under way, or of the last one
        self._state = JobState(system=system, robots=list(robots), object=item)
        self._state_publisher = node.create_publisher(JobState, names.team("job_state"), LATCHED)
        self._text_publisher = node.create_publisher(String, names.team("status_text"), LATCHED)
        self._goal_topic = names.team("goal_pose")
        self._server = GoalServer(
            node,
            MoveObject,
            names.team("move_object"),
            check=lambda request: None,
            refuse=self._refuse_request,
            preempt=lambda request: self._make_way(request.goal),
            start=lambda request: self._take(request.goal, bool(request.plan_only)),
            cancel=lambda: self._owner.end_job(JobError.CANCELED, "canceled"),
        )
        node.create_service(Trigger, names.team("execute"), self._on_execute)
        node.create_service(Trigger, names.team("cancel"), self._on_cancel)
        node.create_subscription(
            PoseStamped,
            self._goal_topic,
            self._on_goal_pose,
            COMMAND,
            event_callbacks=diagnostics.subscription_events(self._goal_topic),
        )

    @property
    def goal(self) -> Array | None:
        """Goal ``(3,)`` of the job under way, or of the last one."""
        return self._goal

    @property
    def waited_for(self) -> bool:
        """Whether a client of the action waits for the end of the job."""
        return self._server.active

    def feedback(self, message: Any) -> None:
        """To the client of the action, if there is one."""
        self._server.feedback(message)

    def finish(self, result: Any) -> None:
        """Tell the client of the action, if there is one, how the job ended."""
        self._server.finish(result, success=result.error_code == int(JobError.NONE))

    def publish(self, seconds: float, **fields: Any) -> None:
        """Publish the state of the job at a time [s] of the poses; fields of JobState."""
        message = self._state
        for name, value in fields.items():
            setattr(message, name, value)
        message.plan_ready = self._owner.plan_ready
        nanoseconds = round(1e9 * seconds)
        message.header.frame_id = FRAME
        message.header.stamp.sec = nanoseconds // 1_000_000_000
        message.header.stamp.nanosec = nanoseconds % 1_000_000_000
        self._state_publisher.publish(message)
        self._text_publisher.publish(String(data=f"{message.state_name}: {message.reason}"))

    def _parse(self, message: PoseStamped, topic: str) -> Array:
        """The goal ``(3,)``; raises GoalRefused."""
        try:
            goal = stamped_pose(message, "the goal")
        except InvalidMessage as error:
            self._diagnostics.refuse(topic, str(error))
            frame = message.header.frame_id != FRAME
            code = JobError.UNKNOWN_FRAME if frame else JobError.INVALID_GOAL
            raise GoalRefused(code, str(error)) from None
        self._owner.check_goal(goal)
        return goal

    def _pursued(self, goal: Array) -> bool:
        """Whether the job under way has this goal."""
        if self._goal is None or not self._owner.busy:
            return False
        gap = goal - self._goal
        return bool(np.hypot(gap[0], gap[1]) < _SAME and abs(se2.wrap(float(gap[2]))) < _SAME)

    def _on_goal_pose(self, message: PoseStamped) -> None:
        try:
            self._parse(message, self._goal_topic)
        except GoalRefused as refusal:
            self._say_no(message, refusal)
            return
        self._make_way(message)
        self._take(message, False)

    def _refuse_request(self, request: Any) -> Any:
        """The result for a goal that cannot be; None where it can."""
        try:
            if request.object not in ("", self._item):
                raise GoalRefused(JobError.UNKNOWN_OBJECT, f"unknown object '{request.object}'")
            self._parse(request.goal, "move_object")
        except GoalRefused as refusal:
            self._say_no(request.goal, refusal)
            return MoveObject.Result(error_code=int(refusal.code), error_msg=str(refusal))
        return None

    def _make_way(self, message: PoseStamped) -> None:
        """End what is under way, unless it is the same."""
        same = self._pursued(stamped_pose(message, "the goal"))
        why = "a new goal replaces this one"
        if same:  # whoever waited for it waits no longer; the job goes on
            code = int(JobError.PREEMPTED)
            self.finish(
                MoveObject.Result(
                    error_code=code, error_msg="another client has taken over the job"
                )
            )
        elif self._owner.busy or self._owner.plan_ready:
            self._owner.end_job(JobError.PREEMPTED, why)

    def _take(self, message: PoseStamped, plan_only: bool) -> None:
        goal = stamped_pose(message, "the goal")
        self._state.goal = message
        if self._pursued(goal):
            self._state_publisher.publish(self._state)
            return
        self._goal = goal
        self._state.job += 1
        self._owner.take_goal(goal, plan_only)

    def _say_no(self, message: PoseStamped, refusal: GoalRefused) -> None:
        """The state of the job is published as it is, with the refusal beside it."""
        self._node.get_logger().warning(f"goal refused: {refusal}")
        state = self._state
        state.refusals += 1
        state.refusal_code, state.refusal = int(refusal.code), str(refusal)
        state.refused_goal = message
        self._state_publisher.publish(state)
        self._text_publisher.publish(String(data=f"{state.state_name}: goal refused: {refusal}"))

    def _on_execute(self, request: Any, response: Any) -> Any:
        response.success = self._owner.plan_ready
        response.message = "executing" if response.success else "there is no plan to execute"
        self._owner.execute()
        return response

    def _on_cancel(self, request: Any, response: Any) -> Any:
        response.success = self._owner.busy or self._owner.plan_ready
        response.message = "canceled" if response.success else "there is nothing to cancel"
        self._owner.end_job(JobError.CANCELED, "canceled")
        return response
