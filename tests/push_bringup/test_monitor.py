"""What a person is told of a job whose owner is frozen, has died, or was restarted."""

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import PoseStamped

from push_bringup.monitor import Monitor
from push_bringup.owner_watch import SILENCE, Owner, OwnerWatch
from push_model.jobs import JobError
from push_msgs.msg import JobState, Poses
from push_ros.conversions import poses_to_ros
from push_ros.process import Spinner
from push_ros.qos import COMMAND, LATCHED, STREAM

GOAL = (0.4, 0.1, 0.0)


@pytest.mark.parametrize("missing", [0.1, 5.0, SILENCE - 0.1])
def test_who_comes_back_as_the_same_publisher_was_only_frozen(missing):
    watch = OwnerWatch(frozenset({b"a"}))
    assert watch.look(0.0, frozenset({b"a"}), True) is Owner.PRESENT
    assert watch.look(1.0, frozenset(), True) is Owner.MISSING
    assert watch.look(1.0 + missing, frozenset(), True) is Owner.MISSING
    assert watch.look(1.1 + missing, frozenset({b"a"}), True) is Owner.RETURNED
    assert watch.look(1.2 + missing, frozenset({b"a"}), True) is Owner.PRESENT


def test_who_stays_away_is_silent_where_there_is_a_world_and_has_ended_with_it():
    for world, last, verdict in ((True, SILENCE, Owner.SILENT), (False, 2.0, Owner.ENDED)):
        watch = OwnerWatch(frozenset({b"a"}))
        assert watch.look(5.0, frozenset(), world) is Owner.MISSING
        assert watch.look(5.0 + last, frozenset(), world) is Owner.MISSING
        assert watch.look(5.1 + last, frozenset(), world) is verdict


def test_another_publisher_in_its_place_is_another_node():
    watch = OwnerWatch(frozenset({b"a"}))
    # the dead one stays in the graph for a while beside the new one
    assert watch.look(0.0, frozenset({b"a", b"b"}), True) is Owner.PRESENT
    assert watch.look(1.0, frozenset({b"b"}), True) is Owner.REPLACED


class OwnerNode:
    """Owns jobs, and tells of them as it is told to."""

    @classmethod
    def resumed(cls, job, goal):
        """One that was started in the place of another and goes on with its job."""
        return cls(job, JobState.PUSHING, "the node was restarted", goal)

    def __init__(self, job=0, state=JobState.IDLE, reason="waiting for a goal", goal=None):
        self.node = rclpy.create_node("owner")
        self.heard = []
        self.node.create_subscription(PoseStamped, "/goal_pose", self.heard.append, COMMAND)
        self.publisher = self.node.create_publisher(JobState, "/job_state", LATCHED)
        self.spinner = Spinner([self.node])
        self.job = job
        self.tell(state, reason, goal or PoseStamped())

    def tell(self, state, reason, goal, code=0):
        name = {JobState.IDLE: "IDLE", JobState.PUSHING: "PUSHING"}[state]
        message = JobState(state=state, state_name=name, reason=reason, object="box", goal=goal)
        message.job, message.error_code = self.job, int(code)
        self.publisher.publish(message)

    def take(self, goal):
        self.job += 1
        self.tell(JobState.PUSHING, "push 1 of 2", goal)

    def close(self):
        self.spinner.close()


@pytest.fixture
def world(ros, monkeypatch):
    """A monitor whose goal an owner pursues; events; the owners, to be closed."""
    monkeypatch.setattr("push_bringup.monitor._LOOK", 0.0)
    source = rclpy.create_node("source")
    poses = source.create_publisher(Poses, "/poses", STREAM)
    events, owners = [], [OwnerNode(job=3)]
    with Monitor(context=rclpy.get_default_context(), on_event=events.append) as monitor:
        assert monitor.wait(15.0, lambda: monitor.state is not None and monitor.supervised)
        assert monitor.wait(15.0, lambda: monitor._publisher.get_subscription_count() > 0)
        poses.publish(poses_to_ros({"box": np.zeros(3)}, 1.0))
        monitor.send_goal(GOAL)
        assert owners[0].spinner.until(lambda: bool(owners[0].heard), 15.0)
        owners[0].take(owners[0].heard[-1])
        assert monitor.wait(15.0, lambda: monitor.state.job == 4)
        assert monitor.poll() is None
        yield monitor, events, owners, source
    for owner in owners:
        owner.close()
    source.destroy_node()


def polled(monitor, limit=15.0):
    found = []
    monitor.wait(
        limit, lambda: bool(found) or ((r := monitor.poll()) is not None and not found.append(r))
    )
    return found[0]


def test_another_goal_that_is_taken_replaces_ours(world):
    monitor, _, (owner,), _ = world
    owner.take(PoseStamped())
    result = polled(monitor)
    assert result.code is JobError.PREEMPTED and "another goal" in result.reason


def test_a_task_without_a_goal_replaces_ours_at_the_origin_too(world):
    """An empty goal looks like one at the origin."""
    monitor, _, (owner,), _ = world
    monitor.send_goal((0.0, 0.0, 0.0))
    assert owner.spinner.until(lambda: len(owner.heard) == 2, 15.0)
    owner.take(owner.heard[-1])
    assert monitor.wait(15.0, lambda: monitor.state.job == 5) and monitor.poll() is None
    owner.take(PoseStamped())
    assert polled(monitor).code is JobError.PREEMPTED


