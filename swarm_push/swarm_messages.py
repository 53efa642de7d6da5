"""The messages of agents of a decentralised swarm."""

import functools
import math
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message

from push_model.arrays import Array
from push_msgs.msg import SwarmAgentState, SwarmTarget
from push_ros.conversions import time_from_ros
from push_ros.validation import FRAME, InvalidMessage, check_frame, finite
from swarm_push.agent import AgentState


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
        raise InvalidMessage("the target's heading must not be infinite")
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


@functools.lru_cache(maxsize=256)
def agent_state_from_bytes(data: bytes) -> AgentState:
    """The state that an agent broadcast, from its serialised message.

    Agents of one process receive the same bytes: they are decoded once for all of them.

    Raises
    ------
    InvalidMessage
    RuntimeError: the bytes are no such message.
    """
    return agent_state_from_ros(deserialize_message(data, SwarmAgentState))


def agent_state_from_ros(message: SwarmAgentState) -> AgentState:
    """The state that an agent broadcast.

    Raises
    ------
    InvalidMessage
    """
    check_frame(message.header.frame_id, "the state of an agent")
    pose, mean = (message.x, message.y, message.theta), (message.mean_x, message.mean_y)
    if not len(message.heard) == len(message.flow_x) == len(message.flow_y):
        raise InvalidMessage("the state of an agent needs as many flows as robots")
    flows = np.column_stack([message.flow_x, message.flow_y]).reshape(-1, 2)
    finite((*pose, *mean, *flows.ravel()), "the state of an agent")
    time = time_from_ros(message.header.stamp)
    flows.setflags(write=False)  # several agents may hold the same state
    handed = dict(zip(message.heard, flows, strict=True))
    return AgentState(message.robot, time, _fixed(pose), _fixed(mean), handed)


def _fixed(values: tuple[float, ...]) -> Array:
    array = np.array(values)
    array.setflags(write=False)
    return array
