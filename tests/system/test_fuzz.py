"""FAULTS 17 and 21: mismatched QoS, garbage and random valid messages on every input."""

import math

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Header

from push_msgs.action import FollowTrajectory, MoveObject, PlanPush
from push_msgs.msg import Poses
from push_msgs.srv import LoadScenario, PlanRobotPath, Reset
from push_ros.qos import COMMAND, LATCHED, STATUS, STREAM
from push_scenario.scenario import load_scenario
from push_study.graph_run import LockstepRun

SPECIAL = [0.0, -1.0, 1.0, 1e-300, 1e300, math.nan, math.inf, -math.inf, 0.3]
INPUTS = {
    "/poses": (Poses, STREAM),
    "/goal_pose": (PoseStamped, COMMAND),
    "/map": (OccupancyGrid, LATCHED),
    "/epuck1/heartbeat": (Header, STREAM),
    "/epuck1/cmd_vel": (TwistStamped, COMMAND),
}


@pytest.fixture
def run():
    with LockstepRun(load_scenario("short"), quiet=True) as run:
        run.start()
        yield run


def randomise(message, random):
    """Fill a message with special numbers, odd strings and short lists, of the right types."""
    for name, kind in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        if isinstance(value, bool):
            continue
        if isinstance(value, float):
            setattr(message, name, float(random.choice(SPECIAL)))
        elif isinstance(value, int):
            setattr(message, name, int(random.integers(0, 100)))
        elif isinstance(value, str):
            setattr(message, name, str(random.choice(["", "map", "epuck1", "box", "\u2603"])))
        elif hasattr(value, "get_fields_and_field_types"):
            randomise(value, random)
        elif kind == "sequence<string>":
            names = ["", "epuck1", "box", "\u2603"]
            setattr(message, name, [str(n) for n in random.choice(names, random.integers(0, 4))])
        elif kind.startswith("sequence<int8"):
            setattr(message, name, [0] * int(random.integers(0, 30)))
        elif kind.startswith("sequence<double"):
            setattr(message, name, random.choice(SPECIAL, random.integers(0, 4)).tolist())
    return message


ACTIONS = {
    "/plan_push": PlanPush,
    "/epuck1/follow_trajectory": FollowTrajectory,
    "/move_object": MoveObject,
}


def spin(run, seconds):
    end = run.bridge.time + seconds
    run.spin_until(lambda: run.bridge.time >= end, seconds, 5.0)


@pytest.mark.long
@pytest.mark.parametrize("busy", [False, True])
@pytest.mark.parametrize("seed", range(2))
def test_random_messages_and_random_bytes_crash_nothing(run, seed, busy):
    """On every topic, action and service, at rest and in mid-job: all stays finite, and when it is
    over the suite does what it is asked to."""
    random = np.random.default_rng(seed)
    node = run.observer
    publishers = {t: node.create_publisher(m, t, q) for t, (m, q) in INPUTS.items()}
    clients = {t: ActionClient(node, a, t) for t, a in ACTIONS.items()}
    paths = node.create_client(PlanRobotPath, "/plan_robot_path")
    scenes = node.create_client(LoadScenario, "/bridge/load_scenario")
    assert run.spinner.until(
        lambda: (
            all(p.get_subscription_count() > 0 for p in publishers.values())
            and all(c.server_is_ready() for c in clients.values())
            and paths.service_is_ready()
            and scenes.service_is_ready()
        ),
        5.0,
    )
    commands = []
    node.create_subscription(TwistStamped, "/epuck1/cmd_vel", commands.append, COMMAND)
    if busy:
        node.send_goal(run.scenario.goal)
        spin(run, 2.0)
    for _ in range(40):
        for topic, publisher in publishers.items():
            kind = INPUTS[topic][0]
            publisher.publish(randomise(kind(), random))
            publisher.publish(bytes(random.integers(0, 256, random.integers(4, 60)).tolist()))
        for topic, client in clients.items():
            client.send_goal_async(randomise(ACTIONS[topic].Goal(), random))
        paths.call_async(randomise(PlanRobotPath.Request(), random))
        scenes.call_async(randomise(LoadScenario.Request(), random))
        for _ in range(30):
            run.spinner.once(0.002)
    spin(run, 0.5)
    assert np.isfinite(np.array(run.observer.trace.robot)).all()
    assert np.isfinite(np.array(run.observer.trace.object)).all()
    assert np.isfinite(run.bridge.world.poses()["epuck1"]).all()
    ours = [c for c in commands if c.header.frame_id == "base_link"]
    assert ours and all(
        math.isfinite(c.twist.linear.x) and math.isfinite(c.twist.angular.z) for c in ours
    )
    reset = node.create_client(Reset, "/bridge/reset")
    assert run.spinner.until(reset.service_is_ready, 5.0)
    done = reset.call_async(Reset.Request())
    assert run.spinner.until(done.done, 5.0)
    spin(run, 0.5)
    state = run.reach(run.scenario.goal)
    assert state is not None and state.error_code == 0, state


def test_every_node_publishes_diagnostics_and_counts_what_it_refuses(run):
    """FAULTS 1: what is refused is seen from outside."""
    statuses = {}

    def keep(message):
        for status in message.status:
            statuses[status.name] = status

    node = run.observer
    node.create_subscription(DiagnosticArray, "/diagnostics", keep, STATUS)
    publisher = node.create_publisher(Poses, "/poses", STREAM)
    assert run.spinner.until(lambda: publisher.get_subscription_count() >= 2, 5.0)
    bad = Poses(names=["box"], x=[0.0], y=[0.0], theta=[0.0])
    bad.header.frame_id = "odom"
    bad.header.stamp.nanosec = 1
    for _ in range(3):
        publisher.publish(bad)
        spin(run, 0.2)

    def refused(name):
        status = statuses.get(name)
        return status is not None and any(
            v.key == "refused /poses" and int(v.value) > 0 for v in status.values
        )

    assert run.spinner.until(lambda: refused("epuck1/controller") and refused("supervisor"), 10.0)
    names = {"bridge", "planner", "epuck1/controller", "supervisor"}
    assert run.spinner.until(lambda: names <= set(statuses), 10.0), set(statuses)
    # FAULTS 23: this test is a second source of poses
    assert run.spinner.until(lambda: statuses["bridge"].level == DiagnosticStatus.WARN, 10.0)
    assert "2 publishers on /poses" in statuses["bridge"].message
    run.observer.destroy_publisher(publisher)
    assert run.spinner.until(lambda: statuses["bridge"].level == DiagnosticStatus.OK, 10.0)


def test_mismatched_qos_shows_in_diagnostics(run):
    weak = QoSProfile(
        depth=1, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE
    )
    publisher = run.observer.create_publisher(PoseStamped, "/goal_pose", weak)
    mismatches = run.supervisor._diagnostics.qos_mismatches
    assert run.spinner.until(lambda: mismatches.get("/goal_pose", 0) > 0, 5.0)
    run.observer.destroy_publisher(publisher)