def test_a_state_is_told_once_whatever_its_progress(world):
    monitor, events, (owner,), _ = world
    goal = owner.heard[-1]

    def told():
        monitor.poll()
        return [e for e in events if e.kind == "state"]

    for count in range(1, 6):
        owner.tell(JobState.PUSHING, "push 1 of 2", goal, code=count)
        assert monitor.wait(15.0, lambda count=count: monitor.state.error_code == count)
        assert len(told()) == 1
    owner.tell(JobState.PUSHING, "push 2 of 2", goal)
    assert monitor.wait(15.0, lambda: len(told()) == 2)


@pytest.mark.parametrize("taken", [0, 1, 4])
def test_a_restarted_owner_has_forgotten_the_job(world, taken):
    """Its count of jobs begins anew; it may have taken others' goals since."""
    monitor, _, owners, _ = world
    owners.pop().close()
    owners.append(OwnerNode())
    for _ in range(taken):
        owners[0].take(PoseStamped())
    result = polled(monitor)
    assert result.code is JobError.JOB_FORGOTTEN and not result.success
    assert "restarted" in result.reason and "send the goal again" in result.reason


@pytest.mark.parametrize("seen", [True, False])
def test_a_restarted_owner_that_has_taken_the_job_up_again_is_followed_to_the_end(world, seen):
    """It says so with the number and the goal of the job; seen: while the dead one is in the
    graph."""
    monitor, events, owners, _ = world
    goal, dead = owners[0].heard[-1], owners.pop()
    if not seen:
        dead.close()
        assert monitor.wait(15.0, lambda: not monitor.supervised)
    owners.append(OwnerNode.resumed(4, goal))
    assert monitor.wait(15.0, lambda: "restarted" in monitor.state.reason)
    dead.close()
    monitor.wait(1.0, lambda: monitor.poll() is not None)
    assert "returned" in [e.kind for e in events]
    owners[0].tell(JobState.IDLE, "the goal is reached", goal)
    result = polled(monitor)
    assert result.code is JobError.NONE and result.success


def test_a_restarted_owner_that_takes_others_goals_has_forgotten_ours(world):
    """Even where its count of jobs is beyond ours."""
    monitor, _, owners, _ = world
    owners.pop().close()
    monitor.wait(1.0, lambda: monitor.poll() is not None)
    owners.append(OwnerNode.resumed(9, PoseStamped()))
    assert polled(monitor).code is JobError.JOB_FORGOTTEN


def test_an_owner_that_is_missed_is_waited_for_and_told_of(world, monkeypatch):
    """It leaves the graph, and comes back as the same publisher: the job has gone on."""
    monitor, events, (owner,), _ = world
    seen = monitor._owners()
    monkeypatch.setattr(monitor, "_owners", frozenset)
    monitor.wait(0.3, lambda: monitor.poll() is not None)
    assert [e.kind for e in events if e.kind in ("silent", "returned")] == ["silent"]
    monkeypatch.setattr(monitor, "_owners", lambda: seen)
    owner.tell(JobState.IDLE, "the goal is reached", owner.heard[-1])
    result = polled(monitor)
    assert result.code is JobError.NONE
    monitor.wait(0.3, lambda: False)
    assert [e.kind for e in events if e.kind == "silent"] == ["silent"]


def test_an_owner_that_stays_away_ends_the_waiting_with_a_code_of_its_own(world, monkeypatch):
    monitor, _, owners, _ = world
    monkeypatch.setattr("push_bringup.owner_watch.SILENCE", 0.3)
    owners.pop().close()
    result = polled(monitor)
    assert result.code is JobError.OWNER_SILENT and "frozen" in result.reason


def test_when_the_world_is_gone_as_well_the_nodes_have_ended(world, monkeypatch):
    monitor, _, owners, source = world
    monkeypatch.setattr("push_bringup.owner_watch._END", 0.3)
    owners.pop().close()
    for publisher in list(source.publishers):
        if publisher.topic_name == "/poses":
            source.destroy_publisher(publisher)
    result = polled(monitor)
    assert result.code is None and "the nodes have ended before the job" in result.reason


def test_a_distance_is_told_once_while_the_object_stands(world, monkeypatch):
    monkeypatch.setattr("push_bringup.monitor._PROGRESS", 0.0)
    monitor, events, _, source = world
    poses = source.create_publisher(Poses, "/poses", STREAM)
    assert monitor.wait(15.0, lambda: poses.get_subscription_count() > 0)
    for x in (0.0, 0.0, 0.1, 0.1, 0.1004, 0.102):
        poses.publish(poses_to_ros({"box": np.array([x, 0.0, 0.0])}, 2.0))
        assert monitor.wait(15.0, lambda x=x: monitor.pose is not None and monitor.pose[0] == x)
        for _ in range(3):
            assert monitor.poll() is None
    told = [e.distance for e in events if e.kind == "progress"]
    assert told == pytest.approx([float(np.hypot(0.4 - x, 0.1)) for x in (0.0, 0.1, 0.102)])
