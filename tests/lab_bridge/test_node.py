"""The lab bridge as a node: robots stand in every fault."""

import math
from types import SimpleNamespace

import pytest
import rclpy
from geometry_msgs.msg import PoseArray, Twist, TwistStamped
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from lab_bridge.node import LabBridgeNode
from push_model.settings import SettingsError
from push_msgs.msg import Belief, Poses
from push_ros.conversions import time_from_ros, time_to_ros
from push_ros.process import Spinner
from push_ros.qos import BELIEF, COMMAND, LATCHED, STREAM
from push_scenario.scenario import load_scenario, scenario_from_mapping
from tests.lab_bridge.test_epuck2 import Peer
from tests.lab_bridge.test_pose_drivers import pose


def lab(**words):
    values = {
        "environment": "open",
        "robots": {
            n: {"type": "epuck", "start": [-0.5, y, 0.0]} for n, y in (("one", 0.0), ("two", 0.4))
        },
        "objects": {"box": {"type": "box9", "start": [0.0, 0.0, 0.0]}},
        "on": "lab",
        "lab": {
            "poses": {"kind": "pose_array", "topic": "/mocap", "order": ["one", "two", "box"]},
            "robots": {n: {"kind": "twist", "topic": f"/robots/{n}"} for n in ("one", "two")},
            "latency": 0.02,
            **words,
        },
        "parameters": {"lab_bridge": {"discovery_time": 0.0}},
    }
    return scenario_from_mapping(values, "mine", "mine.yaml")


class Arena:
    """A bridge, a motion capture and the robots' side, on one executor."""

    def __init__(self, scenario):
        self.bridge = LabBridgeNode(scenario)
        self.node = node = rclpy.create_node("arena")
        self.spinner = Spinner([self.bridge, node])
        self.capture = node.create_publisher(PoseArray, "/mocap", STREAM)
        self.commands = {
            n: node.create_publisher(TwistStamped, f"/{n}/cmd_vel", COMMAND) for n in ("one", "two")
        }
        self.told = {"one": [], "two": []}
        self.inputs = {n: self.listen(n) for n in self.told}
        self.poses, self.paused = [], []
        node.create_subscription(Poses, "/poses", self.poses.append, STREAM)
        node.create_subscription(Bool, "/paused", lambda m: self.paused.append(m.data), LATCHED)
        self.stamp = 50.0

    def listen(self, robot):
        def heard(message):
            self.told[robot].append((message.linear.x, message.angular.z))

        return self.node.create_subscription(Twist, f"/robots/{robot}", heard, COMMAND)

    def see(self, *xs, step=0.01):
        """A frame of motion capture."""
        self.stamp += step
        message = PoseArray(poses=[pose(x, 0.0) for x in xs or (-0.5, -0.4, 0.0)])
        message.header.stamp = time_to_ros(self.stamp)
        self.capture.publish(message)
        self.spinner.once(0.005)

    def drive(self, robot, v=0.05):
        message = TwistStamped()
        message.header.stamp = time_to_ros(self.stamp)
        message.twist.linear.x = v
        self.commands[robot].publish(message)
        self.spinner.once(0.005)

    def moves(self, robot):
        return bool(self.told[robot]) and self.told[robot][-1] != (0.0, 0.0)

    def until(self, condition, act=lambda: None, limit=5.0):
        def met():
            act()
            return condition()

        return self.spinner.until(met, limit)

    def up(self):
        """Everything is connected, and robot one drives."""

        def act():
            self.see()
            self.drive("one")

        assert self.until(lambda: self.moves("one") and self.poses, act)


@pytest.fixture
def arena(ros):
    made = Arena(lab())
    yield made
    made.spinner.close()


def test_poses_and_commands_go_through(arena):
    arena.up()
    message = arena.poses[-1]
    assert message.header.frame_id == "map" and list(message.names) == ["one", "two", "box"]
    assert list(message.x) == [-0.5, -0.4, 0.0]
    assert arena.told["one"][-1][0] == pytest.approx(0.05)
    assert not arena.moves("two") and arena.paused[-1] is False


def test_the_latency_is_told_to_all_nodes(arena):
    heard = []
    arena.node.create_subscription(Belief, "/belief", heard.append, BELIEF)
    assert arena.until(lambda: heard)
    assert list(heard[0].quantities) == ["latency"] and list(heard[0].values) == [0.02]


