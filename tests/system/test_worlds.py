"""Many robots, discs by the thousand, a Pioneer with a load: through the bridge, recorded."""

import contextlib
import threading
from dataclasses import replace

import numpy as np
import pytest
import rclpy
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from push_msgs.msg import Poses, Velocities, WheelTorques
from push_msgs.srv import Displace
from push_record.bag import read_bag
from push_record.recorder import RecorderNode
from push_ros.conversions import time_from_ros
from push_ros.process import Spinner
from push_ros.qos import COMMAND, LATCHED, STREAM
from push_scenario.scenario import scenario_from_mapping, scenario_from_text
from sim_bridge.node import BridgeNode
from tf2_msgs.msg import TFMessage


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


class Onlooker(Node):
    def __init__(self):
        super().__init__("onlooker")
        self.texts, self.tf, self.truth = [], [], []
        self.create_subscription(String, "/scenario", lambda m: self.texts.append(m.data), LATCHED)
        self.create_subscription(TFMessage, "/tf", self.tf.append, 50)
        self.create_subscription(Poses, "/ground_truth/poses", self.truth.append, STREAM)
        self.create_subscription(Poses, "/poses", lambda m: None, STREAM)
        self.displace = self.create_client(Displace, "/displace")


def discs(count=3, **bridge):
    return {
        "environment": "open",
        "robots": {
            f"d{i}": {"type": "disc", "start": [0.3 * i, 0.0, 0.0]} for i in range(1, count + 1)
        },
        "objects": {"box": {"type": "box9", "start": [0.0, 0.6, 0.0]}},
        "parameters": {"bridge": bridge},
    }


THREE = ["d1", "d2", "d3"]


def ahead(poses, seconds):
    return np.tile([0.05, 0.0, 0.0], (len(poses), 1))


def names_of(commander):
    return [f.names for f in commander.frames]


def test_events_kill_remove_move_and_hide_bodies_at_their_times():
    values = {
        **discs(),
        "events": [
            {"kind": "kill", "at": 0.2, "robot": "d1"},
            {"kind": "remove", "at": 0.3, "robot": "d2"},
            {"kind": "displace", "at": 0.25, "body": "box", "by": [0.1, -0.05, 0.5]},
            {"kind": "drop_poses", "at": 0.1, "duration": 0.05, "bodies": ["box", "d3"]},
        ],
    }
    with running(values, lambda b: [Commander(THREE, ahead)]) as ((bridge, me), spinner):
        run_until(bridge, spinner, 0.5)
        assert bridge.unanswered == 0  # nobody waits for the one that is gone
        names = names_of(me)
        assert [("d3" in n, "box" in n) for n in names[10:15]] == [(False, False)] * 5
        assert all("d3" in n and "box" in n for n in names[:10] + names[15:])
        assert all("d2" in n for n in names[:30]) and not any("d2" in n for n in names[30:])
        poses = bridge.world.poses()
        assert poses["box"] == pytest.approx([0.1, 0.55, 0.5], abs=1e-4)
        assert poses["d1"][0] == pytest.approx(0.3 + 0.05 * 0.19, abs=5e-4)
        assert poses["d3"][0] == pytest.approx(0.9 + 0.05 * 0.49, abs=5e-4)
        request = type("R", (), {"seed": 0})()
        bridge._on_reset(request, type("A", (), {})())
        assert set(bridge.world.poses()) == {"d1", "d2", "d3", "box"}
        assert bridge.world.poses()["d2"][0] == pytest.approx(0.6)


def test_a_body_that_is_moved_into_another_stops_there_and_throws_nobody():
    """A box shoved on to a disc, which stands, ends beside it; both stay where they are."""
    shove = {"kind": "displace", "at": 0.2, "body": "box", "by": [0.3, -0.6, 0.0]}
    put = {"kind": "place", "at": 0.3, "body": "box", "pose": [0.9, 0.02, 0.0]}

    def still(poses, seconds):
        return np.zeros((len(poses), 3))

    values = {**discs(), "events": [shove, put]}
    with running(values, lambda b: [Commander(THREE, still)]) as ((bridge, _), spinner):
        run_until(bridge, spinner, 0.22)
        beside = bridge.world.poses()["box"].copy()
        run_until(bridge, spinner, 0.6)
        poses = bridge.world.poses()
        assert 0.05 < beside[1] < 0.2 and beside[0] == pytest.approx(0.25, abs=0.05)
        assert poses["box"] == pytest.approx(beside, abs=1e-3)
        for i, name in enumerate(THREE, 1):
            assert poses[name][:2] == pytest.approx([0.3 * i, 0.0], abs=1e-3)


