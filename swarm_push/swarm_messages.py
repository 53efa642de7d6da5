"""A swarm's messages."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from push_model.arrays import Array
from push_model.specs import ObjectSpec
from push_msgs.msg import SwarmAgentState, SwarmStatus, SwarmTarget
from push_ros.conversions import time_from_ros
from push_ros.validation import FRAME, InvalidMessage, check_frame, finite
from swarm_push.agent import AgentState
from swarm_push.density import Density
from swarm_push.swarm_job import SwarmJob

_MOST = 1000  # targets


def targets_from_ros(request: Any, item: ObjectSpec) -> list[Array]:
    """Poses ``(3,)`` of the centre of mass, headings nan where none are given.

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
    if not len(theta):  # the centre of mass is somewhere about there, whatever the heading
        return [np.array([a, b, math.nan]) for a, b in zip(x, y, strict=True)]
    return [item.mass_pose(np.array(p)) for p in zip(x, y, theta, strict=True)]


def status_to_ros(
    stamp: Any, item: str, law: str, names: Sequence[str], job: SwarmJob, pose: Array, cost: float
) -> SwarmStatus:
    """Of a tick of a job; names: of the robots that took part; cost: [s] of CPU."""
    step, target = job.last, job.target
    assert step is not None and target is not None
    away, turned = job.errors(pose)
    message = SwarmStatus(
        object=item,
        law=law,
        phase=step.phase.value,
        robots=list(names),
        dead=sorted(job.dead),
        target=job.index,
        targets=len(job.targets),
        position_error=away,
        orientation_error=turned,
        solve_time=cost,
    )
    message.header.frame_id, message.header.stamp = FRAME, stamp
    message.target_x, message.target_y, message.target_theta = (float(v) for v in target)
    message.centroid_x, message.centroid_y = step.centroids.T.tolist()
    density = step.density
    message.weight, message.root = density.weights.tolist(), density.roots.ravel().tolist()
    message.mean_x, message.mean_y = density.means.T.tolist()
    message.region_x, message.region_y = job.region.T.tolist()
    return message


def density_from_ros(message: SwarmStatus) -> Density:
    """The density that a swarm covers."""
    return Density(
        np.array(message.weight),
        np.column_stack([message.mean_x, message.mean_y]),
        np.array(message.root).reshape(-1, 2, 2),
    )


def target_to_ros(stamp: Any, target: Array | None) -> SwarmTarget:
    """A target ``(3,)`` of the centre of mass, or that there is none."""
    message = SwarmTarget(active=target is not None)
    message.header.frame_id, message.header.stamp = FRAME, stamp
    if target is not None:
        message.x, message.y, message.theta = (float(v) for v in target)
    return message


def target_from_ros(message: SwarmTarget) -> Array | None:
    """``(3,)``, its heading nan where any will do; None where there is none.

    Raises
    ------
    InvalidMessage
    """
    check_frame(message.header.frame_id, "the target")
    finite((message.x, message.y), "the target")
    if math.isinf(message.theta):
        raise InvalidMessage("the target's heading is infinite")
    if not message.active:
        return None
    return np.array([message.x, message.y, message.theta])


def agent_state_to_ros(stamp: Any, state: AgentState) -> SwarmAgentState:
    """The state that an agent broadcasts."""
    message = SwarmAgentState(robot=state.name, heard=list(state.flows))
    message.header.frame_id, message.header.stamp = FRAME, stamp
    message.x, message.y, message.theta = (float(v) for v in state.pose)
    message.mean_x, message.mean_y = (float(v) for v in state.mean)
    message.flow_x = [float(f[0]) for f in state.flows.values()]
    message.flow_y = [float(f[1]) for f in state.flows.values()]
    return message


def agent_state_from_ros(message: SwarmAgentState) -> AgentState:
    """The state that an agent broadcast.

    Raises
    ------
    InvalidMessage
    """
    check_frame(message.header.frame_id, "the state of an agent")
    pose, mean = (message.x, message.y, message.theta), (message.mean_x, message.mean_y)
    if not len(message.heard) == len(message.flow_x) == len(message.flow_y):
        raise InvalidMessage("the state of an agent has flows of another number than robots")
    flows = np.column_stack([message.flow_x, message.flow_y]).reshape(-1, 2)
    finite((*pose, *mean, *flows.ravel()), "the state of an agent")
    time = time_from_ros(message.header.stamp)
    handed = dict(zip(message.heard, flows, strict=True))
    return AgentState(message.robot, time, np.array(pose), np.array(mean), handed)
