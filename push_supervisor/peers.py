"""The nodes that do the work: questions to planner and controller out, events back.

Every question has a number, which comes back with its answer and with each sign of life.
"""

from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from push_model.arrays import Array
from push_model.jobs import JobError
from push_model.push_segment import PushSegment
from push_model.trajectory import Trajectory
from push_msgs.action import FollowTrajectory, PlanPush
from push_msgs.srv import PlanRobotPath
from push_ros.actions import GoalClient
from push_ros.conversions import (
    circles_to_ros,
    pose_stamped_to_ros,
    pose_to_ros,
    segment_from_ros,
    segment_to_ros,
    trajectory_from_ros,
    trajectory_to_ros,
)
from push_ros.names import Names
from push_ros.validation import InvalidMessage
from push_supervisor import events
from push_supervisor.events import Event
from push_supervisor.requests import Peer

Answered = Callable[[int, Event], None]
"""Called with the number of a question, and the event that its answer is."""

_PLAN_ERRORS = {
    PlanPush.Result.INVALID_GOAL: JobError.INVALID_GOAL,
    PlanPush.Result.UNKNOWN_OBJECT: JobError.UNKNOWN_OBJECT,
    PlanPush.Result.UNKNOWN_FRAME: JobError.UNKNOWN_FRAME,
    PlanPush.Result.OUTSIDE_MAP: JobError.OUTSIDE_MAP,
    PlanPush.Result.GOAL_OCCUPIED: JobError.GOAL_OCCUPIED,
    PlanPush.Result.TOO_HEAVY: JobError.TOO_HEAVY,
}
_ONLY_A_BODY_MATTERS = (  # failures that others who stand in the way can cause
    PlanPush.Result.START_OCCUPIED,
    PlanPush.Result.GOAL_OCCUPIED,
    PlanPush.Result.NO_GUIDE_PATH,
    PlanPush.Result.NO_PUSH_SEQUENCE,
)


