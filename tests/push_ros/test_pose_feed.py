"""The pose stream as nodes take it: FAULTS 1, 9, 10, 21, 23, 25."""

import math

import numpy as np
import pytest
import rclpy
from std_msgs.msg import Bool

from push_estimation.pose_gate import PoseGateSettings, Stamp
from push_msgs.msg import Poses
from push_ros.conversions import poses_from_ros, poses_to_ros
from push_ros.diagnostics import Diagnostics
from push_ros.names import Names
from push_ros.pose_feed import PoseFeed
from push_ros.process import Spinner
from push_ros.qos import LATCHED, STREAM
from push_ros.validation import InvalidMessage


class World:
    """A node that feeds on poses, and one that sends them."""

    def __init__(self, period=0.0):
        self.node, self.other = rclpy.create_node("feeder"), rclpy.create_node("source")
        names = Names("/", "/")
        self.diagnostics = Diagnostics(self.node, names, dict)
        self.frames = []
        settings = PoseGateSettings()
        self.feed = PoseFeed(
            self.node, names, settings, ["a"], self.diagnostics, self.frames.append, period
        )
        self.publisher = self.other.create_publisher(Poses, "/poses", STREAM)
        self.spinner = Spinner([self.node, self.other])
        assert self.spinner.until(lambda: self.publisher.get_subscription_count() > 0, 15.0)

    def send(self, x, stamp, name="a"):
        self.feed.take(poses_to_ros({name: np.array([x, 0.0, 0.0])}, stamp))
        return self.frames[-1]


@pytest.fixture
def world(ros):
    world = World()
    yield world
    world.spinner.close()


def test_frames_arrive_and_strangers_are_not_kept(world):
    message = poses_to_ros({"a": np.array([1.0, 2.0, 0.5]), "b": np.zeros(3)}, 1.0)
    world.publisher.publish(message)
    assert world.spinner.until(lambda: world.frames, 15.0)
    (frame,) = world.frames
    assert frame.verdict is Stamp.OK and list(frame.seen) == ["a"] and frame.elapsed == 0.0
    assert world.feed.pose("a") == pytest.approx([1.0, 2.0, 0.5])
    assert world.feed.pose("b") is None
    assert world.send(1.0, 1.25).elapsed == pytest.approx(0.0)  # an interruption, not a tick
    assert world.send(1.0, 1.26).elapsed == pytest.approx(0.01)


def test_a_wild_stamp_is_refused_and_said(world):
    world.send(0.0, 10.0)
    frame = world.send(0.0, 9000.0)
    assert frame.verdict is Stamp.REFUSED and not frame.seen
    assert "+8990" in world.diagnostics.last_refusal
    assert world.send(0.001, 10.01).verdict is Stamp.OK
    assert world.feed.stamp == pytest.approx(10.01)


def test_frames_that_are_none_change_nothing(world):
    world.send(0.5, 1.0)
    wrong = poses_to_ros({"a": np.zeros(3)}, 1.01)
    wrong.header.frame_id = "odom"
    short = poses_to_ros({"a": np.zeros(3)}, 1.01)
    short.y = []
    for message in (wrong, short):
        world.feed.take(message)
    world.feed._on_data(b"\x00\x01\x00\x00garbage")
    assert len(world.frames) == 1 and world.feed.pose("a")[0] == 0.5
    assert world.diagnostics.refused["/poses"] == 3


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e300])
def test_a_pose_that_is_not_plausible_is_refused_alone(world, bad):
    frame = world.send(bad, 1.0)
    assert frame.verdict is Stamp.OK and not frame.seen
    assert world.feed.pose("a") is None and world.feed.gate.refused == 1


def test_quick_frames_are_left_out_where_a_period_is_given(ros):
    world = World(period=0.045)
    for tick in range(100, 150):
        world.publisher.publish(poses_to_ros({"a": np.zeros(3)}, tick / 100))
        world.spinner.once(0.01)
    assert world.spinner.until(lambda: world.feed.stamp > 1.44, 15.0)
    assert 8 <= len(world.frames) <= 11
    world.spinner.close()


