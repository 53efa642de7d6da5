"""Who hears a publisher; what a process holds, and gives back."""

import gc
import io
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.action import ActionClient, ActionServer
from rclpy.logging import LoggingSeverity
from std_msgs.msg import String

from push_msgs.action import MoveObject
from push_msgs.msg import JobState
from push_ros import process
from push_ros.claims import claim_world, own_domain, runs_in_lockstep, world_is_claimed
from push_ros.latched import has_publisher, hear_latched
from push_ros.process import INTERRUPTS, Spinner, heard, run_node
from push_ros.qos import COMMAND, LATCHED
from push_ros.scheduling import RealTimePriority, Urgency


def test_an_interrupt_waits_for_the_end_of_a_callback(ros, capfd):
    """An exception out of a callback made rclpy print a traceback on Ctrl-C."""
    before = signal.signal(signal.SIGINT, lambda *_: INTERRUPTS.interrupt())
    node, done = rclpy.create_node("timed"), []

    def callback():
        os.kill(os.getpid(), signal.SIGINT)
        done.append(True)

    node.create_timer(0.01, callback)
    spinner = Spinner([node])
    try:
        with pytest.raises(KeyboardInterrupt):
            spinner.until(lambda: False, 5.0)
        assert done == [True]
        with pytest.raises(KeyboardInterrupt):  # nothing spins
            os.kill(os.getpid(), signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)
        spinner.close()
    assert "Exception" not in capfd.readouterr().err


def test_another_subscriber_does_not_count(ros):
    """A goal was lost when the recorder was known before the supervisor was."""
    node, recorder = rclpy.create_node("sender"), rclpy.create_node("recorder")
    publisher = node.create_publisher(PoseStamped, "/goal_pose", COMMAND)
    recorder.create_subscription(PoseStamped, "/goal_pose", lambda m: None, COMMAND)
    spinner = Spinner([node, recorder])
    assert spinner.until(lambda: publisher.get_subscription_count() > 0, 5.0)
    assert not heard(node, publisher)
    supervisor = rclpy.create_node("any_name")
    supervisor.create_publisher(JobState, "/job_state", LATCHED)
    goals = []
    supervisor.create_subscription(PoseStamped, "/goal_pose", goals.append, COMMAND)
    spinner.close()
    node = rclpy.create_node("sender")
    publisher = node.create_publisher(PoseStamped, "/goal_pose", COMMAND)
    spinner = Spinner([node, supervisor])
    try:
        assert spinner.until(lambda: heard(node, publisher), 5.0)
        publisher.publish(PoseStamped())
        assert spinner.until(lambda: goals, 5.0)
    finally:
        spinner.close()


def test_a_closed_spinner_leaves_nobody_in_the_graph(ros):
    """Its executor kept the node alive: a worker's next trial would have met the last one's."""
    node = rclpy.create_node("guest")
    node.create_publisher(JobState, "/job_state", LATCHED)
    server = ActionServer(node, MoveObject, "/move_object", lambda goal: MoveObject.Result())
    client = ActionClient(node, MoveObject, "/move_object")
    spinner = Spinner([node])
    spinner.once(0.05)
    feedback = "/move_object/_action/feedback"
    assert has_publisher("/job_state", 10.0) and has_publisher(feedback, 10.0)
    spinner.close()
    assert not has_publisher("/job_state", 1.0) and not has_publisher(feedback, 0.2)
    assert server is not None and client is not None  # somebody still holds them


def test_an_executor_where_standard_error_is_no_file(ros, monkeypatch):
    """As in a notebook."""
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    spinner = Spinner([rclpy.create_node("guest")])
    spinner.once(0.01)
    spinner.close()


def test_a_node_is_taken_out_while_its_events_are_under_way(ros):
    """None of its callbacks is called after it is destroyed, which would raise InvalidHandle."""
    spinner = Spinner([rclpy.create_node("stays")])
    ticks = []
    for number in range(20):
        node = rclpy.create_node(f"leaves_{number}")
        for _ in range(4):  # they are due together, and a spin ends after one of them
            node.create_timer(1e-3, lambda node=node: ticks.append(node.count_publishers("/text")))
        spinner.add(node)
        told = len(ticks)
        enough = told + number
        assert spinner.until(lambda enough=enough: len(ticks) > enough, 10.0)
        spinner.remove(node)
        told = len(ticks)
        assert not spinner.until(lambda told=told: len(ticks) > told, 0.01)
    assert [n.get_name() for n in spinner.nodes] == ["stays"]
    spinner.close()


def test_what_is_latched_is_heard_by_who_comes_late(ros):
    node = rclpy.create_node("speaker")
    publisher = node.create_publisher(String, "/text", LATCHED)
    publisher.publish(String(data="spoken before"))
    assert hear_latched(String, "/text", 10.0).data == "spoken before"
    assert hear_latched(String, "/nothing", 0.2) is None
    node.destroy_node()


