"""What the bridge does at events and with commands: through its topics, in lockstep."""

import threading

import numpy as np
import pytest
import rclpy
from rclpy.node import Node
from std_msgs.msg import String

from push_msgs.msg import Poses, Velocities
from push_msgs.srv import Displace
from push_ros.conversions import time_from_ros
from push_ros.process import Spinner
from push_ros.qos import COMMAND, LATCHED, STREAM
from push_scenario.scenario import scenario_from_mapping, scenario_from_text
from sim_bridge.node import BridgeNode
from tests.system.worlds import Commander, run_until, running
from tf2_msgs.msg import TFMessage


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
        delay = int(np.ceil(0.01 * rate - 1e-9))  # ticks until one can show the first instant
        ticks = np.arange(len(stamps)) + 1 + delay
        assert stamps == [round(1e9 * (k / rate - 0.01)) for k in ticks]  # the latency is exact
        assert bridge.applied_latency == pytest.approx((0.01, 0.0), abs=1e-9)
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


@pytest.mark.long
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
