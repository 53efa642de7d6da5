"""Many robots, discs by the thousand, a Pioneer with a load: through the bridge, recorded."""

import numpy as np
import pytest
from rclpy.node import Node
from sensor_msgs.msg import JointState

from push_msgs.msg import Poses, WheelTorques
from push_record.bag import read_bag
from push_ros.qos import COMMAND, STREAM
from tests.system.worlds import Commander, ring_of, run_until, running


@pytest.mark.long
def test_twenty_robots_with_rings_close_in_on_a_plate(tmp_path):
    """Those that come through touch it, from all sides: there is not room for all twenty. Then one
    half backs off, the other pushes; everything is in the bag."""
    values = {
        "environment": "open",
        "robots": ring_of(20, 0.34, "epuck_ring"),
        "objects": {"plate": {"type": "plate_square", "start": [0, 0, 0], "floor_friction": 0.2}},
        "parameters": {"bridge": {"physics": {"time_step": 0.002, "solver_iterations": 40}}},
    }

    def make(bridge):
        robots = [f"r{i}" for i in range(1, 21)]

        def law(poses, seconds):
            leftward = np.cos(poses[:, 2]) < -0.1
            speed = np.where(leftward | (seconds < 1.5), 0.08, -0.08)
            return np.column_stack([speed, np.zeros(20), np.zeros(20)])

        return [Commander(robots, law)]

    with running(values, make, tmp_path / "bag") as ((bridge, commander, _), spinner):
        run_until(bridge, spinner, 2.5)
        assert bridge.unanswered == 0
        poses = bridge.world.poses()
        assert np.isfinite(poses.table).all() and len(poses) == 21
        assert poses["plate"][0] < -0.01 and abs(poses["plate"][1]) < 0.02
        assert len(commander.frames) >= 249
    recorded = list(read_bag(tmp_path / "bag"))
    topics = {r.topic for r in recorded}
    assert {"/clock", "/poses", "/ground_truth/poses", "/contacts", "/map"} <= topics
    frames = [r.message for r in recorded if r.topic == "/poses"]
    assert len(frames) >= 249 and len(frames[-1].names) == 21
    pairs = {
        frozenset(pair)
        for r in recorded
        if r.topic == "/contacts"
        for pair in zip(r.message.body_a, r.message.body_b, strict=True)
    }
    touching = [int(name[1:]) for p in pairs if "plate" in p for name in p - {"plate"}]
    assert {(k - 1) * 4 // 20 for k in touching} == {0, 1, 2, 3}, "a quarter of them each"


def test_a_thousand_discs_by_one_message_a_tick(tmp_path):
    grid = {"kind": "grid", "corner": [-2.0, -2.0], "spacing": 0.125, "columns": 32}
    values = {
        "environment": {"size": [5.0, 5.0], "resolution": 0.05},
        "robots": {"d": {"type": "disc", "count": 1000, "placement": grid}},
        "parameters": {"bridge": {"physics": {"time_step": 0.005, "solver_iterations": 10}}},
    }
    speed = 0.1 * np.column_stack([np.cos(np.arange(1000)), np.sin(np.arange(1000))])

    def make(bridge):
        return [
            Commander(
                [f"d{i}" for i in range(1, 1001)],
                lambda poses, seconds: np.column_stack([speed, np.zeros(1000)]),
            )
        ]

    with running(values, make, tmp_path / "bag") as ((bridge, _, _), spinner):
        start = bridge.world.poses().table.copy()
        run_until(bridge, spinner, 0.10)
        assert bridge.unanswered == 0
        moved = bridge.world.poses().table - start
        # the first tick's command comes with the first frame
        assert moved[:, :2] == pytest.approx(0.09 * speed, abs=7e-4)  # 10 ms to gather speed
    frames = [r.message for r in read_bag(tmp_path / "bag", {"/poses"})]
    assert len(frames) >= 9 and len(frames[-1].names) == 1000


class TorqueDriver(Node):
    """Drives a robot by wheel torques: a speed loop of its own, as the Pioneer's controller has."""

    def __init__(self, wanted):
        super().__init__("torque_driver")
        self.wanted, self.speeds, self.joints, self.efforts = wanted, np.zeros(2), 0, []
        self.publisher = self.create_publisher(WheelTorques, "/p/wheel_torques", COMMAND)
        self.create_subscription(JointState, "/p/joint_states", self.on_joints, STREAM)
        self.create_subscription(Poses, "/poses", self.on_poses, STREAM)

    def on_joints(self, message):
        assert message.name == ["left_wheel", "right_wheel"]
        self.speeds, self.joints = np.array(message.velocity), self.joints + 1
        self.efforts.append(max(message.effort))

    def on_poses(self, message):
        torque = np.clip(0.3 * (self.wanted - self.speeds), -1.0, 1.0)  # less than slips
        answer = WheelTorques(left=float(torque[0]), right=float(torque[1]))
        answer.header.stamp = message.header.stamp
        self.publisher.publish(answer)


def test_a_pioneer_pushes_its_box_by_wheel_torques(tmp_path):
    values = {
        "environment": {"size": [8.0, 4.0], "resolution": 0.05},
        "robots": {"p": {"type": "pioneer", "start": [-1.0, 0.0, 0.0]}},
        "objects": {"box": {"type": "pioneer_box", "start": [-0.60, 0.0, 0.0]}},
    }
    with running(values, lambda bridge: [TorqueDriver(np.array([4.0, 4.0]))], tmp_path / "bag") as (
        (bridge, driver, _),
        spinner,
    ):
        run_until(bridge, spinner, 3.0)
        assert bridge.unanswered == 0
        robot, box = bridge.world.poses()["p"], bridge.world.poses()["box"]
        assert driver.joints >= 290 and box[0] > -0.35 and abs(robot[1]) < 0.02
        assert robot[0] + 0.25 + 0.125 == pytest.approx(box[0], abs=0.01)  # against the bumper
        # floor friction of the box at 95 mm, shared by two wheels
        assert np.mean(driver.efforts[-50:]) == pytest.approx(0.3 * 3 * 9.81 * 0.095 / 2, rel=0.25)
        mine = bridge.world.wheel_state("p").speed
        held = 0.3 * 3 * 9.81 * 0.095 / 2  # what the load takes of the loop
        assert mine == pytest.approx([4.0 - held / 0.3] * 2, rel=0.1)
    assert any(r.topic == "/poses" for r in read_bag(tmp_path / "bag"))
