"""A goal that comes to the node of a method before the map: it waits, and is told how it ends.

A job that a new map ends is told of in the same way."""

from dataclasses import replace

import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from std_srvs.srv import Trigger

from push_job.method import Unsuited
from push_model.jobs import JobError
from push_model.occupancy import OccupancyGrid as Grid
from push_msgs.msg import JobState
from push_ros import method_node
from push_ros.conversions import grid_to_ros, pose_stamped_to_ros
from push_ros.latched import visitor
from push_ros.method_node import MethodNode
from push_ros.process import Spinner
from push_ros.qos import COMMAND, LATCHED
from push_scenario.scenario import load_scenario


class Client:
    """Publishes goal and map, hears the state of the job."""

    def __init__(self, node, scenario):
        self.node, self.scenario, self.states = node, scenario, []
        self.goals = node.create_publisher(PoseStamped, "/goal_pose", COMMAND)
        self.maps = node.create_publisher(OccupancyGrid, "/map", LATCHED)
        node.create_subscription(JobState, "/job_state", self.states.append, LATCHED)

    @property
    def last(self):
        return self.states[-1]


@pytest.fixture(params=["group-ellipse", "swarm-square"])
def pair(request, ros):
    scenario = load_scenario(request.param)
    node = MethodNode(request.param.split("-")[0], scenario)
    with visitor() as (visiting, other):
        spinner, client = Spinner([node]), Client(visiting, scenario)

        def until(condition, limit=20.0):
            return other.until(lambda: bool(spinner.once(0.01) or condition()), limit)

        assert until(lambda: client.states and client.goals.get_subscription_count())
        yield node, client, until
        spinner.close()


def send(client, goal=None):
    message = pose_stamped_to_ros(client.scenario.goal if goal is None else goal, 1.0)
    client.goals.publish(message)
    return message


def unsuited(arena):
    raise Unsuited("the room is too narrow")


def test_it_begins_when_the_map_is_there(pair):
    node, client, until = pair
    goal = send(client)
    assert until(lambda: client.last.job == 1)
    assert client.last.state_name == "PLANNING" and client.last.reason == "waiting for a map"
    assert client.last.goal == goal
    client.maps.publish(grid_to_ros(client.scenario.grid, 0.0))
    assert until(lambda: node.method is not None and client.last.reason != "waiting for a map")
    assert node.busy and client.last.job == 1 and client.last.state != JobState.IDLE
    named = {s.reason for s in client.states if s.job == 1 and s.state == JobState.IDLE}
    assert not named, "nobody was told that this job had ended"


def test_one_that_the_map_does_not_allow_is_refused_then(pair):
    node, client, until = pair
    send(client, (50.0, 0.0, 0.0))
    assert until(lambda: client.last.job == 1)
    client.maps.publish(grid_to_ros(client.scenario.grid, 0.0))
    assert until(lambda: client.last.state == JobState.IDLE)
    assert client.last.error_code == JobError.OUTSIDE_MAP
    assert client.last.reason == "the goal is outside the map"
    send(client)
    assert until(lambda: client.last.job == 2) and node.busy, "the next one is taken"


def test_it_can_be_canceled_and_does_not_begin_later(pair):
    node, client, until = pair
    send(client)
    assert until(lambda: client.last.job == 1)
    asked = client.node.create_client(Trigger, "/cancel")
    assert until(asked.service_is_ready)
    answer = asked.call_async(Trigger.Request())
    assert until(answer.done) and answer.result().success
    assert until(lambda: client.last.state == JobState.IDLE)
    assert client.last.error_code == JobError.CANCELED
    client.maps.publish(grid_to_ros(client.scenario.grid, 0.0))
    assert until(lambda: node.method is not None)
    assert not node.busy and client.last.error_code == JobError.CANCELED


def test_without_a_map_it_ends_and_says_why(pair, monkeypatch):
    monkeypatch.setattr(method_node, "PATIENCE", 0.5)
    _, client, until = pair
    send(client)
    assert until(lambda: client.last.job == 1)
    assert until(lambda: client.last.state == JobState.IDLE)
    assert client.last.error_code == JobError.PLANNING_FAILED
    assert client.last.reason == "no map has been received on /map"


@pytest.mark.parametrize("suited", [True, False])
def test_a_new_map_during_a_job_leaves_its_end_to_read(pair, suited):
    """The topic is latched: who looks late must not take the new method's idleness for success."""
    node, client, until = pair
    client.maps.publish(grid_to_ros(client.scenario.grid, 0.0))
    assert until(lambda: node.method is not None)
    send(client)
    assert until(lambda: node.busy and client.last.job == 1)
    grid, old = client.scenario.grid, node.method
    if not suited:
        node.spec = replace(node.spec, make=unsuited)
    occupied = grid.occupied.copy()
    occupied[0, 0] = not occupied[0, 0]
    client.maps.publish(grid_to_ros(Grid(occupied, grid.resolution, grid.origin), 1.0))
    assert until(lambda: node.method is not old and client.last.state == JobState.IDLE)
    until(lambda: False, 0.3)
    assert (client.last.job, client.last.error_code) == (1, JobError.PREEMPTED)
    assert client.last.reason == "the map has changed" and not node.busy
    if suited:
        send(client)
        assert until(lambda: client.last.job == 2 and node.busy), "the next one is taken"
