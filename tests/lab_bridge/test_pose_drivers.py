"""What each pose driver hears, and what it refuses; the same for drivers of robots on topics."""

import math
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import Pose, PoseArray, PoseStamped, TransformStamped, Twist, TwistStamped
from std_msgs.msg import Float64MultiArray

from lab_bridge.pose_drivers import PoseHost, make_pose_driver
from lab_bridge.poses_named_pose_array import NamedPoseArrayDriver
from lab_bridge.robot_drivers import RobotHost, make_robot_driver
from push_model.settings import SettingsError
from push_ros.conversions import time_to_ros
from push_ros.process import Spinner
from push_ros.qos import COMMAND, STREAM
from push_scenario.bodies import load_robot
from push_scenario.lab import (
    MotionCaptureSource,
    NamedPoseArraySource,
    OtherLink,
    OtherSource,
    PoseArraySource,
    PoseStampedSource,
    TransformSource,
    TwistLink,
    WheelsLink,
)
from tf2_msgs.msg import TFMessage


class Sink:
    """Keeps what it is told."""

    def __init__(self):
        self.parts, self.frames, self.refused = [], [], []

    def part(self, marker, seen, stamp):
        self.parts.append((marker, seen, stamp))

    def frame(self, seen, stamp):
        self.frames.append((seen, stamp))

    def refuse(self, where, reason):
        self.refused.append(reason)


@pytest.fixture
def bench(ros):
    """A node with a sink, and a spinner."""
    node = rclpy.create_node("lab")
    spinner = Spinner([node])
    sink = Sink()
    yield SimpleNamespace(
        node=node, sink=sink, spinner=spinner, host=PoseHost(node, sink, ("A", "B"), ("/poses",))
    )
    spinner.close()


def pose(x, yaw):
    made = Pose()
    made.position.x = x
    made.orientation.z, made.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return made


def say(bench, kind, topic, message, count, qos=STREAM):
    publisher = bench.node.create_publisher(kind, topic, qos)
    assert bench.spinner.until(lambda: publisher.get_subscription_count() > 0, 5.0)
    publisher.publish(message)
    assert bench.spinner.until(count, 5.0)


def stamped(kind, **words):
    message = kind(**words)
    message.header.stamp = time_to_ros(12.5)
    return message


def test_pose_stamped(bench):
    make_pose_driver(bench.host, PoseStampedSource(topic="/vrpn/{name}/pose"))
    message = stamped(PoseStamped, pose=pose(0.4, 1.0))
    say(bench, PoseStamped, "/vrpn/B/pose", message, lambda: bool(bench.sink.parts))
    ((marker, seen, stamp),) = bench.sink.parts
    assert (marker, stamp) == ("B", 12.5)
    assert seen.position.tolist() == [0.4, 0.0, 0.0]
    assert seen.quaternion == pytest.approx([0, 0, math.sin(0.5), math.cos(0.5)])


def test_pose_array(bench):
    make_pose_driver(bench.host, PoseArraySource(topic="/p", order=("B", "other", "A")))
    message = stamped(PoseArray, poses=[pose(1.0, 0), pose(2.0, 0), pose(3.0, 0)])
    say(bench, PoseArray, "/p", message, lambda: bool(bench.sink.frames))
    ((seen, stamp),) = bench.sink.frames
    assert {k: m.position[0] for k, m in seen.items()} == {"B": 1.0, "other": 2.0, "A": 3.0}
    assert stamp == 12.5
    short = stamped(PoseArray, poses=[pose(1.0, 0)])
    say(bench, PoseArray, "/p", short, lambda: bool(bench.sink.refused))
    assert "1 poses, not the 3" in bench.sink.refused[0]


def test_transforms(bench):
    make_pose_driver(bench.host, TransformSource(topic="/mocap_tf", frame="mocap"))
    message = TFMessage()
    for frame, child in (("map", "A"), ("mocap", "B")):
        t = TransformStamped(child_frame_id=child)
        t.header.frame_id, t.header.stamp = frame, time_to_ros(12.5)
        t.transform.translation.y = 0.7
        message.transforms.append(t)
    say(bench, TFMessage, "/mocap_tf", message, lambda: bool(bench.sink.parts))
    ((marker, seen, stamp),) = bench.sink.parts
    assert (marker, stamp, seen.position[1]) == ("B", 12.5, 0.7)


def test_named_pose_array_is_read_by_its_fields(bench):
    """Its package is part of a ROS installation; the driver is tried with an object of the same
    fields: header, poses of name and pose."""
    driver = NamedPoseArrayDriver.__new__(NamedPoseArrayDriver)
    driver._host = bench.host
    named = [
        SimpleNamespace(name="A", pose=pose(0.1, 0)),
        SimpleNamespace(name="B", pose=pose(0.2, 0)),
    ]
    header = SimpleNamespace(stamp=time_to_ros(12.5))
    driver.take(SimpleNamespace(header=header, poses=named))
    ((seen, stamp),) = bench.sink.frames
    assert {k: m.position[0] for k, m in seen.items()} == {"A": 0.1, "B": 0.2} and stamp == 12.5


def test_named_pose_array_on_a_topic(bench):
    """Where its package is installed."""
    messages = pytest.importorskip("motion_capture_tracking_interfaces.msg")
    make_pose_driver(bench.host, NamedPoseArraySource())
    named = messages.NamedPose(name="A", pose=pose(0.4, 0))
    message = stamped(messages.NamedPoseArray, poses=[named])
    say(bench, messages.NamedPoseArray, "/mocap/poses", message, lambda: bool(bench.sink.frames))
    ((seen, stamp),) = bench.sink.frames
    assert seen["A"].position[0] == 0.4 and stamp == 12.5


