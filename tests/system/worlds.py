"""A bridge in lockstep with further nodes, and one that commands robots by a law."""

import contextlib
from dataclasses import replace

import numpy as np
import rclpy
from rclpy.node import Node

from push_msgs.msg import Poses, Velocities
from push_record.recorder import RecorderNode
from push_ros.conversions import time_from_ros
from push_ros.process import Spinner
from push_ros.qos import COMMAND, STREAM
from push_scenario.scenario import scenario_from_mapping
from sim_bridge.node import BridgeNode


class Commander(Node):
    """Answers every frame with one message for all robots."""

    def __init__(self, robots, law, namespace=""):
        super().__init__("commander", namespace=namespace)
        self.robots, self.law, self.frames = list(robots), law, []
        prefix = self.get_namespace().rstrip("/")
        self.publisher = self.create_publisher(Velocities, prefix + "/cmd_vels", COMMAND)
        self.create_subscription(Poses, prefix + "/poses", self.on_poses, STREAM)

    def on_poses(self, message):
        self.frames.append(message)
        table = np.column_stack([message.x, message.y, message.theta])
        rows = {n: i for i, n in enumerate(message.names)}
        robots = [r for r in self.robots if r in rows]
        twists = self.law(table[[rows[r] for r in robots]], time_from_ros(message.header.stamp))
        answer = Velocities(names=robots)
        answer.header.stamp = message.header.stamp
        answer.header.frame_id = "base_link"
        answer.vx, answer.vy, answer.omega = (c.tolist() for c in twists.T)
        self.publisher.publish(answer)


@contextlib.contextmanager
def running(values, make=lambda bridge: [], folder=None, seed=1, patience=20.0):
    """The bridge of a scenario in lockstep, with further nodes and a recorder."""
    scenario = scenario_from_mapping(values, "test", "test").settings(
        "bridge", lockstep=True, seed=seed, lockstep_warning=patience
    )
    rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
    spinner, nodes = None, []
    try:
        nodes.append(BridgeNode(scenario, autostart=False))
        nodes += make(nodes[0])
        if folder is not None:
            # of a crowd the world's topics are recorded, not three for each robot
            first = dict(list(scenario.robots.items())[:20])
            nodes.append(RecorderNode(folder, replace(scenario, robots=first), seed))
        spinner = Spinner(nodes)
        listeners = len(nodes) - 1
        assert spinner.until(lambda: nodes[0].heard_by(listeners) and nodes[0].commanded(), 20.0)
        for _ in range(20):  # endpoints are matched a moment after they are known
            spinner.once(0.01)
        yield list(nodes), spinner
    finally:
        if spinner is None:
            for node in nodes:
                node.destroy_node()
        else:
            spinner.close()
        rclpy.try_shutdown()


def run_until(bridge, spinner, seconds):
    if not bridge.running:
        bridge.start()
    assert spinner.until(lambda: bridge.time >= seconds - 1e-9, 600.0), bridge.time


def ring_of(count, radius, robot):
    placement = {"kind": "ring", "centre": [0.0, 0.0], "radius": radius}
    return {"r": {"type": robot, "count": count, "placement": placement}}