def test_the_scenario_is_latched_and_a_service_displaces_bodies():
    def make(bridge):
        return [Commander(THREE, ahead), Onlooker()]

    noise = {"position_noise": 0.01, "latency": 0.02}
    with running(discs(motion_capture=noise), make) as ((bridge, _, me), spinner):
        assert spinner.until(lambda: me.texts, 5.0)
        again = scenario_from_text(me.texts[0], "again", "topic")
        assert set(again.robots) == {"d1", "d2", "d3"}
        run_until(bridge, spinner, 0.5)
        assert spinner.until(me.displace.service_is_ready, 5.0)

        def ask(**values):
            sent = me.displace.call_async(Displace.Request(**values))
            assert spinner.until(sent.done, 5.0)
            return sent.result()

        before = bridge.world.poses()["box"].copy()
        assert ask(name="box", x=0.5, y=-0.7, theta=4.0).success
        pose = bridge.world.poses()["box"]
        assert pose == pytest.approx([0.5, -0.7, 4.0 - 2 * np.pi], abs=1e-3)
        assert ask(name="box", relative=True, x=0.1).success
        assert bridge.world.poses()["box"][:2] == pytest.approx(
            [0.5 + 0.1 * np.cos(4.0), -0.7 + 0.1 * np.sin(4.0)], abs=1e-3
        )
        assert not ask(name="moon").success and not ask(name="box", x=float("nan")).success
        there = bridge.world.poses()["box"].copy()
        refusal = ask(name="box", x=bridge.world.poses()["d2"][0], y=0.01)
        assert not refusal.success and "it would be in d2" in refusal.message
        assert bridge.world.poses()["box"] == pytest.approx(there, abs=1e-5)
        assert not np.array_equal(before, pose)
        # tf is what motion capture saw, with its noise and of its time
        truth = {time_from_ros(m.header.stamp): m for m in me.truth}
        errors = []
        for m in me.tf:
            for t in m.transforms:
                exact = truth.get(time_from_ros(t.header.stamp))
                if exact is not None and time_from_ros(t.header.stamp) < 0.45:
                    x = exact.x[list(exact.names).index(t.child_frame_id)]
                    errors.append(t.transform.translation.x - x)
        assert len(errors) >= 30 and 0.004 < np.std(errors) < 0.02


@pytest.mark.parametrize("rate", [30.0, 60.0, 120.0, 240.0])
def test_motion_capture_of_any_rate_has_exact_stamps(rate):
    values = discs(1, motion_capture={"rate": rate, "latency": 0.01})
    with running(values, lambda b: [Commander(["d1"], ahead)]) as ((bridge, me), spinner):
        run_until(bridge, spinner, 0.5)
        stamps = [1_000_000_000 * f.header.stamp.sec + f.header.stamp.nanosec for f in me.frames]
        assert stamps == [round(1e9 * (k + 1) / rate) for k in range(len(stamps))]
        delay = int(np.ceil(0.01 * rate - 1e-9))
        # the last one may be under way
        assert len(stamps) in (round(0.5 * rate) - delay - k for k in (0, 1))
        assert bridge.unanswered == 0
        way = 0.05 * (0.5 - (delay + 1) / rate)
        assert bridge.world.poses()["d1"][0] - 0.3 == pytest.approx(way, abs=3e-4)


