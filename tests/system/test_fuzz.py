"""FAULTS 17 and 21: mismatched QoS, garbage and random valid messages on every input."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Header

from push_bringup.lockstep import LockstepRun
from push_msgs.msg import NamedPose, NamedPoses
from push_ros.qos import COMMAND, LATCHED, STREAM
from push_ros.scenario import load_scenario

SPECIAL = [0.0, -1.0, 1.0, 1e-300, 1e300, math.nan, math.inf, -math.inf, 0.3]
INPUTS = {
    "/poses": (NamedPoses, STREAM),
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
        elif kind.startswith("sequence<push_msgs/NamedPose"):
            message.poses = [randomise(NamedPose(), random) for _ in range(random.integers(0, 4))]
        elif kind.startswith("sequence<int8"):
            setattr(message, name, [0] * int(random.integers(0, 30)))
    return message


def test_random_messages_and_random_bytes_crash_nothing_and_move_nothing(run):
    random = np.random.default_rng(5)
    node = run.observer
    publishers = {t: node.create_publisher(m, t, q) for t, (m, q) in INPUTS.items()}
    assert run.spinner.until(
        lambda: all(p.get_subscription_count() > 0 for p in publishers.values()), 5.0
    )
    commands = []
    node.create_subscription(TwistStamped, "/epuck1/cmd_vel", commands.append, COMMAND)
    start = None
    for round_number in range(60):
        for topic, publisher in publishers.items():
            kind = INPUTS[topic][0]
            if topic == "/map" and round_number > 5:
                continue  # a random map is refused; a valid tiny one would blind the planner
            publisher.publish(randomise(kind(), random))
            publisher.publish(bytes(random.integers(0, 256, random.integers(4, 60)).tolist()))
        for _ in range(30):
            run.spinner.once(0.002)
        if start is None and run.observer.trace.robot:
            start = run.observer.trace.robot[-1].copy()
    run.spin_until(lambda: False, 0.5, 5.0)
    # the stream of real poses may have been poisoned in time; nothing may have been in space
    trace = np.array(run.observer.trace.robot)
    assert np.isfinite(trace).all() and np.isfinite(np.array(run.observer.trace.object)).all()
    assert np.isfinite(run.bridge.world.poses()["epuck1"]).all()
    ours = [c for c in commands if c.header.frame_id == "base_link"]
    assert ours and all(
        math.isfinite(c.twist.linear.x) and math.isfinite(c.twist.angular.z) for c in ours
    )


def test_mismatched_qos_shows_in_diagnostics(run):
    weak = QoSProfile(
        depth=1, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE
    )
    publisher = run.observer.create_publisher(PoseStamped, "/goal_pose", weak)
    mismatches = run.supervisor._diagnostics.qos_mismatches
    assert run.spinner.until(lambda: mismatches.get("/goal_pose", 0) > 0, 5.0)
    run.observer.destroy_publisher(publisher)