def test_named_pose_array_without_its_package(bench, monkeypatch):
    monkeypatch.setitem(sys.modules, "motion_capture_tracking_interfaces.msg", None)
    with pytest.raises(SettingsError, match="motion_capture_tracking_interfaces is needed"):
        make_pose_driver(bench.host, NamedPoseArraySource())


def test_the_library_with_its_mock_server(bench):
    pytest.importorskip("motioncapture")
    bodies = "A(1,2,3,1,0,0,0);B(0.5,0,0,0.5,0.5,0.5,0.5)"
    source = MotionCaptureSource(system="mock", options={"rigid_bodies": bodies})
    driver = make_pose_driver(bench.host, source)
    assert bench.spinner.until(lambda: len(bench.sink.frames) >= 10, 5.0)
    seen, stamp = bench.sink.frames[-1]
    assert seen["A"].position.tolist() == [1.0, 2.0, 3.0] and stamp is None
    assert seen["B"].quaternion.tolist() == [0.5, 0.5, 0.5, 0.5]
    driver.close()


def test_the_library_is_optional(bench, monkeypatch):
    monkeypatch.setitem(sys.modules, "motioncapture", None)
    with pytest.raises(SettingsError, match=r"pip install 'planar-push\[lab\]'"):
        make_pose_driver(bench.host, MotionCaptureSource(system="mock", options={}))


def test_a_server_that_fails_is_reported(bench):
    pytest.importorskip("motioncapture")
    driver = make_pose_driver(bench.host, MotionCaptureSource(system="nothing", options={}))
    assert bench.spinner.until(lambda: bool(bench.sink.refused), 5.0)
    driver.close()


@pytest.mark.parametrize(
    ("source", "words"),
    [
        (PoseStampedSource(topic="/one"), "must contain {name}"),
        (PoseArraySource(topic="/p", order=("A",)), r"\['B'\] is missing"),
        (PoseArraySource(topic="/poses", order=("A", "B")), "remapping /poses:=/mocap/poses"),
        (PoseArraySource(topic="/a b", order=("A", "B")), "no name of a topic"),
        (OtherSource(driver="nowhere"), "expected MODULE:ATTRIBUTE"),
        (OtherSource(driver="no.such.module:X"), "no.such"),
    ],
)
def test_sources_that_cannot_be(bench, source, words):
    with pytest.raises(SettingsError, match=words):
        make_pose_driver(bench.host, source)


MADE = []


class Outside:
    """A pose driver and a robot driver of somebody else."""

    sources = ("mine",)
    trouble = ""

    def __init__(self, host, settings):
        MADE.append((host, settings))


def test_drivers_from_outside_the_packages(bench):
    MADE.clear()
    name = f"{__name__}:Outside"
    made = make_pose_driver(bench.host, OtherSource(driver=name, settings={"port": 5}))
    host = RobotHost(bench.node, "r", load_robot("epuck"), 50.0)
    make_robot_driver(host, OtherLink(driver=name, settings={"gain": 2}))
    assert isinstance(made, Outside)
    assert [(bench.host, {"port": 5}), (host, {"gain": 2})] == MADE


def robot_driver(bench, link, kind="epuck"):
    return make_robot_driver(RobotHost(bench.node, "r", load_robot(kind), 50.0), link)


@pytest.mark.parametrize("with_stamp", [False, True])
def test_twists(bench, with_stamp):
    driver = robot_driver(bench, TwistLink(topic="/r/cmd", stamped=with_stamp))
    assert driver.trouble == "nobody listens on /r/cmd"
    heard = []
    kind = TwistStamped if with_stamp else Twist
    bench.node.create_subscription(kind, "/r/cmd", heard.append, COMMAND)
    assert bench.spinner.until(lambda: driver.trouble == "", 5.0)
    driver.command(np.array([0.1, 0.0, -0.4]), 0.0)
    driver.close(0.001)
    assert bench.spinner.until(lambda: len(heard) == 2, 5.0)
    twists = [m.twist if with_stamp else m for m in heard]
    assert [(t.linear.x, t.angular.z) for t in twists] == [(0.1, -0.4), (0.0, 0.0)]
    if with_stamp:
        assert abs(heard[0].header.stamp.sec - time.time()) < 60


def test_wheel_speeds(bench):
    link = WheelsLink(topic="/r/wheels", scale=-10.0, left_first=False)
    driver = robot_driver(bench, link)
    heard = []
    bench.node.create_subscription(Float64MultiArray, "/r/wheels", heard.append, COMMAND)
    assert bench.spinner.until(lambda: driver.trouble == "", 5.0)
    driver.command(np.array([0.041, 0.0, 1.0]), 0.0)
    assert bench.spinner.until(lambda: len(heard) == 1, 5.0)
    # 0.041 m/s on 20.5 mm is 2 rad/s; 1 rad/s on 26.5 mm is 1.2927 rad/s; right comes first
    assert list(heard[0].data) == pytest.approx([-32.927, -7.073], abs=1e-3)
    driver.poll(0.2)  # repeated for the robot's own watchdog
    assert bench.spinner.until(lambda: len(heard) == 2, 5.0)


def test_wheels_need_wheels(bench):
    with pytest.raises(SettingsError, match="no wheels"):
        robot_driver(bench, WheelsLink(topic="/r/w"), "disc")
    with pytest.raises(SettingsError, match="must not be 0"):
        robot_driver(bench, WheelsLink(topic="/r/w", scale=0.0))
