"""Robots that decide for themselves: what they hear, what they agree on, what they do."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from rclpy.serialization import serialize_message

from push_estimation.pose_gate import Stamp
from push_msgs.msg import SwarmAgentState, SwarmTarget
from push_ros.pose_feed import Frame
from push_ros.validation import InvalidMessage
from push_scenario.bodies import load_object, load_robot
from push_study.swarm.maps import MapTask, run
from swarm_push.agent import Agent, AgentSettings, AgentState
from swarm_push.agent_node import SwarmAgentNode
from swarm_push.laws import LawSections, LawSettings
from swarm_push.swarm_job import SwarmJob, SwarmJobSettings
from swarm_push.swarm_messages import (
    agent_state_from_bytes,
    agent_state_from_ros,
    agent_state_to_ros,
    target_from_ros,
    target_to_ros,
)

NONE = np.zeros((0, 3))
REGION = 3.0 * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
STAMP = SwarmAgentState().header.stamp


def agents(count, law="crescent", **changes):
    item, robot = load_object("swarm_square"), load_robot("epuck_ring")
    laws = LawSections(law=LawSettings(law=law))
    settings = AgentSettings(decentralised=True, **changes)
    return [
        Agent(f"e{i}", SwarmJob(REGION, item, robot, SwarmJobSettings(), laws), settings)
        for i in range(count)
    ]


def say(team, words):
    for agent in team:
        for word in words:
            agent.hear(word)


@pytest.mark.long
@pytest.mark.parametrize(("lost", "within"), [(0.0, 0.02), (0.1, 0.05), (0.4, 0.1)])
def test_they_agree_on_the_mean_while_they_move_and_messages_are_lost(lost, within):
    """Eight draws of a swarm of fifteen of which nobody hears all; everybody goes its own way."""
    for seed in range(8):
        random = np.random.default_rng(seed)
        team = agents(15, radius=1.1, lost=lost, seed=seed)
        poses = np.column_stack([random.uniform(-0.8, 0.8, (15, 2)), np.zeros(15)])
        drift = np.array([0.05, -0.02]) + random.normal(0.0, 0.02, (15, 2))
        words, worst = [], 0.0
        for k in range(400):
            poses[:, :2] += 0.02 * drift
            say(team, words)
            words = [
                a.step(0.02 * k, np.zeros(3), p, NONE)[1] for a, p in zip(team, poses, strict=True)
            ]
            if k > 200:
                off = [np.hypot(*(a.mean - poses[:, :2].mean(axis=0))) for a in team]
                worst = max(worst, float(np.mean(off)))
        assert worst < within, seed
        assert min(len(a.neighbours) for a in team) < 14


def test_words_from_afar_are_not_heard_and_old_ones_are_forgotten():
    (agent,) = agents(1, radius=0.5, forget=0.1)
    agent.step(0.0, np.zeros(3), np.zeros(3), NONE)
    near, far = np.array([0.4, 0.0, 0.0]), np.array([0.6, 0.0, 0.0])
    agent.hear(AgentState("a", 0.0, near, near[:2], {}))
    agent.hear(AgentState("b", 0.0, far, far[:2], {}))
    agent.hear(AgentState("e0", 0.0, near, near[:2], {}))  # itself
    agent.step(0.02, np.zeros(3), np.zeros(3), NONE)
    assert agent.neighbours == ("a",)
    agent.hear(AgentState("a", 0.02, far, far[:2], {}))  # gone off
    assert agent.neighbours == ()
    agent.hear(AgentState("a", 0.04, near, near[:2], {}))
    agent.step(0.2, np.zeros(3), np.zeros(3), NONE)
    assert agent.neighbours == ()


def test_part_of_the_words_is_lost():
    (agent,) = agents(1, lost=0.3)
    agent.step(0.0, np.zeros(3), np.zeros(3), NONE)
    heard = 0
    for k in range(2000):
        agent.hear(AgentState(f"r{k}", 0.0, np.zeros(3), np.zeros(2), {}))
    agent.step(0.02, np.zeros(3), np.zeros(3), NONE)
    heard = len(agent.neighbours)
    assert 0.65 < heard / 2000 < 0.75


def test_they_stand_without_a_target_and_begin_anew_when_the_object_leaves_it():
    (agent,) = agents(1)
    here, target = np.array([-1.0, 0.0, 0.0]), np.array([0.0, 0.0, math.nan])
    assert agent.step(0.0, np.zeros(3), here, NONE)[0] == (0.0, 0.0)
    agent.pursue(target)
    assert agent.step(0.02, np.zeros(3), here, NONE)[0] == (0.0, 0.0)  # it is there
    assert not agent.job.busy
    agent.pursue(target)
    assert agent.step(0.04, np.array([0.5, 0.0, 0.0]), here, NONE)[0] != (0.0, 0.0)
    agent.pursue(np.array([0.0, 1.0, math.nan]))
    agent.step(0.06, np.array([0.5, 0.0, 0.0]), here, NONE)
    assert np.array_equal(agent.job.target[:2], [0.0, 1.0])
    agent.pursue(None)
    assert agent.step(0.08, np.array([0.5, 0.0, 0.0]), here, NONE)[0] == (0.0, 0.0)


def test_the_printed_law_takes_the_mean_that_they_agree_on():
    (agent,) = agents(1, law="thesis")
    agent.pursue(np.array([1.0, 0.0, math.nan]))
    agent.step(0.0, np.zeros(3), np.array([-1.5, 0.0, 0.0]), NONE)
    alone = agent.job.last.density.mean
    far = AgentState("a", 0.0, np.array([-1.5, 0.5, 0.0]), np.array([0.0, 2.0]), {})
    agent.hear(far)
    agent.step(0.02, np.zeros(3), np.array([-1.5, 0.0, 0.0]), NONE)
    assert agent.mean[1] > 0.5
    assert agent.job.last.density.mean[1] > alone[1] + 0.5


def test_words_and_targets_go_through_their_messages():
    word = AgentState(
        "e3", 0.0, np.array([1.0, -2.0, 0.5]), np.array([0.1, 0.2]), {"e1": np.array([0.5, 1.0])}
    )
    again = agent_state_from_ros(agent_state_to_ros(STAMP, word))
    assert again.name == "e3" and list(again.flows) == ["e1"]
    assert np.array_equal(again.flows["e1"], [0.5, 1.0])
    assert np.array_equal(again.pose, word.pose) and np.array_equal(again.mean, word.mean)
    for target in (None, np.array([1.0, 2.0, math.nan]), np.array([1.0, 2.0, 0.3])):
        back = target_from_ros(target_to_ros(STAMP, target))
        assert (back is None) == (target is None)
        assert target is None or np.array_equal(back, target, equal_nan=True)
    for message in (
        SwarmTarget(active=True, x=math.nan),
        SwarmTarget(active=True, theta=math.inf),
    ):
        message.header.frame_id = "map"
        with pytest.raises(InvalidMessage):
            target_from_ros(message)
    for field, value in (("x", math.inf), ("flow_x", []), ("flow_y", [math.nan])):
        message = agent_state_to_ros(STAMP, word)
        setattr(message, field, value)
        with pytest.raises(InvalidMessage):
            agent_state_from_ros(message)
    with pytest.raises(InvalidMessage):
        agent_state_from_ros(SwarmAgentState(robot="e1"))


def test_a_state_is_decoded_once_for_all_that_receive_it_and_none_can_alter_it():
    word = AgentState("e3", 0.0, np.ones(3), np.ones(2), {"e1": np.array([0.5, 1.0])})
    data = serialize_message(agent_state_to_ros(STAMP, word))
    first, second = agent_state_from_bytes(data), agent_state_from_bytes(bytes(bytearray(data)))
    assert first is second and np.array_equal(first.flows["e1"], [0.5, 1.0])
    for array in (first.pose, first.mean, first.flows["e1"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0
    for wrong in (data[:9], b"\x00\x01\x00\x00" + b"\xff" * 40):
        with pytest.raises(RuntimeError):
            agent_state_from_bytes(wrong)


def test_a_target_is_shifted_once_when_the_centre_of_mass_is_believed_elsewhere():
    """The node shifts the target that it sends, the agent that of its job: in whatever order."""
    for first in ("target", "belief"):
        (agent,) = agents(1)
        item, here = load_object("swarm_square"), np.array([-1.0, 0.0, 0.0])
        agent.pursue(np.array([1.0, 0.0, 0.0]))
        agent.step(0.0, np.zeros(3), here, NONE)
        shifted = np.array([1.05, 0.0, 0.0])
        if first == "target":
            agent.pursue(shifted)
        agent.job.believe(replace(item, com=(item.com[0] + 0.05, item.com[1])))
        agent.pursue(shifted)
        assert np.array_equal(agent.job.target, shifted)


def test_a_clock_that_is_set_back_leaves_no_neighbours():
    (agent,) = agents(1)
    here, there = np.array([-1.0, 0.0, 0.0]), np.array([-1.0, 0.3, 0.0])
    agent.pursue(np.array([1.0, 0.0, 0.0]))
    agent.step(300.0, np.zeros(3), here, NONE)
    agent.hear(AgentState("e1", 300.0, there, there[:2], {"e0": np.ones(2)}))
    agent.step(300.02, np.zeros(3), here, NONE)
    assert agent.neighbours == ("e1",)
    agent.forget()
    agent.step(0.0, np.zeros(3), here, NONE)
    assert agent.neighbours == () and not agent.job.busy
    assert np.array_equal(agent.mean, here[:2])


class AlonePoses:
    """What an agent's node sees: the object, and its own robot while ``own`` is set."""

    def __init__(self, own):
        self.own, self.stamp = own, 0.0

    def pose(self, name):
        return self.own if name == "e0" else np.zeros(3)

    def discs(self, others):
        return NONE


