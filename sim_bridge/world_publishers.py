"""What the bridge tells of its world. Messages that nobody reads are not even made."""

import os
from collections.abc import Sequence
from typing import Any

from nav_msgs.msg import OccupancyGrid
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, String
from visualization_msgs.msg import MarkerArray

from push_model.kinematics import DifferentialDrive
from push_msgs.msg import Contacts, Poses
from push_ros.conversions import (
    contacts_to_ros,
    frame_to_ros,
    grid_to_ros,
    time_to_ros,
    transform_to_ros,
)
from push_ros.diagnostics import Diagnostics
from push_ros.names import Names
from push_ros.qos import CLOCK, LATCHED, STATUS, STREAM
from push_scenario.scenario import Scenario
from sim_bridge.markers import body_markers
from sim_bridge.motion_capture import Frame
from sim_bridge.world import BodyContacts, BodyPoses, World
from tf2_msgs.msg import TFMessage

_LOOK = 10
"""Ticks between two looks at who listens to the joint states."""
_MARKERS = 5
"""Frames of tf to a frame of markers."""


class WorldPublishers:
    """Clock, pace, poses, ground truth, contacts, wheels, tf, markers, map, scenario."""

    def __init__(self, node: Node, names: Names, diagnostics: Diagnostics, lockstep: bool) -> None:
        """lockstep: whether the world waits for its controllers; published for all nodes."""
        self._node, self._names = node, names
        name, make = names.world, node.create_publisher
        self._clock = make(Clock, name("clock"), CLOCK)
        self.poses = make(
            Poses,
            name("poses"),
            STREAM,
            event_callbacks=diagnostics.publisher_events(name("poses")),
        )
        diagnostics.watch_publishers(name("poses"))
        self._truth = make(Poses, name("ground_truth/poses"), STREAM)
        self._contacts = make(Contacts, name("contacts"), STREAM)
        self._tf = make(TFMessage, name("tf"), STATUS)
        self._markers = make(MarkerArray, name("visualization"), STATUS)
        self._map = make(OccupancyGrid, name("map"), LATCHED)
        self._scenario = make(String, name("scenario"), LATCHED)
        self._paused = make(Bool, name("paused"), LATCHED)
        self.paused(False)
        self._lockstep = make(Bool, name("lockstep"), LATCHED)
        self._lockstep.publish(Bool(data=lockstep))
        self._run, self._runs = make(String, name("world_run"), LATCHED), 0
        self._joints: dict[str, Any] = {}
        self._heard: Sequence[str] = ()

    def scenario(self, scenario: Scenario) -> None:
        """A new scenario: its text, its map, its robots with wheels."""
        self._scenario.publish(String(data=scenario.text))
        self._map.publish(grid_to_ros(scenario.grid, 0.0))
        for publisher in self._joints.values():
            self._node.destroy_publisher(publisher)
        self._joints = {
            robot: self._node.create_publisher(
                JointState, self._names.robot(robot, "joint_states"), STREAM
            )
            for robot, (spec, _) in scenario.robots.items()
            if isinstance(spec.drive, DifferentialDrive)
        }
        self._heard = ()

    def begin(self) -> None:
        """The world is at its start: a run of its own, told from all others."""
        self._runs += 1
        self._run.publish(String(data=f"{os.getpid()}.{self._runs}"))

    def paused(self, paused: bool) -> None:
        """Whether the world stands still."""
        self._paused.publish(Bool(data=paused))

    @property
    def contacts_heard(self) -> bool:
        """Whether anybody wants to know of contacts."""
        return bool(self._contacts.get_subscription_count())

    def truth(
        self,
        world: World,
        poses: BodyPoses,
        contacts: BodyContacts | None,
        tick: int,
        seconds: float,
    ) -> None:
        """What is so at a time [s] of the simulation. contacts: where somebody wants them."""
        if self._clock.get_subscription_count():
            self._clock.publish(Clock(clock=time_to_ros(seconds)))
        if self._truth.get_subscription_count():
            self._truth.publish(frame_to_ros(poses.names, poses.table, seconds))
        if contacts is not None and self.contacts_heard:
            self._contacts.publish(contacts_to_ros(contacts, seconds))
        if tick % _LOOK == 1:
            self._heard = [r for r, p in self._joints.items() if p.get_subscription_count()]
        for robot in self._heard:
            self._wheels(world, robot, seconds)

    def _wheels(self, world: World, robot: str, seconds: float) -> None:
        state = world.wheel_state(robot)
        if state is None or robot not in world.names:
            return
        message = JointState(name=["left_wheel", "right_wheel"])
        message.header.stamp = time_to_ros(seconds)
        message.header.frame_id = robot
        message.position = state.angle.tolist()
        message.velocity = state.speed.tolist()
        message.effort = state.torque.tolist()
        self._joints[robot].publish(message)

    def seen(self, frame: Frame, seconds: float) -> None:
        """A frame of motion capture, measured at a time [s]."""
        self.poses.publish(frame_to_ros(frame.poses.names, frame.poses.table, seconds))

    def look(self, scenario: Scenario, frame: Frame, turn: int, seconds: float) -> None:
        """A frame of motion capture, to look at. turn: its number; markers come more rarely."""
        if self._tf.get_subscription_count():
            transforms = [transform_to_ros(n, p, seconds) for n, p in frame.poses.items()]
            self._tf.publish(TFMessage(transforms=transforms))
        if turn % _MARKERS == 0 and self._markers.get_subscription_count():
            self._markers.publish(body_markers(scenario, frame.poses, seconds))
