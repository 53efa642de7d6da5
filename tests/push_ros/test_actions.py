"""One goal at a time over real actions: the states that a client sees, and who answers what."""

import time

import pytest
import rclpy
from action_msgs.msg import GoalStatus, GoalStatusArray
from rclpy.action import ActionClient
from rclpy.experimental import EventsExecutor

from push_msgs.action import MoveObject
from push_ros.actions import GoalClient, GoalServer
from push_ros.qos import LATCHED


class World:
    """A server, a GoalClient and a plain action client on one executor."""

    def __init__(self):
        self.node = rclpy.create_node("actions")
        self.started, self.canceled, self.statuses = [], 0, []
        self.server = GoalServer(
            self.node,
            MoveObject,
            "/job",
            check=self.check,
            start=lambda request: self.started.append(request.object),
            cancel=self.on_cancel,
            preempt=lambda request: self.server.finish(MoveObject.Result(error_code=311), False),
            refuse=lambda r: MoveObject.Result(error_code=301) if r.object == "odd" else None,
        )
        self.client = GoalClient(self.node, MoveObject, "/job")
        self.plain = ActionClient(self.node, MoveObject, "/job")
        self.node.create_subscription(
            GoalStatusArray, "/job/_action/status", self.on_status, LATCHED
        )
        self.executor = EventsExecutor()
        self.executor.add_node(self.node)
        assert self.until(lambda: self.client.ready and self.plain.server_is_ready())

    def check(self, request):
        if request.object == "bad":
            raise ValueError("no such object")

    def on_cancel(self):
        self.canceled += 1
        self.server.finish(MoveObject.Result(error_code=310), success=False)

    def on_status(self, message):
        if message.status_list:
            self.statuses.append(message.status_list[-1].status)

    def until(self, condition, limit=5.0):
        end = time.monotonic() + limit
        while not condition() and time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.02)
        return condition()

    def close(self):
        self.executor.shutdown()
        self.node.destroy_node()


@pytest.fixture
def world(ros):
    world = World()
    yield world
    world.close()


def test_a_goal_is_executing_until_it_is_finished(world):
    results, feedback = [], []
    world.client.send(MoveObject.Goal(object="box"), results.append, feedback.append)
    assert world.until(lambda: GoalStatus.STATUS_EXECUTING in world.statuses)
    assert world.started == ["box"] and world.server.active
    world.server.feedback(MoveObject.Feedback(push_index=2))
    assert world.until(lambda: feedback)
    assert feedback[0].push_index == 2
    world.server.finish(MoveObject.Result(pushes=3), success=True)
    assert world.until(lambda: results and GoalStatus.STATUS_SUCCEEDED in world.statuses)
    assert results[0].pushes == 3 and not world.server.active


def test_a_goal_under_way_costs_no_processor_time(world):
    """A task that waits would be polled by the events executor."""
    world.client.send(MoveObject.Goal(object="box"), lambda result: None)
    assert world.until(lambda: world.server.active)
    world.until(lambda: False, 0.2)
    before = time.thread_time()
    end = time.monotonic() + 1.0
    while time.monotonic() < end:
        world.executor.spin_once(timeout_sec=0.1)
    assert time.thread_time() - before < 0.3


def test_cancel_ends_as_canceled(world):
    world.client.send(MoveObject.Goal(object="box"), lambda result: None)
    assert world.until(lambda: GoalStatus.STATUS_EXECUTING in world.statuses)
    world.client.forget()
    assert world.until(lambda: GoalStatus.STATUS_CANCELED in world.statuses)
    assert world.canceled == 1 and not world.server.active


def test_failure_ends_as_aborted_with_its_code(world):
    results = []
    world.client.send(MoveObject.Goal(object="box"), results.append)
    assert world.until(lambda: world.server.active)
    world.server.finish(MoveObject.Result(error_code=306, error_msg="no way"), success=False)
    assert world.until(lambda: results and GoalStatus.STATUS_ABORTED in world.statuses)
    assert (results[0].error_code, results[0].error_msg) == (306, "no way")


def test_a_new_goal_replaces_the_old_one_which_is_told_so(world):
    first, second = [], []
    future = world.plain.send_goal_async(MoveObject.Goal(object="one"))
    assert world.until(future.done)
    future.result().get_result_async().add_done_callback(lambda f: first.append(f.result()))
    assert world.until(lambda: world.started == ["one"])
    world.client.send(MoveObject.Goal(object="two"), second.append)
    assert world.until(lambda: first)
    assert first[0].status == GoalStatus.STATUS_ABORTED and first[0].result.error_code == 311
    assert world.started == ["one", "two"] and world.server.active
    world.server.finish(MoveObject.Result(), success=True)
    assert world.until(lambda: second)