def test_commands_for_many_are_checked_one_by_one():
    """FAULTS 13 on cmd_vels: what is good is obeyed, what is not never reaches the physics."""

    def law(poses, seconds):
        twists = np.tile([0.05, 0.0, 0.0], (len(poses), 1))
        twists[1, 0], twists[2, 1] = np.nan, 1e5
        return twists

    values = discs(3)
    with running(values, lambda b: [Commander(THREE, law)], patience=0.05) as (
        (bridge, _),
        spinner,
    ):
        run_until(bridge, spinner, 0.3)
        table = bridge.world.poses().table
        assert np.isfinite(table).all()
        assert table[:3, 0] - [0.3, 0.6, 0.9] == pytest.approx([0.05 * 0.29, 0, 0], abs=5e-4)
        refused = bridge._diagnostics.refused["/cmd_vels"]
        assert 2 * 28 <= refused <= 2 * 30


def test_the_world_waits_for_any_time_and_not_for_who_has_left():
    """FAULTS 30: a late answer changes nothing; a commander that is gone stops its robots."""
    values = discs(3)
    with running(values, lambda b: [Commander(THREE, ahead)], patience=0.05) as (
        (bridge, me),
        spinner,
    ):
        run_until(bridge, spinner, 0.3)
        held, publish = [], me.publisher.publish
        me.publisher = type("Held", (), {"publish": staticmethod(held.append)})
        assert spinner.until(lambda: bool(held), 5.0)
        tick, before = bridge.tick, bridge.world.poses().table.copy()
        assert not spinner.until(lambda: bridge.tick > tick, 0.5)
        assert (bridge.world.poses().table == before).all() and bridge.unanswered == 0
        publish(held.pop())
        assert spinner.until(lambda: bridge.tick > tick, 5.0)
        for publisher in list(me.publishers):
            if publisher.topic_name == "/cmd_vels":
                me.destroy_publisher(publisher)
        assert spinner.until(lambda: bridge.tick > tick + 100, 10.0)
        assert bridge.unanswered == 1 and not any(map(bridge.driving, THREE))


def test_robots_that_a_team_no_longer_names_are_not_waited_for():
    values = discs(3)
    with running(values, lambda b: [Commander(THREE, ahead)], patience=20.0) as (
        (bridge, me),
        spinner,
    ):
        run_until(bridge, spinner, 0.2)
        publish = me.publisher.publish

        def without_third(message):
            message.names, message.vx = message.names[:2], message.vx[:2]
            message.vy, message.omega = message.vy[:2], message.omega[:2]
            publish(message)

        me.publisher = type("Fewer", (), {"publish": staticmethod(without_third)})
        run_until(bridge, spinner, 0.5)
        way = bridge.world.poses().table[:3, 0] - [0.3, 0.6, 0.9]
        assert way == pytest.approx([0.05 * 0.49, 0.05 * 0.49, 0.05 * 0.19], abs=1e-3)
        assert bridge.unanswered == 0


def test_a_second_bridge_does_not_start_and_a_second_commander_is_named():
    """FAULTS 23: in one domain and namespace; elsewhere it may."""
    from push_model.settings import SettingsError

    rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
    nodes = []
    try:
        scenario = scenario_from_mapping(discs(1), "test", "test")
        nodes.append(BridgeNode(scenario))
        spinner = Spinner(nodes)
        assert spinner.until(lambda: nodes[0].tick > 2, 10.0)
        domain = nodes[0].context.get_domain_id()
        stop = threading.Event()
        ticking = threading.Thread(
            target=lambda: spinner.until(stop.is_set, 60.0)
        )  # the first one lives on meanwhile
        ticking.start()
        try:
            with pytest.raises(SettingsError, match=f"a bridge already runs in domain {domain}"):
                BridgeNode(scenario)
        finally:
            stop.set()
            ticking.join()
        aside = BridgeNode(scenario, namespace="/aside")
        spinner.nodes.append(aside)
        spinner.executor.add_node(aside)
        assert spinner.until(lambda: aside.tick > 2, 10.0)
        assert not nodes[0]._diagnostics.rivals
        rival = spinner.nodes[0].create_publisher(Velocities, "/cmd_vels", COMMAND)
        second = spinner.nodes[1].create_publisher(Velocities, "/cmd_vels", COMMAND)
        assert spinner.until(lambda: "/cmd_vels" in nodes[0]._diagnostics.rivals, 10.0)
        assert rival is not second
    finally:
        spinner.close()
        rclpy.try_shutdown()
