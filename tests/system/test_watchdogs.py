"""Wall-clock watchdogs: they hold when sim time or the pose stream stands still (FAULTS 7, 12)."""

import time

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import TwistStamped
from rclpy.action import ActionClient

from push_model import line
from push_msgs.action import FollowTrajectory
from push_msgs.msg import Poses
from push_ros.conversions import (
    poses_to_ros,
    time_from_ros,
    time_to_ros,
    trajectory_to_ros,
    twist_to_ros,
)
from push_ros.process import Spinner
from push_ros.qos import COMMAND, STREAM
from push_scenario.scenario import load_scenario

PLACE = np.array([-0.7, 0.0, 0.0])
PLACES = {"epuck1": PLACE, "box": np.array([0.0, 0.5, 0.0])}


@pytest.fixture
def node(ros):
    return rclpy.create_node("outside")


def test_wheels_stop_by_the_wall_clock_when_sim_time_crawls(node):
    """At a fiftieth of real time, 0.2 s of sim time are ten seconds."""
    from sim_bridge.node import BridgeNode

    bridge = BridgeNode(load_scenario("short").settings("bridge", real_time_factor=0.02))
    publisher = node.create_publisher(TwistStamped, "/epuck1/cmd_vel", COMMAND)
    spinner = Spinner([bridge, node])
    try:
        assert spinner.until(lambda: publisher.get_subscription_count() and bridge.tick > 1, 10.0)
        publisher.publish(twist_to_ros(0.05, 0.0, time_to_ros(bridge.time)))
        assert spinner.until(lambda: bridge.driving("epuck1"), 5.0)
        tick, started = bridge.tick, time.monotonic()
        assert spinner.until(lambda: not bridge.driving("epuck1"), 5.0)
        assert time.monotonic() - started >= 0.4
        assert (bridge.tick - tick) * bridge.period < bridge.settings.command_timeout
    finally:
        spinner.close()


class Stream:
    """A pose stream in the place of the bridge, and what the controller answers."""

    def __init__(self, node, spinner):
        self.node, self.spinner, self.tick = node, spinner, 100
        self.poses = node.create_publisher(Poses, "/poses", STREAM)
        self.commands = []
        node.create_subscription(TwistStamped, "/epuck1/cmd_vel", self.commands.append, COMMAND)
        self.client = ActionClient(node, FollowTrajectory, "/epuck1/follow_trajectory")

    def send(self, ticks, names=("epuck1", "box")):
        for _ in range(ticks):
            self.tick += 1
            frame = poses_to_ros({n: PLACES[n] for n in names}, 0.01 * self.tick)
            self.poses.publish(frame)
            answered = lambda: (  # noqa: E731
                self.commands
                and round(100 * time_from_ros(self.commands[-1].header.stamp)) >= self.tick
            )
            assert self.spinner.until(answered, 5.0)

    @property
    def moving(self):
        return bool(self.commands) and self.commands[-1].twist.linear.x > 0.0


@pytest.fixture
def stream(node):
    from push_mpc.node import ControllerNode

    controller = ControllerNode(load_scenario("short"), "epuck1")
    spinner = Spinner([controller, node])
    stream = Stream(node, spinner)
    stream.controller = controller
    assert spinner.until(
        lambda: stream.client.server_is_ready() and stream.poses.get_subscription_count() > 0, 10.0
    )
    stream.send(5)
    way = trajectory_to_ros(line(PLACE, 0.5, 0.1, 0.3))
    sent = stream.client.send_goal_async(FollowTrajectory.Goal(trajectory=way))
    assert spinner.until(sent.done, 5.0)
    stream.result = sent.result().get_result_async()
    stream.send(20)
    assert stream.moving
    yield stream
    spinner.close()


def test_a_silent_stream_stops_the_robot_and_its_return_starts_from_rest(stream):
    before = stream.commands[-1].twist.linear.x
    assert stream.spinner.until(lambda: not stream.moving, 2.0)
    stream.send(1)
    assert stream.commands[-1].twist.linear.x < 0.5 * before
    stream.send(15)
    assert stream.moving


def test_a_stream_that_stays_silent_ends_the_task(stream):
    assert stream.spinner.until(stream.result.done, 10.0)
    assert stream.result.result().result.error_code == FollowTrajectory.Result.POSES_STALE
    assert not stream.moving


def test_a_body_that_stays_unseen_in_a_live_stream_ends_the_task(stream):
    stream.send(30, names=("box",))
    assert not stream.moving
    stream.send(520, names=("box",))
    assert stream.spinner.until(stream.result.done, 5.0)
    result = stream.result.result().result
    assert result.error_code == FollowTrajectory.Result.POSES_STALE
    assert "epuck1" in result.error_msg


def test_heartbeats_from_the_future_are_refused(stream):
    """One wrong clock must not switch the watch on the supervisor off."""
    from std_msgs.msg import Header

    publisher = stream.node.create_publisher(Header, "/epuck1/heartbeat", STREAM)
    assert stream.spinner.until(lambda: publisher.get_subscription_count() > 0, 5.0)
    publisher.publish(Header(stamp=time_to_ros(1e6), frame_id="map"))
    refused = stream.controller.diagnostics.refused
    assert stream.spinner.until(lambda: refused.get("/epuck1/heartbeat", 0) == 1, 5.0)