def test_no_command_stops_the_robot(arena, monkeypatch):
    arena.up()
    intake = arena.bridge._intake
    watched, looks = intake.watch, []

    def watch(now):
        found = watched(now)
        looks.append((now, bool(intake.gate.driving[0])))
        return found

    monkeypatch.setattr(intake, "watch", watch)
    last = arena.stamp  # the newest command is not younger
    assert arena.until(lambda: not arena.moves("one"), arena.see)
    # No look of the bridge after that lets the robot drive, however slow the machine is.
    limit = last + arena.bridge.settings.command_timeout + 0.01
    assert looks and not any(driving for now, driving in looks if now > limit)


def test_no_poses_stop_the_robot(arena):
    arena.up()
    assert arena.until(lambda: not arena.moves("one"), lambda: arena.drive("one"))
    arena.drive("one")  # and a command that answers old poses starts nothing
    assert arena.until(lambda: arena.bridge._diagnostics.refused.get("/one/cmd_vel"))
    assert not arena.moves("one")


def test_a_clock_that_goes_back_stops_the_robot(arena):
    arena.up()
    arena.stamp -= 20.0
    for _ in range(6):
        arena.see()
    assert arena.until(lambda: not arena.moves("one"))


def test_poses_that_cannot_be_are_not_published(arena):
    arena.up()
    began = arena.stamp
    for _ in range(5):
        arena.see(math.nan, -0.4, 5.0)  # and the box has jumped

    def later():
        return [m for m in arena.poses if time_from_ros(m.header.stamp) > began + 0.005]

    assert arena.until(lambda: len(later()) >= 3)
    assert {tuple(m.names) for m in later()} == {("two",)}


def test_when_a_robot_is_lost_nothing_moves(arena):
    arena.up()
    arena.node.destroy_subscription(arena.inputs["two"])

    def act():
        arena.see()
        arena.drive("one")

    assert arena.until(lambda: not arena.moves("one") and arena.paused[-1], act)
    assert "two: nobody listens on /robots/two" in arena.bridge._state()["warning"]
    arena.inputs["two"] = arena.listen("two")
    assert arena.until(lambda: arena.moves("one") and not arena.paused[-1], act)


def test_a_person_can_hold_everything(arena):
    arena.up()
    client = arena.node.create_client(SetBool, "/bridge/pause")
    assert arena.until(client.service_is_ready)

    def act():
        arena.see()
        arena.drive("one")

    done = client.call_async(SetBool.Request(data=True))
    assert arena.until(lambda: done.done() and not arena.moves("one"), act)
    for _ in range(10):
        act()
    assert not arena.moves("one")
    done = client.call_async(SetBool.Request(data=False))
    assert arena.until(lambda: done.done() and arena.moves("one"), act)


def test_the_end_of_the_bridge_is_a_stop(arena):
    arena.up()
    arena.bridge.stop()
    assert arena.until(lambda: not arena.moves("one"))


def test_a_second_bridge_is_refused(arena):
    with pytest.raises(SettingsError, match="a bridge already runs"):
        LabBridgeNode(lab())


def test_a_lost_epuck_holds_the_other_robot(ros):
    peer = Peer()
    robots = {
        "one": {"kind": "twist", "topic": "/robots/one"},
        "two": {"kind": "epuck2", "host": "127.0.0.1", "port": peer.port, "silence": 0.3},
    }
    arena = Arena(lab(robots=robots))
    links = SimpleNamespace(alive=True)
    peer.server.settimeout(0.0)

    def act():
        arena.see()
        arena.drive("one")
        if peer.client is None:
            try:
                peer.client, _ = peer.server.accept()
            except BlockingIOError:
                return
        if links.alive:
            peer.client.send(b"\x03")

    try:
        assert arena.until(lambda: arena.moves("one"), act)
        links.alive = False
        assert arena.until(lambda: not arena.moves("one"), act)
        assert "has not answered" in arena.bridge._state()["warning"]
        peer.client.close()
        peer.client, links.alive = None, True
        assert arena.until(lambda: arena.moves("one"), act, 10.0)
    finally:
        arena.spinner.close()
        peer.close()


def test_a_scenario_of_a_simulation_is_refused(ros):
    with pytest.raises(SettingsError, match="not for a lab"):
        LabBridgeNode(load_scenario("short"))


def test_torques_have_no_driver(ros):
    values = {
        "environment": "open",
        "robots": {"one": {"type": "pioneer", "start": [-0.5, 0.0, 0.0]}},
        "on": "lab",
        "lab": {
            "poses": {"kind": "tf"},
            "robots": {"one": {"kind": "twist", "topic": "/one"}},
        },
    }
    with pytest.raises(SettingsError, match="wheel torques"):
        LabBridgeNode(scenario_from_mapping(values, "mine", "mine.yaml"))