class Wall:
    """A wall clock that is set by hand, in the place of ``time``."""

    def __init__(self):
        self.seconds = 1000.0

    def monotonic(self):
        return self.seconds


@pytest.fixture
def wall(monkeypatch):
    wall = Wall()
    monkeypatch.setattr("push_ros.pace_feed.time", wall)
    return wall


def say(world, topic, value):
    """Publish a latched flag of the bridge's and have it heard."""
    publisher = world.other.create_publisher(Bool, f"/{topic}", LATCHED)
    publisher.publish(Bool(data=value))
    assert world.spinner.until(lambda: getattr(world.feed.clock, topic) is value, 15.0)
    return publisher


def test_a_pause_is_no_silence(wall, ros):
    world = World()
    world.send(0.0, 1.0)
    wall.seconds += 0.2
    assert world.feed.silence == pytest.approx(0.2)
    pause = say(world, "paused", True)
    wall.seconds += 100.0
    assert world.feed.paused and world.feed.silence == 0.0
    pause.publish(Bool(data=False))
    assert world.spinner.until(lambda: not world.feed.paused, 15.0)
    assert world.feed.silence == pytest.approx(0.2)  # the pause is left out
    wall.seconds += 99.0
    assert world.feed.silence == pytest.approx(99.2)
    world.send(0.0, 1.01)
    assert world.feed.silence == 0.0
    world.spinner.close()


def test_in_lockstep_only_the_time_of_the_poses_counts(wall, ros):
    """FAULTS 30: the process may stand still for as long as it likes."""
    world = World()
    clock = world.feed.clock
    world.send(0.0, 1.0)
    wall.seconds += 3.0
    live = clock.now
    say(world, "lockstep", True)
    assert clock.now == live  # what passed live has been counted
    wall.seconds += 1e6
    assert world.feed.silence == 0.0 and clock.now == live
    world.send(0.0, 1.1)
    wall.seconds += 1e6
    assert clock.now == pytest.approx(live + 0.1)
    for k in range(4):  # a reset of the clock: the new stream counts from where it begins
        world.send(0.0, 0.1 + 0.01 * k)
    assert live + 0.1 <= clock.now <= live + 0.131
    say(world, "lockstep", False)
    before = clock.now
    wall.seconds += 2.0
    assert clock.now == pytest.approx(before + 2.0)
    world.spinner.close()


def test_a_second_source_is_warned_of_as_long_as_it_is_there(world):
    """FAULTS 23."""
    world.diagnostics.publish()
    assert not world.diagnostics.rivals
    second = world.other.create_publisher(Poses, "/poses", STREAM)
    assert world.spinner.until(lambda: world.node.count_publishers("/poses") == 2, 15.0)
    world.diagnostics.publish()
    assert world.diagnostics.rivals == {"/poses"}
    world.other.destroy_publisher(second)
    assert world.spinner.until(lambda: world.node.count_publishers("/poses") == 1, 15.0)
    world.diagnostics.publish()
    assert not world.diagnostics.rivals


def test_frames_survive_the_way_there_and_back():
    random = np.random.default_rng(5)
    for _ in range(200):
        count = int(random.integers(0, 30))
        poses = {f"r{i}": random.uniform([-9, -9, -3.1], [9, 9, 3.1]) for i in range(count)}
        back, refused = poses_from_ros(poses_to_ros(poses, 1.0))
        assert not refused and list(back) == list(poses)
        for name, pose in poses.items():
            assert np.array_equal(back[name], pose)


def test_a_name_that_stands_twice_and_an_angle_beyond_pi():
    message = Poses(names=["a", "a", "b"], x=[1.0, 2.0, 0.0], y=[0.0] * 3, theta=[0.0, 0.0, 7.0])
    poses, refused = poses_from_ros(message)
    assert poses["a"][0] == 1.0 and len(refused) == 1
    assert poses["b"][2] == pytest.approx(7.0 - 2 * math.pi)
    message.x = [1.0]
    with pytest.raises(InvalidMessage):
        poses_from_ros(message)
