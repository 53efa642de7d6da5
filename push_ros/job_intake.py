"""Goals come in, the state of the job goes out: the same for one robot, a group and a swarm.

A goal comes on ``goal_pose`` or by the action ``move_object``. One that cannot be is refused at the
door, with a code and a sentence, and touches no job. One that is already being pursued changes
nothing. Any other one replaces the job under way.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import String
from std_srvs.srv import Trigger

from push_job.method import Task
from push_model import se2
from push_model.arrays import Array
from push_model.jobs import GoalRefused, JobError, JobPhase
from push_msgs.action import MoveObject
from push_msgs.msg import JobState
from push_ros.actions import GoalServer
from push_ros.diagnostics import Diagnostics
from push_ros.job_keeper import PATIENCE, Bodies, JobKeeper
from push_ros.job_memory import JobMemory
from push_ros.job_owner import JobOwner, ObjectChoice
from push_ros.names import Names
from push_ros.qos import COMMAND, LATCHED
from push_ros.services import CALLS, Services
from push_ros.validation import FRAME, InvalidMessage, stamped_pose

_SAME = 1e-6  # [m], [rad] within which a goal is the one that is pursued

Answer = Callable[[GoalRefused | None], None]
Consider = Callable[[Array, Answer], None]


class JobIntake:
    """Owns ``goal_pose``, ``move_object``, ``execute``, ``cancel``, ``job_state``, ``status_text``.

    system: single, group or swarm; robots, item: whose job it is. Goals on ``goal_pose`` are of the
    item; a goal of ``move_object`` may name another object, where the owner has a choice.
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
        consider: Consider | None = None,
        memory: JobMemory | None = None,
        choice: ObjectChoice | None = None,
        no_plan_only: str = "",
        refuse: Callable[[JobError, str], None] = lambda code, reason: None,
    ) -> None:
        """consider: in the place of the owner's ``check_goal``, where that takes time: answers, now
        or later, with why a goal ``(3,)`` is refused, with None where it can be worked on.
        refuse: answers a goal that is still considered, if there is one, with a refusal.
        memory: of jobs; that of the process if it is not given. choice: of other objects.
        no_plan_only: why the owner does not plan without executing; empty where it does."""
        self._no_plan_only = no_plan_only
        others = () if choice is None else choice.names_of_objects
        self._keeper = JobKeeper(memory or JobMemory.of_process(), (item, *robots), others)
        self._dropped: GoalRefused | None = None  # why the last job ended, not taken up again
        self._run, self._since = "", math.nan
        self._stamp = 0.0  # [s] of the last frame
        self._consider, self._refuse = consider or self._check, refuse
        self._node, self._owner, self._diagnostics = node, owner, diagnostics
        self._item, self._choice = item, choice
        self._goal: Array | None = None  # of the job under way, or of the last one, if it has one
        self._plan_only = False  # whether that job ends with its plan
        self._state = JobState(system=system, robots=list(robots), object=item)
        if (kept := self._keeper.pending) is not None:
            self._use(self._keeper.item)
            self._state.job = kept.job
            self._state.goal = deserialize_message(bytes.fromhex(kept.goal), PoseStamped)
        self._state_publisher = node.create_publisher(JobState, names.team("job_state"), LATCHED)
        self._text_publisher = node.create_publisher(String, names.team("status_text"), LATCHED)
        self._goal_topic = names.team("goal_pose")
        self._server = GoalServer(
            node,
            MoveObject,
            names.team("move_object"),
            check=lambda request: None,
            consider=self._consider_request,
            preempt=lambda request: self._make_way(
                request.object or item, request.goal, bool(request.plan_only)
            ),
            start=lambda request: self._take(
                request.object or item, request.goal, bool(request.plan_only)
            ),
            cancel=lambda: self._owner.end_job(JobError.CANCELED, "canceled"),
        )
        node.create_subscription(String, names.world("world_run"), self._on_run, LATCHED)
        services = Services(node, names.team(CALLS), lambda: self._stamp)
        services.serve(Trigger, names.team("execute"), self._on_execute)
        services.serve(Trigger, names.team("cancel"), self._on_cancel)
        node.create_subscription(
            PoseStamped,
            self._goal_topic,
            self._on_goal_pose,
            COMMAND,
            event_callbacks=diagnostics.subscription_events(self._goal_topic),
        )

    @property
    def goal(self) -> Array | None:
        """Goal ``(3,)`` of the job under way, or of the last one; None for a task without one."""
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
        if not self._owner.busy and self._keeper.pending is not None:
            message.state, message.state_name = int(JobPhase.PLANNING), JobPhase.PLANNING.name
            message.reason = (
                "the node was restarted; it continues its job when map, poses and nodes are there"
            )
        elif not self._owner.busy and not message.plan_ready:
            self._keeper.end()
            if self._dropped is not None:
                self._tell_of(self._dropped)
        nanoseconds = round(1e9 * seconds)
        message.header.frame_id = FRAME
        message.header.stamp.sec = nanoseconds // 1_000_000_000
        message.header.stamp.nanosec = nanoseconds % 1_000_000_000
        self._state_publisher.publish(message)
        self._text_publisher.publish(String(data=f"{message.state_name}: {message.reason}"))

    # A job that outlives its node

    def begin(self) -> None:
        """A task begins that did not come as a goal: a job of its own, with an empty goal."""
        self._goal, self._state.goal = None, PoseStamped()
        self._state.job += 1

    def keep(self, task: Task) -> None:
        """Keep what the owner has made of the job that begins."""
        self._dropped = None
        goal = bytes(serialize_message(self._state.goal))
        self._keeper.begin(int(self._state.job), goal, task.targets, task.times)

    def forget(self) -> None:
        """The node ends in good order: its job ends too."""
        self._keeper.end()

    def frame(self, stamp: float, bodies: Bodies, ready: bool, reached: int = 0) -> None:
        """Keep the job under way, or take up the one that was under way when this node was started.

        Parameters
        ----------
        stamp: [s] of a frame. bodies: of the team, as it is seen at any later time too.
        ready: whether a job could be worked on. reached: targets of the task that are.
        """
        self._stamp = stamp
        pending = self._keeper.pending is not None
        if not pending and not self._owner.busy and not self._owner.plan_ready:
            self._keeper.end()
        self._keeper.see(stamp, self._run, bodies, reached)
        if not pending:
            return
        try:
            job = self._keeper.judge(stamp, self._run, bodies()) if ready else None
        except GoalRefused as refusal:
            self._drop(refusal)
            return
        if job is not None:
            self._node.get_logger().warning("the node was restarted and continues its job")
            targets = tuple(np.array(t) for t in job.targets)
            sent, self._plan_only = self._state.goal, job.plan_only
            self._goal = stamped_pose(sent, "the goal") if sent.header.frame_id else None
            goal = bytes.fromhex(job.goal)
            self._dropped = None
            self._keeper.begin(job.job, goal, targets, job.times, job.plan_only)
            self._owner.resume(job)

    def reset(self) -> None:
        """The clock has gone back."""
        if self._keeper.pending is not None:
            self._drop(
                GoalRefused(JobError.CLOCK_RESET, "the clock jumped back; send the goal again")
            )

    def wait(self, now: float) -> None:
        """Tell the time [s] on the clock for silence, while no frame comes too."""
        if self._keeper.pending is not None:
            self._since = now if math.isnan(self._since) else self._since
            if now - self._since > PATIENCE:
                why = (
                    f"map, poses or other nodes were missing for {PATIENCE:g} s; "
                    "send the goal again"
                )
                self._drop(GoalRefused(JobError.JOB_FORGOTTEN, f"the node was restarted; {why}"))

    def _drop(self, refusal: GoalRefused) -> None:
        """The job that was under way ends without having been taken up."""
        self._keeper.end()
        self._node.get_logger().warning(str(refusal))
        self._dropped, state = refusal, self._state
        self._tell_of(refusal)
        self._state_publisher.publish(state)
        self._text_publisher.publish(String(data=f"{state.state_name}: {state.reason}"))

    def _tell_of(self, refusal: GoalRefused) -> None:
        """Write into the state how a job ended that was not taken up. The owner does not know of
        that job, so its own words do not say it."""
        state = self._state
        state.state, state.state_name = int(JobPhase.IDLE), JobPhase.IDLE.name
        state.reason, state.error_code = str(refusal), int(refusal.code)

    def _on_run(self, message: String) -> None:
        self._run = str(message.data)

    def _use(self, item: str) -> None:
        """The next job is about this object."""
        if item != self._state.object and self._choice is not None:
            self._choice.use(item)
            self._keeper.use(item)
            self._state.object = item

    def _judge(self, message: PoseStamped, topic: str, answer: Answer, item: str = "") -> None:
        """Answer, now or later, with why a goal is refused, with None where it can be taken."""
        try:
            goal = stamped_pose(message, "the goal")
        except InvalidMessage as error:
            self._diagnostics.refuse(topic, str(error))
            frame = message.header.frame_id != FRAME
            code = JobError.UNKNOWN_FRAME if frame else JobError.INVALID_GOAL
            answer(GoalRefused(code, str(error)))
        else:
            if self._choice is None or (item or self._item) == self._state.object:
                self._consider(goal, answer)
            else:
                self._check(goal, answer, item or self._item)

    def _check(self, goal: Array, answer: Answer, item: str = "") -> None:
        refusal = None
        try:
            if item and self._choice is not None:
                self._choice.check_other(item, goal)
            else:
                self._owner.check_goal(goal)
        except GoalRefused as error:
            refusal = error
        answer(refusal)

    def _pursued(self, item: str, goal: Array, plan_only: bool) -> bool:
        """Whether the job under way has this goal, and does with it what is asked."""
        if self._goal is None or not self._owner.busy or item != self._state.object:
            return False
        if plan_only != self._plan_only:
            return False
        gap = goal - self._goal
        return bool(np.hypot(gap[0], gap[1]) < _SAME and abs(se2.wrap(float(gap[2]))) < _SAME)

    def _on_goal_pose(self, message: PoseStamped) -> None:
        def judged(refusal: GoalRefused | None) -> None:
            if refusal is not None:
                self._say_no(message, refusal)
                return
            self._make_way(self._item, message, False)
            self._take(self._item, message, False)

        self._judge(message, self._goal_topic, judged)

    def _consider_request(self, request: Any, answer: Callable[[Any], None]) -> None:
        """Answer with the result for a goal that cannot be, with None where it can."""

        def judged(refusal: GoalRefused | None) -> None:
            if refusal is None:
                answer(None)
                return
            self._say_no(request.goal, refusal)
            answer(MoveObject.Result(error_code=int(refusal.code), error_msg=str(refusal)))

        others = () if self._choice is None else self._choice.names_of_objects
        if request.object not in ("", self._item, *others):
            text = f"unknown object '{request.object}'"
            judged(GoalRefused(JobError.UNKNOWN_OBJECT, text))
            return
        if request.plan_only and self._no_plan_only:
            judged(GoalRefused(JobError.INVALID_GOAL, self._no_plan_only))
            return
        self._judge(request.goal, "move_object", judged, request.object)

    def _make_way(self, item: str, message: PoseStamped, plan_only: bool) -> None:
        """End what is under way, unless it is the same."""
        same = self._pursued(item, stamped_pose(message, "the goal"), plan_only)
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

    def _take(self, item: str, message: PoseStamped, plan_only: bool) -> None:
        goal = stamped_pose(message, "the goal")
        self._state.goal = message
        if self._pursued(item, goal, plan_only):
            self._state_publisher.publish(self._state)
            return
        self._use(item)
        self._goal, self._plan_only, self._dropped = goal, plan_only, None
        self._state.job += 1
        kept = bytes(serialize_message(message))
        self._keeper.begin(int(self._state.job), kept, (goal,), plan_only=plan_only)
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
        if response.success:
            self._plan_only = False
            self._keeper.executed()
        self._owner.execute()
        return response

    def _on_cancel(self, request: Any, response: Any) -> Any:
        refusals = self._state.refusals  # a goal that is still judged is refused
        some = self._owner.busy or self._owner.plan_ready
        if self._keeper.pending is not None:
            some = True
            self._drop(GoalRefused(JobError.CANCELED, "canceled"))
        self._refuse(JobError.CANCELED, "canceled")
        self._owner.end_job(JobError.CANCELED, "canceled")
        response.success = some or self._state.refusals > refusals
        response.message = "canceled" if response.success else "there is nothing to cancel"
        return response