class Peers:
    """Asks for one robot and one object.

    item: name of the object that questions are about. answered, sign: called with the number of
    the question.
    """

    def __init__(
        self,
        node: Node,
        names: Names,
        robot: str,
        item: str,
        answered: Answered,
        sign: Callable[[int], None],
    ) -> None:
        self._robot, self.item = robot, item
        self._answered, self._sign = answered, sign
        self._planner = GoalClient(node, PlanPush, names.team("plan_push"))
        self._paths = node.create_client(PlanRobotPath, names.team("plan_robot_path"))
        self._controller = GoalClient(
            node, FollowTrajectory, names.robot(robot, "follow_trajectory")
        )

    def ready(self, peer: Peer) -> bool:
        """Whether it is there."""
        if peer is Peer.PATHS:
            return bool(self._paths.service_is_ready())
        return bool((self._planner if peer is Peer.PLANNER else self._controller).ready)

    def let_go(self) -> None:
        """Cancel what the others are doing for this one."""
        self.stop_planning()
        self._controller.forget()

    def stop_planning(self) -> None:
        """Cancel the plan that is being made, if there is one."""
        self._planner.forget()

    def plan(
        self,
        number: int,
        start: Array,
        goal: Array,
        stamp: float,
        preemptive: bool,
        bodies: Array,
        robot: Array,
        under_way: PushSegment | None = None,
    ) -> None:
        """Ask for a plan. bodies: circles ``(n, 3)`` about others. stamp: [s] of the poses.
        robot: ``(3,)`` its pose. under_way: a push at whose end the plan is to begin; then plans
        that are still being improved are told, too."""
        request = PlanPush.Goal(
            mode=PlanPush.Goal.PREEMPTIVE if preemptive else PlanPush.Goal.DIRECT,
            object=self.item,
            robot=self._robot,
            start=pose_stamped_to_ros(start, stamp),
            goal=pose_stamped_to_ros(goal, stamp),
            robot_pose=pose_stamped_to_ros(robot, stamp),
            obstacles=circles_to_ros(bodies),
            under_way=[] if under_way is None else [segment_to_ros(under_way)],
        )

        def failed(
            code: JobError, message: str, retry: bool = False, crowded: bool = False
        ) -> None:
            self._answered(number, events.PlanFailed(code, message, retry, crowded))

        def done(result: Any) -> None:
            if result is None:
                failed(JobError.PLANNING_FAILED, "the planner rejected the request")
                return
            error = result.error_code
            if error != PlanPush.Result.NONE:
                failed(
                    _PLAN_ERRORS.get(error, JobError.PLANNING_FAILED),
                    result.error_msg,
                    retry=error == PlanPush.Result.NO_PUSH_SEQUENCE,
                    crowded=len(bodies) > 0 and error in _ONLY_A_BODY_MATTERS,
                )
                return
            found(result.plan)

        def found(plan: Any, improving: bool = False) -> None:
            try:
                segments = tuple(segment_from_ros(s) for s in plan.segments)
            except InvalidMessage as problem:
                failed(JobError.PLANNING_FAILED, f"the plan is not valid: {problem}")
                return
            if not segments:
                failed(JobError.PLANNING_FAILED, "the planner answered with a plan without pushes")
                return
            self._answered(number, events.PlanFound(segments, improving))

        def working(feedback: Any) -> None:
            self._sign(number)
            for plan in feedback.plan:
                found(plan, improving=True)

        self._planner.send(request, done, working)

    def path(self, number: int, start: Array, goal: Array, circles: Array, crowded: bool) -> None:
        """Ask for a way of the robot alone. crowded: whether others are among the circles."""
        request = PlanRobotPath.Request(
            robot=self._robot,
            start=pose_to_ros(start),
            goal=pose_to_ros(goal),
            obstacles=circles_to_ros(circles),
        )

        def failed(message: str) -> None:
            self._answered(number, events.PathFailed(message, crowded))

        def done(future: Any) -> None:
            answer = future.result()
            if answer is None or answer.error_code != PlanRobotPath.Response.NONE:
                failed("no answer" if answer is None else answer.message)
                return
            try:
                trajectory = trajectory_from_ros(answer.trajectory)
            except InvalidMessage as problem:
                failed(str(problem))
                return
            self._answered(number, events.PathFound(trajectory))

        self._paths.call_async(request).add_done_callback(done)

    def move(
        self, number: int, way: Trajectory, circles: Array, heartbeat: float, item: str = ""
    ) -> None:
        """Have the robot drive. heartbeat: [s] without one after which it is to stop. item: the
        object that it may be close to, where that is another one."""
        goal = FollowTrajectory.Goal(
            mode=FollowTrajectory.Goal.MOVE,
            object=item or self.item,
            trajectory=trajectory_to_ros(way),
            obstacles=circles_to_ros(circles),
            heartbeat_timeout=heartbeat,
        )
        self._follow(number, goal)

    def push(
        self,
        number: int,
        segment: PushSegment,
        circles: Array,
        heartbeat: float,
        going_on: bool = False,
    ) -> None:
        """Have the robot push. going_on: the push begins like the one under way."""
        goal = FollowTrajectory.Goal(
            mode=FollowTrajectory.Goal.PUSH,
            object=self.item,
            trajectory=trajectory_to_ros(segment.trajectory),
            contact=pose_to_ros(segment.grasp),
            curvature_min=segment.limits.minimum,
            curvature_max=segment.limits.maximum,
            obstacles=circles_to_ros(circles),
            heartbeat_timeout=heartbeat,
            going_on=going_on,
        )
        self._follow(number, goal)

    def _follow(self, number: int, goal: Any) -> None:
        def done(result: Any) -> None:
            if result is None:
                text = "the controller rejected the trajectory"
                self._answered(number, events.MotionFailed(text))
            elif result.error_code == FollowTrajectory.Result.NONE:
                self._answered(number, events.MotionDone())
            elif result.error_code == FollowTrajectory.Result.CLOCK_RESET:
                self._answered(number, events.ClockReset())
            else:
                self._answered(number, events.MotionFailed(result.error_msg))

        # A push that goes on must not be canceled, not even for a moment.
        self._controller.send(
            goal, done, lambda feedback: self._sign(number), cancel=not goal.going_on
        )
