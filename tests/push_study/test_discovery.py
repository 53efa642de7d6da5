"""Nodes of a run wait for each other by what the middleware has done, not by a clock."""

import itertools
import os

import pytest
import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Empty
from std_srvs.srv import Trigger

from push_ros.claims import own_domain
from push_ros.process import Spinner
from push_ros.qos import COMMAND
from push_scenario.scenario import load_scenario
from push_study.discovery import Discovery, NotDiscovered, unmatched
from push_study.graph_run import LockstepRun
from tests.system.test_swarm import running


@pytest.fixture
def discovery(ros):
    node = rclpy.create_node("waiting")
    spinner = Spinner([node])
    yield Discovery(node, spinner, probes=20, between=1)
    spinner.close()


def test_probes_are_heard_and_leave_nothing_behind(discovery):
    node = discovery._node
    before = len(list(node.publishers)), len(list(node.subscriptions))
    discovery.settle()
    assert (len(list(node.publishers)), len(list(node.subscriptions))) == before


def test_it_waits_as_long_as_anything_changes_and_for_a_while_when_nothing_does(discovery):
    calls = itertools.count()
    discovery.wait(lambda: next(calls) // 30, lambda: next(calls) > 200)  # a change now and then
    left = iter([False] * 38)
    discovery.wait(lambda: 0, lambda: next(left, True))  # none, but done before it gives up


def test_nodes_that_will_not_find_each_other_are_given_up(discovery):
    with pytest.raises(NotDiscovered, match=r"20 endpoints .* nothing else has changed: \(False"):
        discovery.wait(lambda: (False, 3), lambda: False)


def test_a_run_whose_owner_is_never_ready_ends_and_says_what_is_missing(monkeypatch):
    monkeypatch.setattr("push_study.graph_run.Discovery", few_probes)
    with running() as run:
        monkeypatch.setattr(type(run.supervisor), "ready", False)
        with pytest.raises(NotDiscovered, match="did not find each other"):
            run.connect()
        assert run.bridge.time == 0.0


class Late(Node):
    """A node of a study that is slow to hear what it needs."""

    def __init__(self):
        super().__init__("late")
        self.asked = 0

    @property
    def ready(self):
        self.asked += 1
        return self.asked > 25


def test_a_run_does_not_begin_before_the_nodes_of_its_study_are_ready():
    made = []

    def extra():
        made.append(Late())
        return made

    with own_domain(), LockstepRun(load_scenario("env1-target1"), extra, quiet=True) as run:
        run.connect()
        assert made[0].asked > 25 and run.bridge.time == 0.0


def test_a_run_is_heard_on_this_machine_only(monkeypatch):
    """Also in a domain that somebody has chosen for a lab, and whose range is the network."""
    name, ranges, initialise = "ROS_AUTOMATIC_DISCOVERY_RANGE", [], rclpy.init
    monkeypatch.setenv(name, "SUBNET")

    def noted(**words):
        ranges.append(os.environ[name])
        initialise(**words)

    monkeypatch.setattr(rclpy, "init", noted)
    with LockstepRun(load_scenario("short"), quiet=True):
        pass
    assert ranges == ["LOCALHOST"] and os.environ[name] == "SUBNET"


def test_what_is_unmatched_is_named_until_it_is_found(ros):
    """Of two participants: a topic whose ends are never matched, one whose ends will be."""
    other = rclpy.Context()
    rclpy.init(args=[], context=other)
    near, far = rclpy.create_node("near"), rclpy.create_node("far", context=other)
    near.create_publisher(Empty, "/to_far", COMMAND)
    far.create_subscription(Empty, "/to_far", lambda m: None, COMMAND)
    far.create_publisher(Empty, "/to_nobody", COMMAND)
    unreliable = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    publisher = near.create_publisher(Empty, "/never", unreliable)
    far.create_subscription(Empty, "/never", lambda m: None, COMMAND)
    far.create_client(Trigger, "/ask_near")
    nodes, spinner = [near, far], Spinner([near])
    try:
        Discovery(near, spinner).settle()
        assert set(unmatched(nodes)) - {"/to_far"} == {"/ask_near", "/never"}
        near.create_service(Trigger, "/ask_near", lambda request, response: response)
        near.destroy_publisher(publisher)
        assert spinner.until(lambda: not unmatched(nodes), 20.0), unmatched(nodes)
    finally:
        far.destroy_node()
        spinner.close()
        rclpy.shutdown(context=other)


def few_probes(node, spinner):
    return Discovery(node, spinner, probes=20, between=1)


def test_no_clock_decides_whether_a_run_connects_or_goes_on(monkeypatch):
    """A machine on which an hour passes from each look at the clock to the next."""
    hours = itertools.count(0.0, 3600.0)
    with running() as run:
        monkeypatch.setattr("time.monotonic", lambda: next(hours))
        run.connect()
        assert run.supervisor.ready and run.bridge.time == 0.0
        run.start()
        assert run.spin_until(lambda: run.bridge.time > 0.5, 2.0)


def test_a_run_whose_world_stands_ends_and_says_so(monkeypatch):
    monkeypatch.setattr("push_study.graph_run._STUCK", 50)
    with running() as run:
        run.start()
        run.bridge._paused = True
        with pytest.raises(RuntimeError, match="the world stands at tick"):
            run.spin_until(lambda: False, 2.0)


def test_a_run_connects_and_steps(monkeypatch):
    assert "limit" not in LockstepRun.connect.__annotations__
    with running() as run:
        run.start()
        assert run.spin_until(lambda: run.bridge.time > 0.2, 1.0)