def test_a_domain_is_given_back(domain, monkeypatch):
    with own_domain() as own:
        assert own != domain and os.environ["ROS_DOMAIN_ID"] == str(own)
        with own_domain() as other:
            assert other not in (own, domain)
    assert os.environ["ROS_DOMAIN_ID"] == str(domain)
    monkeypatch.delenv("ROS_DOMAIN_ID")
    with own_domain():
        pass
    assert "ROS_DOMAIN_ID" not in os.environ


def test_a_run_does_not_take_the_domain_of_its_caller(monkeypatch):
    for _ in range(20):  # the following one may be claimed by others now and then
        with own_domain() as own:
            following = 1 + own % 100
        monkeypatch.setenv("ROS_DOMAIN_ID", str(following))
        with own_domain() as own:
            assert own != following


def test_a_run_is_heard_on_this_machine_only(domain, monkeypatch):
    """A lab on another machine may have the domain of a trial: its robots would obey the trial."""
    name = "ROS_AUTOMATIC_DISCOVERY_RANGE"
    monkeypatch.setenv(name, "SUBNET")
    with own_domain():
        assert os.environ[name] == "LOCALHOST"
    assert os.environ[name] == "SUBNET"


def test_others_are_kept_out_of_the_domain_of_a_run(domain):
    """A process that the run starts belongs to it; one from elsewhere does not."""
    ask = "import sys; from push_ros.claims import runs_in_lockstep as r; print(r(sys.argv[1]))"
    with own_domain() as own:
        for environment, kept_out in (
            (dict(os.environ), "False"),
            ({k: v for k, v in os.environ.items() if not k.startswith("PLANAR_PUSH")}, "True"),
        ):
            words = [sys.executable, "-c", ask, str(own)]
            told = subprocess.run(words, env=environment, capture_output=True, text=True)
            assert told.stdout.strip() == kept_out, told.stderr
        assert runs_in_lockstep(str(domain))  # that of this test, which the inner run has not made
    assert not runs_in_lockstep(str(domain))
    assert not runs_in_lockstep("0")


def test_a_domain_of_its_own_is_none_in_which_a_suite_runs(domain, tmp_path, monkeypatch):
    free = 42 if domain != 42 else 43  # this test holds the claim of its own domain elsewhere
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    claims = [claim_world(str(d), "/lab") for d in range(1, 101) if d != free]
    try:
        with own_domain() as own:
            assert own == free
        claims.append(claim_world(str(free), "/"))
        with pytest.raises(RuntimeError, match="in use"), own_domain():
            pass
    finally:
        for claim in claims:
            claim.close()


def test_the_world_of_a_namespace_is_claimed_by_one_at_a_time(domain):
    name = str(domain)
    claim = claim_world(name, "/lab/")
    assert claim is not None and world_is_claimed(name, "/lab/")
    assert claim_world(name, "/lab/") is None
    assert not world_is_claimed(name, "/") and not world_is_claimed(f"{name}0", "/lab/")
    claim.close()
    assert not world_is_claimed(name, "/lab/")


def test_a_claim_ends_with_its_process_and_one_of_another_user_counts(domain, tmp_path):
    name = str(domain)
    code = (
        "import sys, time; from push_ros.claims import claim_world; "
        f"c = claim_world({name!r}, '/'); print(c is not None, flush=True); time.sleep(60)"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline().strip() == "True"
        path = Path(tempfile.gettempdir()) / f"planar_push_world_{name}-.lock"
        path.chmod(0o444)  # all that another user may do with it is read
        assert world_is_claimed(name, "/")
    finally:
        process.kill()
        process.wait()
    assert not world_is_claimed(name, "/")


def test_what_exists_when_a_node_begins_is_not_collected_while_it_runs(signal_handlers):
    """A full collection takes about 50 ms, and a controller has 20 ms."""
    frozen = []

    def end():
        frozen.append(gc.get_freeze_count())
        os.kill(os.getpid(), signal.SIGTERM)

    def make():
        node = rclpy.create_node("timed")
        node.create_timer(0.02, end)
        return node

    assert run_node(make, []) == 0
    assert frozen[0] > 10_000 and gc.get_freeze_count() == 0


@pytest.mark.parametrize("in_real_time", [True, False])
def test_a_node_runs_where_no_real_time_priority_is_permitted(
    monkeypatch, capfd, signal_handlers, in_real_time
):
    """The bridge says so in one line; in lockstep it asks for none."""

    def refuse(*_):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    asked = []

    def ask(urgency, tell):
        asked.append(urgency)
        return RealTimePriority(urgency, tell)

    monkeypatch.setattr(process, "RealTimePriority", ask)

    def make():
        node = rclpy.create_node("world")
        node.get_logger().set_level(LoggingSeverity.INFO)  # a quiet run before raises all levels
        node.in_real_time = in_real_time
        node.create_timer(0.02, lambda: os.kill(os.getpid(), signal.SIGTERM))
        return node

    assert run_node(make, [], Urgency.WORLD) == 0
    assert asked == [Urgency.WORLD if in_real_time else Urgency.ORDINARY]
    said = capfd.readouterr()
    assert (said.out + said.err).count("no real-time priority") == in_real_time
