"""The group's node: hosts the group method; the steps come from the grasp optimizer's node."""

import sys
from typing import Any

import numpy as np

from grasp_opt.group_messages import plan_from_ros
from grasp_opt.group_method import GROUP
from grasp_opt.job_state import Request
from grasp_opt.plan_source import PlanFailed
from grasp_opt.step_planner import GroupPlan
from push_job.method import Seen, Task
from push_job.report import Status
from push_model.belief import Belief
from push_model.jobs import JobError
from push_msgs.action import PlanGroupPush, PushAlong
from push_ros.actions import GoalClient
from push_ros.conversions import circles_to_ros, pose_stamped_to_ros, pose_to_ros
from push_ros.hosting import Hosting
from push_ros.method_node import PATIENCE, MethodNode
from push_ros.process import run_node
from push_ros.scheduling import Urgency
from push_ros.task_server import TaskAction
from push_ros.validation import InvalidMessage, finite
from push_scenario.scenario import Scenario

_LONGEST = 100_000  # samples of a trajectory that somebody sends
_ERRORS = {
    PlanGroupPush.Result.INVALID_GOAL: JobError.INVALID_GOAL,
    PlanGroupPush.Result.UNKNOWN_OBJECT: JobError.UNKNOWN_OBJECT,
    PlanGroupPush.Result.TOO_FEW: JobError.TOO_HEAVY,
}


class OptimizerClient:
    """A PlanSource that asks the grasp optimizer's node.

    One that dies is asked again when it, or another, is there; after ten seconds of pose time
    without one the request fails.
    """

    cost = 0.0

    def __init__(self, node: MethodNode) -> None:
        self._node = node
        self._client = GoalClient(node, PlanGroupPush, node.names.team("plan_group_push"))
        self._request: Request | None = None
        self._asked_at: Seen | None = None
        self._sent = False
        self._since = 0.0  # [s] pose time since when it is there, or was asked for
        self._found: GroupPlan | PlanFailed | None = None

    @property
    def ready(self) -> bool:
        """Whether the optimizer's server is there."""
        return bool(self._client.ready)

    def ask(self, request: Request, seen: Seen, belief: Belief) -> None:
        """See PlanSource; the optimizer hears of beliefs itself."""
        self._request, self._asked_at, self._since = request, seen, seen.time
        self._sent, self._found = False, None

    def answer(self, seen: Seen) -> GroupPlan | None:
        """See PlanSource."""
        if self._client.ready:
            self._since = seen.time
            if not self._sent and self._request is not None and self._asked_at is not None:
                self._sent = True
                self._send(self._request, self._asked_at)
        else:
            self._sent = False
            self._client.forget()
            if seen.time - self._since > PATIENCE:
                raise PlanFailed(JobError.NODE_LOST, "the grasp optimizer is not in the ROS graph")
        found, self._found = self._found, None
        if isinstance(found, PlanFailed):
            raise found
        return found

    def forget(self) -> None:
        """See PlanSource."""
        self._request, self._found = None, None
        self._client.forget()

    def _send(self, request: Request, seen: Seen) -> None:
        node, item = self._node, self._node.beliefs.current.object(self._node.object)
        goal = PlanGroupPush.Goal(object=node.object, robots=list(node.robots))
        goal.goal = pose_stamped_to_ros(item.geometric_pose(request.goal), seen.time)
        goal.start = pose_to_ros(item.geometric_pose(request.pose))
        goal.places = [pose_to_ros(pose) for pose in request.robots]
        goal.fewest = request.fewest
        goal.dead = [node.robots[i] for i in request.dead]
        goal.obstacles = circles_to_ros(seen.obstacles)
        if request.trajectory is not None:
            task = request.trajectory
            poses = np.array([item.geometric_pose(p) for p in task.pose])
            goal.time, goal.theta = task.time.tolist(), task.pose[:, 2].tolist()
            goal.x, goal.y = poses[:, 0].tolist(), poses[:, 1].tolist()

        def answered(result: Any) -> None:
            if self._request is request:
                self._found = self._parsed(result)

        self._client.send(goal, answered)

    def _parsed(self, result: Any) -> GroupPlan | PlanFailed:
        if result is None:
            return PlanFailed(JobError.PLANNING_FAILED, "the optimizer rejected the request")
        if result.error_code:
            code = _ERRORS.get(result.error_code, JobError.PLANNING_FAILED)
            return PlanFailed(code, str(result.error_msg))
        try:
            return plan_from_ros(result.plan, self._node.robots)
        except InvalidMessage as error:
            return PlanFailed(JobError.PLANNING_FAILED, str(error))


def _along(request: Any) -> Task:
    """The task of a PushAlong request; raises InvalidMessage."""
    fields = (request.time, request.x, request.y, request.theta)
    arrays = [np.asarray(values, dtype=np.float64) for values in fields]
    if len({len(a) for a in arrays}) != 1 or not 3 <= len(arrays[0]) <= _LONGEST:
        raise InvalidMessage(f"time, x, y, theta must be equally long: 3 to {_LONGEST} samples")
    for values in arrays:
        finite(values, "the trajectory")
    return Task(tuple(np.column_stack(arrays[1:])), tuple(arrays[0].tolist()))


def _actions(node: MethodNode) -> tuple[TaskAction, ...]:
    def result(common: dict[str, Any], status: Status) -> Any:
        job = getattr(node.method, "job", None)
        margin = job.plan.placement.margin if job is not None and job.plan is not None else -1.0
        return PushAlong.Result(margin=float(margin), **common)

    def feedback(status: Status, away: float) -> Any:
        return PushAlong.Feedback(state_name=status.name, progress=float(status.progress))

    return (TaskAction(PushAlong, "push_along", _along, result, feedback),)


HOSTING = Hosting(actions=_actions, attach=OptimizerClient)


def make(
    scenario: Scenario | None = None,
    robots: tuple[str, ...] = (),
    item: str = "",
    namespace: str = "",
    world: str = "",
) -> MethodNode:
    """The node of a group; see MethodNode."""
    return MethodNode(GROUP, scenario, robots, item, namespace, world, HOSTING)


def main() -> int:
    """Entry point of the process: ``--ros-args`` on its command line."""
    return run_node(make, urgency=Urgency.CONTROL)


if __name__ == "__main__":
    sys.exit(main())
