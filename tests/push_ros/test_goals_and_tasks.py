"""Goals and tasks of other actions on the node of a method: which of them replaces which."""

from dataclasses import replace

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.action import ActionClient
from std_srvs.srv import Trigger

from push_job.method import Certificate, Told
from push_job.report import Status
from push_model.jobs import JobError, JobPhase
from push_msgs.action import MoveObject, SwarmMove
from push_msgs.msg import JobState
from push_ros.conversions import grid_to_ros, pose_stamped_to_ros
from push_ros.latched import visitor
from push_ros.method_node import MethodNode
from push_ros.process import Spinner
from push_ros.qos import COMMAND, LATCHED
from push_scenario.scenario import load_scenario
from swarm_push.node import HOSTING
from swarm_push.swarm_method import SWARM

SCENARIO = load_scenario("swarm-square")
GOAL, OTHER = np.array([0.5, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])


class Method:
    """Works on any task until it is told to end; judges nothing while it is ``held``."""

    held = False

    def __init__(self, arena):
        self.status, self.task = Status(int(JobPhase.IDLE), "IDLE", "waiting for a goal"), None

    def assess(self, task, belief, seen):
        return Certificate()

    def assess_in_slices(self, task, belief, seen):
        while Method.held:
            yield 10_000
        return Certificate()

    def begin(self, task, belief):
        self.task = task
        self.status = Status(int(JobPhase.PUSHING), "PUSHING", "at work")

    def step(self, seen, belief):
        return Told()

    def end(self, code, reason):
        if self.status.phase != JobPhase.IDLE:
            self.status = Status(int(JobPhase.IDLE), "IDLE", reason, int(code))

    def revive(self):
        pass

    def report(self, seen):
        return None

    def errors(self, seen):
        return 1.0, 0.0

    def facts(self):
        return {}


class Client:
    """One or two people with a swarm."""

    def __init__(self, node, visiting, until):
        self.node, self.until, self.states = node, until, []
        self.topic = visiting.create_publisher(PoseStamped, "/goal_pose", COMMAND)
        self.maps = visiting.create_publisher(OccupancyGrid, "/map", LATCHED)
        visiting.create_subscription(JobState, "/job_state", self.states.append, LATCHED)
        self.move = ActionClient(visiting, MoveObject, "/move_object")
        self.targets = ActionClient(visiting, SwarmMove, "/swarm_move")
        self.cancel = visiting.create_client(Trigger, "/cancel")

    @property
    def state(self):
        return self.states[-1]

    @property
    def task(self):
        return self.node.method.task

    def reached(self):
        return (
            self.states
            and self.topic.get_subscription_count()
            and self.maps.get_subscription_count()
            and self.move.server_is_ready()
            and self.targets.server_is_ready()
            and self.cancel.service_is_ready()
        )

    def publish_map(self):
        self.maps.publish(grid_to_ros(SCENARIO.grid, 0.0))

    def publish(self, goal):
        self.topic.publish(pose_stamped_to_ros(goal, 1.0))

    def send(self, client, request):
        sent = client.send_goal_async(request)
        assert self.until(sent.done) and sent.result().accepted
        return sent.result()

    def call_cancel(self):
        called = self.cancel.call_async(Trigger.Request())
        assert self.until(called.done)
        return called.result()

    def code(self, answer):
        assert self.until(answer.done)
        return answer.result().result.error_code


@pytest.fixture
def unmapped(ros):
    """There is no map yet."""
    node = MethodNode(replace(SWARM, make=Method), SCENARIO, hosting=HOSTING)
    with visitor() as (visiting, other):
        spinner = Spinner([node])

        def until(condition, limit=20.0):
            return other.until(lambda: bool(spinner.once(0.01) or condition()), limit)

        client = Client(node, visiting, until)
        assert until(client.reached)
        yield client
        Method.held = False
        spinner.close()


@pytest.fixture
def client(unmapped):
    unmapped.publish_map()
    assert unmapped.until(lambda: unmapped.node.method is not None)
    return unmapped


