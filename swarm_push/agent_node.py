"""The node of one robot of a decentralised swarm.

It answers every frame of the pose stream with its robot's velocity and broadcasts its state to its
neighbours. From the stream it takes its own pose, the object's, and those of bodies outside its
swarm. The other robots' poses come from their messages. Messages from beyond the radius are
ignored, and a set fraction of the rest is dropped.
"""

import sys
from typing import Any

import numpy as np
from geometry_msgs.msg import TwistStamped
from rclpy._rclpy_pybind11 import RCLError
from rclpy.node import Node
from std_msgs.msg import Header

from push_estimation.pose_gate import PoseGateSettings, Stamp
from push_job.method import Arena, Unsuited
from push_model import se2
from push_model.arrays import Array
from push_model.belief import Belief
from push_model.occupancy import OccupancyGrid as Grid
from push_msgs.msg import SwarmAgentState, SwarmTarget
from push_ros.belief_feed import BeliefFeed
from push_ros.conversions import time_from_ros
from push_ros.diagnostics import Diagnostics
from push_ros.map_feed import MapFeed
from push_ros.names import names_of
from push_ros.parameters import declare_settings
from push_ros.pose_feed import Frame, PoseFeed
from push_ros.process import run_node
from push_ros.qos import CHATTER, COMMAND
from push_ros.scheduling import Urgency
from push_ros.validation import InvalidMessage
from push_scenario.scenario import Scenario, load_scenario
from swarm_push.agent import Agent, AgentSettings, AgentState
from swarm_push.swarm_messages import (
    agent_state_from_bytes,
    agent_state_to_ros,
    target_from_ros,
)
from swarm_push.swarm_method import SECTIONS, swarm_job