def test_cancel_of_a_goal_that_was_replaced_leaves_the_new_one_alone(world):
    future = world.plain.send_goal_async(MoveObject.Goal(object="one"))
    assert world.until(future.done)
    world.client.send(MoveObject.Goal(object="two"), lambda result: None)
    assert world.until(lambda: world.started == ["one", "two"])
    answer = future.result().cancel_goal_async()
    assert world.until(answer.done)
    assert world.canceled == 0 and world.server.active


def test_a_rejected_goal_is_answered_and_starts_nothing(world):
    results = []
    world.client.send(MoveObject.Goal(object="bad"), results.append)
    assert world.until(lambda: results)
    assert results == [None] and world.started == []


def test_a_refused_goal_gets_its_own_result_and_leaves_the_other_alone(world):
    first, second = [], []
    future = world.plain.send_goal_async(MoveObject.Goal(object="one"))
    assert world.until(future.done)
    future.result().get_result_async().add_done_callback(lambda f: first.append(f.result()))
    assert world.until(lambda: world.server.active)
    world.client.send(MoveObject.Goal(object="odd"), second.append)
    assert world.until(lambda: second)
    assert second[0].error_code == 301
    assert world.started == ["one"] and world.server.active and not first
    world.server.finish(MoveObject.Result(pushes=2), success=True)
    assert world.until(lambda: first)
    assert first[0].result.pushes == 2 and first[0].status == GoalStatus.STATUS_SUCCEEDED


@pytest.fixture
def slow(ros):
    """A server that answers whether it takes a goal when it is told to."""
    world = World()
    world.asked = []
    world.server._consider = lambda request, answer: world.asked.append(answer)
    yield world
    world.close()


def test_a_goal_that_is_judged_for_a_while_leaves_the_one_under_way_alone(slow):
    results = {"a": [], "b": [], "c": []}
    plain = GoalClient(slow.node, MoveObject, "/job")
    slow.client.send(MoveObject.Goal(object="a"), results["a"].append)
    assert slow.until(lambda: len(slow.asked) == 1) and not slow.started
    slow.asked[0](None)
    assert slow.until(lambda: slow.started == ["a"])
    plain.send(MoveObject.Goal(object="b"), results["b"].append)
    assert slow.until(lambda: len(slow.asked) == 2)
    assert slow.server.active and not results["a"]
    slow.asked[1](MoveObject.Result(error_code=306))
    assert slow.until(lambda: bool(results["b"]))
    assert results["b"][0].error_code == 306 and slow.server.active and not results["a"]
    plain.send(MoveObject.Goal(object="c"), results["c"].append)
    assert slow.until(lambda: len(slow.asked) == 3)
    slow.asked[2](None)
    assert slow.until(lambda: slow.started == ["a", "c"] and bool(results["a"]))
    assert results["a"][0].error_code == 311


def test_a_goal_that_is_canceled_while_it_is_judged_is_not_taken(slow):
    sent = slow.plain.send_goal_async(MoveObject.Goal(object="a"))
    assert slow.until(lambda: sent.done() and len(slow.asked) == 1)
    handle = sent.result()
    answer, canceled = handle.get_result_async(), handle.cancel_goal_async()
    assert slow.until(canceled.done) and canceled.result().goals_canceling
    slow.asked[0](None)
    assert slow.until(answer.done)
    assert answer.result().status == GoalStatus.STATUS_CANCELED
    assert not slow.started and not slow.canceled and not slow.server.active


def test_a_goal_may_be_left_to_be_replaced_by_the_next_one(world):
    """It is not canceled, not even for a moment."""
    first, second = [], []
    world.client.send(MoveObject.Goal(object="box"), first.append)
    assert world.until(lambda: world.server.active and world.client._handle is not None)
    world.client.send(MoveObject.Goal(object="crate"), second.append, cancel=False)
    assert world.until(lambda: world.started == ["box", "crate"])
    world.until(lambda: False, 0.3)
    assert world.canceled == 0 and world.server.active
    world.server.finish(MoveObject.Result(pushes=2), success=True)
    assert world.until(lambda: second) and not first


@pytest.mark.parametrize("forgotten", [False, True])
def test_a_goal_that_nothing_has_replaced_is_canceled(world, forgotten):
    """Also where the client has forgotten both by then."""
    results = []
    world.client.send(MoveObject.Goal(object="box"), lambda result: None)
    assert world.until(lambda: world.server.active and world.client._handle is not None)
    world.client.send(MoveObject.Goal(object="bad"), results.append, cancel=False)
    if forgotten:
        world.client.forget()
    assert world.until(lambda: world.canceled == 1) and not world.server.active
    assert results == ([] if forgotten else [None])