def pose(goal):
    return pose_stamped_to_ros(goal, 0.0)


TARGETS = SwarmMove.Goal(x=[0.2, 0.4], y=[0.1, 0.1])


@pytest.mark.parametrize("by", ["topic", "action"])
def test_a_goal_of_an_earlier_job_replaces_the_task_that_came_after_it(client, by):
    client.publish(GOAL)
    assert client.until(lambda: client.state.job == 1 and client.node.busy)
    assert client.call_cancel().success and not client.node.busy
    handle = client.send(client.targets, TARGETS)
    answer = handle.get_result_async()
    assert client.until(lambda: client.state.state == JobState.PUSHING)
    assert client.state.job == 2 and len(client.task.targets) == 2
    assert client.state.goal == PoseStamped(), "the goal of another job is not this one's"
    if by == "topic":
        client.publish(GOAL)
    else:
        client.send(client.move, MoveObject.Goal(goal=pose(GOAL)))
    assert client.code(answer) == JobError.PREEMPTED
    assert client.until(lambda: client.state.job == 3 and client.state.state == JobState.PUSHING)
    assert client.task.goal[:2] == pytest.approx(GOAL[:2])
    client.publish(GOAL)
    client.until(lambda: False, 0.3)
    assert client.state.job == 3, "the goal that is pursued changes nothing"


def test_a_task_after_a_goal_is_another_job(client):
    """The client of the goal hears that it was replaced; the state is not that of its job."""
    waits = client.send(client.move, MoveObject.Goal(goal=pose(GOAL))).get_result_async()
    assert client.until(lambda: client.state.job == 1)
    client.send(client.targets, TARGETS)
    assert client.code(waits) == JobError.PREEMPTED
    assert client.until(lambda: client.state.job == 2 and client.state.state == JobState.PUSHING)


def at_the_door(client):
    """A's job is under way, and B's goal is being judged."""
    handle = client.send(client.move, MoveObject.Goal(goal=pose(GOAL)))
    assert client.until(lambda: client.state.state == JobState.PUSHING)
    Method.held = True
    client.publish(OTHER)
    assert client.until(lambda: client.node._door.busy)
    return handle


def test_who_cancels_its_own_job_leaves_the_goal_of_another_at_the_door(client):
    handle = at_the_door(client)
    canceled = handle.cancel_goal_async()
    assert client.until(canceled.done)
    assert client.code(handle.get_result_async()) == JobError.CANCELED
    Method.held = False
    assert client.until(lambda: client.state.job == 2 and client.state.state == JobState.PUSHING)
    assert client.state.refusals == 0 and client.task.goal[:2] == pytest.approx(OTHER[:2])


def test_cancel_for_all_refuses_the_goal_at_the_door_too(client):
    handle = at_the_door(client)
    assert client.call_cancel().success
    assert client.code(handle.get_result_async()) == JobError.CANCELED
    assert client.until(lambda: client.state.refusals == 1)
    assert client.state.refusal_code == JobError.CANCELED
    Method.held = False
    client.until(lambda: False, 0.3)
    assert client.state.job == 1 and not client.node.busy


def test_a_goal_before_the_map_that_is_canceled_while_it_is_judged_stays_canceled(unmapped):
    """The judgement ends later, and has nothing left to begin."""
    client, node = unmapped, unmapped.node
    Method.held = True
    handle = client.send(client.move, MoveObject.Goal(goal=pose(GOAL)))
    assert client.until(lambda: client.state.job == 1)
    client.publish_map()
    assert client.until(lambda: node._door.busy)
    canceled = handle.cancel_goal_async()
    assert client.until(canceled.done)
    assert client.code(handle.get_result_async()) == JobError.CANCELED
    Method.held = False
    assert client.until(lambda: not node._door.busy or bool(node._door.go_on()))
    client.until(lambda: False, 0.3)
    assert client.state.error_code == JobError.CANCELED and client.task is None