class SwarmAgentNode(Node):
    """One robot."""

    def __init__(
        self,
        scenario: Scenario | None = None,
        robot: str = "",
        robots: tuple[str, ...] = (),
        item: str = "",
        namespace: str = "",
        world: str = "",
    ) -> None:
        """robot: this one; robots, item: the swarm's. namespace: the team's; world: the bridge's,
        where it is another one."""
        super().__init__(f"agent_{robot}" if robot else "agent", namespace=namespace)
        names = names_of(self, world)
        name = self.declare_parameter("scenario", "swarm-square").value
        scenario = scenario or load_scenario(str(name))
        self.robot, self._spec = scenario.robot(str(self.declare_parameter("robot", robot).value))
        given = self.declare_parameter("robots", list(robots) or [""]).value
        self._team = frozenset(r for r in given if r) or frozenset(scenario.robots)
        self.object, self._item = scenario.object(str(self.declare_parameter("object", item).value))
        self.settings, gate = self._declare(scenario)
        self._behaviour: AgentSettings = self.settings["agents"]
        self._others = {
            k: r for k, r in scenario.radii.items() if k not in self._team and k != self.object
        }
        self.agent: Agent | None = None
        self._why_not = "there is no map yet"
        self._target: Array | None = None
        self._told = -np.inf  # [s] stamp of the last target
        self._messages: list[AgentState] = []
        self._diagnostics = Diagnostics(self, names, self._state)
        topic = names.robot(self.robot, "cmd_vel")
        self._commands = self.create_publisher(
            TwistStamped, topic, COMMAND, event_callbacks=self._diagnostics.publisher_events(topic)
        )
        self._said = self.create_publisher(
            SwarmAgentState, names.team("swarm_agent_states"), CHATTER
        )
        for kind, topic, handler, qos, raw in (
            (SwarmAgentState, names.team("swarm_agent_states"), self._on_neighbour, CHATTER, True),
            (SwarmTarget, names.team("swarm_target"), self._on_target, COMMAND, False),
        ):
            events = self._diagnostics.subscription_events(topic)
            self.create_subscription(kind, topic, handler, qos, event_callbacks=events, raw=raw)
        MapFeed(self, names, self._diagnostics, self._take_map)
        BeliefFeed(self, names, scenario, self._diagnostics, self._take_up)
        self._poses = PoseFeed(
            self,
            names,
            gate,
            [self.robot, self.object, *self._others],
            self._diagnostics,
            self._on_frame,
        )

    def _declare(self, scenario: Scenario) -> tuple[dict[str, Any], PoseGateSettings]:
        values = dict(scenario.parameters.get("swarm", {}))
        values.pop("roster", None)  # each robot has a node of its own
        classes = {**SECTIONS, "poses": PoseGateSettings}
        sections = {k: values.pop(k, {}) for k in classes if k}
        made: dict[str, Any] = {
            k: declare_settings(self, cls, sections[k], k, f"swarm.{k}")
            for k, cls in classes.items()
            if k
        }
        made[""] = declare_settings(self, SECTIONS[""], values, where="swarm")
        return made, made.pop("poses")

    # What comes

    def _take_map(self, grid: Grid) -> None:
        self.agent = None
        arena = Arena(grid, {self.robot: self._spec}, self.object, self._item, self.settings)
        try:
            self.agent = Agent(self.robot, swarm_job(arena), self._behaviour)
        except Unsuited as error:
            self._why_not = str(error)

    def _take_up(self, belief: Belief) -> None:
        """Go on with what is believed of the object now."""
        self._item = belief.object(self.object)
        if self.agent is not None:
            self.agent.job.believe(self._item)

    def _on_target(self, message: SwarmTarget) -> None:
        try:
            self._target = target_from_ros(message)
        except InvalidMessage as error:
            self._diagnostics.refuse("swarm_target", str(error))
            return
        self._told = time_from_ros(message.header.stamp)

    def _on_neighbour(self, data: bytes) -> None:
        try:
            heard = agent_state_from_bytes(data)
        except InvalidMessage as error:
            self._diagnostics.refuse("swarm_agent_states", str(error))
            return
        except (RuntimeError, RCLError) as error:
            self._diagnostics.refuse("swarm_agent_states", f"the message cannot be read: {error}")
            return
        if heard.name in self._team and heard.name != self.robot:
            self._messages.append(heard)

    # What it does

    def _on_frame(self, frame: Frame) -> None:
        twist, turn = (0.0, 0.0), 0.0
        if frame.verdict is Stamp.RESET:
            self._target, self._messages, self._told = None, [], -np.inf
            if self.agent is not None:
                self.agent.forget()
        elif frame.verdict is not Stamp.REFUSED:
            twist, turn = self._tick(frame.stamp)
        message = TwistStamped(header=Header(stamp=frame.stamp, frame_id="base_link"))
        if self.agent is not None and self.agent.job.holonomic:
            own = self._poses.pose(self.robot)
            turned = se2.rotation_matrix(-float(own[2])) @ twist if own is not None else twist
            message.twist.linear.x, message.twist.linear.y = (float(v) for v in turned)
            message.twist.angular.z = turn
        else:
            message.twist.linear.x, message.twist.angular.z = twist
        self._commands.publish(message)

    def _tick(self, stamp: Any) -> tuple[tuple[float, float], float]:
        """Do a step: the twist, and the turn rate [rad/s] of a robot that moves in any direction.
        The robot stands while its pose, that of the object or a target is missing."""
        item, own = self._poses.pose(self.object), self._poses.pose(self.robot)
        agent, now = self.agent, self._poses.stamp
        # Messages of this very frame come before or after it, at random: they count at the next.
        # Stamps far ahead are of a clock that has been set back since.
        heard = sorted((w for w in self._messages if w.time < now), key=lambda w: (w.time, w.name))
        latest = now + self._behaviour.forget
        self._messages = [w for w in self._messages if now <= w.time < latest]
        if agent is None:
            return (0.0, 0.0), 0.0
        agent.pursue(self._target if abs(now - self._told) < self._behaviour.silence else None)
        if item is None or own is None:
            return (0.0, 0.0), 0.0
        for message in heard:
            agent.hear(message)
        others = self._poses.discs(self._others)
        twist, message = agent.step(now, self._item.mass_pose(item), own, others)
        self._said.publish(agent_state_to_ros(stamp, message))
        return twist, float(agent.job.turns.get(self.robot, 0.0))

    def _state(self) -> dict[str, Any]:
        agent = self.agent
        if agent is None:
            return {"state": "IDLE", "reason": self._why_not}
        return {
            "state": agent.job.state.name,
            "reason": agent.job.reason,
            "robots heard": len(agent.neighbours),
            "poses refused": self._poses.gate.refused,
            "warning": "no poses" if self._poses.pose(self.robot) is None else "",
        }


def main() -> int:
    """Entry point of the process: ``--ros-args`` on its command line."""
    return run_node(SwarmAgentNode, urgency=Urgency.CONTROL)


if __name__ == "__main__":
    sys.exit(main())