def agent_node(agent, poses):
    """The part of an agent's node that answers frames, without a graph."""
    node = SwarmAgentNode.__new__(SwarmAgentNode)
    node.robot, node.object, node._item = "e0", "plate", load_object("swarm_square")
    node.agent, node._behaviour, node._poses = agent, agent.settings, poses
    node._target, node._told = np.array([1.0, 0.0, 0.0]), 0.0
    node._messages, node._others, node.sent = [], {}, []
    node._commands = SimpleNamespace(publish=node.sent.append)
    node._said = SimpleNamespace(publish=lambda message: None)
    return node


def frame(node, now, verdict=Stamp.OK):
    node._poses.stamp = now
    node._on_frame(Frame(STAMP, verdict, {}, 0.02))
    twist = node.sent[-1].twist
    return twist.linear.x, twist.linear.y, twist.angular.z


def test_a_robot_that_is_not_seen_stands_also_while_it_is_tested():
    """A disc that does not move is told to turn; then its pose is missing."""
    item, robot = load_object("swarm_square"), load_robot("disc")
    agent = Agent("e0", SwarmJob(REGION, item, robot, SwarmJobSettings()), AgentSettings())
    node, now = agent_node(agent, AlonePoses(np.array([-1.0, 0.0, 0.0]))), 0.0
    while not agent.job.turns and now < 30.0:
        node._told = now = now + 0.02
        told = frame(node, now)
    assert told[2] != 0.0
    assert frame(node, now + 0.01, Stamp.REFUSED) == (0.0, 0.0, 0.0)
    node._poses.own = None
    for _ in range(100):
        now += 0.02
        node._messages.append(AgentState("e1", now - 0.02, np.zeros(3), np.zeros(2), {}))
        assert frame(node, now) == (0.0, 0.0, 0.0)
    assert not node._messages and not agent.job.busy  # the target has been silent, too


def test_messages_and_targets_from_before_the_clock_was_set_back_do_not_count():
    (agent,) = agents(1)
    node = agent_node(agent, AlonePoses(np.array([-1.0, 0.0, 0.0])))
    node._told = 300.0
    node._messages = [AgentState("e1", 300.0, np.zeros(3), np.zeros(2), {})]
    assert frame(node, 0.02) == (0.0, 0.0, 0.0)
    assert not agent.job.busy and not node._messages


@pytest.mark.long
def test_they_bring_an_object_to_its_pose_with_messages_lost(tmp_path):
    """A slice of the experiment swarm-decentralised."""
    task = MapTask(
        "transport_reference", 11, str(tmp_path), "transport_square", 5, True, "planar", "mild",
        600.0, 0.1,
    )  # fmt: skip
    row = run(task)
    assert row["success"], row["reason"]
    assert row["position_error_m"] < 0.11 and row["orientation_error_rad"] < 0.11
