"""The swarm's node: hosts the swarm method.

Where agents decide for themselves (``agent_node.py``) it sends them their target instead of
commands; it then only takes goals, watches, and tells how the task stands.
"""

import math
import sys
from typing import Any

import numpy as np

from push_job.method import Task, Told
from push_job.report import Status
from push_model.jobs import GoalRefused, JobError
from push_msgs.action import SwarmMove
from push_msgs.msg import SwarmTarget
from push_ros.hosting import Hosting
from push_ros.method_node import MethodNode
from push_ros.process import run_node
from push_ros.qos import COMMAND
from push_ros.scheduling import Urgency
from push_ros.task_server import TaskAction
from push_ros.validation import InvalidMessage, finite
from push_scenario.scenario import Scenario
from swarm_push.agent import AgentSettings
from swarm_push.swarm_messages import target_to_ros
from swarm_push.swarm_method import SWARM

_MOST = 1000  # targets


class TargetCommander:
    """Sends agents the target of the task under way, or that there is none."""

    def __init__(self, node: MethodNode) -> None:
        self._node = node
        self._publisher = node.create_publisher(
            SwarmTarget, node.names.team("swarm_target"), COMMAND
        )

    def send(self, stamp: Any, told: Told) -> None:
        """See Commander."""
        job = getattr(self._node.method, "job", None)
        target = job.target if job is not None and job.busy else None
        self._publisher.publish(target_to_ros(stamp, target))


def targets_from_ros(request: Any) -> Task:
    """The task of a SwarmMove request, headings nan where none are given.

    Raises
    ------
    InvalidMessage
    """
    x, y = (np.asarray(a, dtype=np.float64) for a in (request.x, request.y))
    theta = np.asarray(request.theta, dtype=np.float64)
    if not 1 <= len(x) <= _MOST or len(y) != len(x) or len(theta) not in (0, len(x)):
        raise InvalidMessage(f"1 to {_MOST} targets, x and y of each, and theta of each or none")
    for array in (x, y, theta):
        finite(array, "the targets")
    theta = theta if len(theta) else np.full(len(x), math.nan)
    return Task(tuple(np.column_stack([x, y, theta])))


def _actions(node: MethodNode) -> tuple[TaskAction, ...]:
    def parse(request: Any) -> Task:
        if request.object not in ("", node.object):
            raise GoalRefused(JobError.UNKNOWN_OBJECT, f"unknown object '{request.object}'")
        return targets_from_ros(request)

    def result(common: dict[str, Any], status: Status) -> Any:
        return SwarmMove.Result(times=list(status.times), **common)

    def feedback(status: Status, away: float) -> Any:
        return SwarmMove.Feedback(
            target=int(status.index), position_error=away, state_name=status.name
        )

    return (TaskAction(SwarmMove, "swarm_move", parse, result, feedback),)


def _commander(node: MethodNode) -> TargetCommander | None:
    agents = node.settings.get("agents", AgentSettings())
    return TargetCommander(node) if agents.decentralised else None


HOSTING = Hosting(actions=_actions, commander=_commander)


def make(
    scenario: Scenario | None = None,
    robots: tuple[str, ...] = (),
    item: str = "",
    namespace: str = "",
    world: str = "",
) -> MethodNode:
    """The node of a swarm; see MethodNode."""
    return MethodNode(SWARM, scenario, robots, item, namespace, world, HOSTING)


def main() -> int:
    """Entry point of the process: ``--ros-args`` on its command line."""
    return run_node(make, urgency=Urgency.CONTROL)


if __name__ == "__main__":
    sys.exit(main())
