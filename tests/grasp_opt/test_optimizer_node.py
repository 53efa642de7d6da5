"""The optimizer's node: a request can be cancelled at any time, in the hardest plans too."""

import time

import numpy as np
import pytest
import rclpy
from nav_msgs.msg import OccupancyGrid
from rclpy.action import ActionClient

from grasp_opt.optimizer_node import OptimizerNode
from grasp_opt.sequencing import NoStep
from grasp_opt.step_planner import Scene, StepPlanner
from push_model import object_way
from push_model.occupancy import rasterise
from push_model.settings import from_mapping
from push_model.specs import EnvironmentSpec
from push_msgs.action import PlanGroupPush
from push_ros import map_feed
from push_ros.conversions import grid_to_ros, pose_stamped_to_ros, pose_to_ros
from push_ros.process import Spinner
from push_ros.qos import LATCHED
from push_scenario.bodies import load_object, load_robot
from push_scenario.scenario import scenario_from_mapping
from push_study.experiments.group_goals import GoalTask, problem

R = PlanGroupPush.Result
LONGEST = 0.5  # [s] in which a cancel is to be heard
TRIANGLE = {
    "environment": {"size": [4.0, 3.0]},
    "robots": {
        f"e{i}": {"type": "epuck_ring", "start": [-1.2, y, 0.0]} for i, y in enumerate((-0.4, 0.4))
    },
    "objects": {"plate": {"type": "plate_triangle", "start": [0.0, 0.0, 0.0]}},
}
"""Two robots hold few motions of a triangle: its plans have detours."""


def slices(seed, count):
    """CPU time [s] of every slice of a hard plan: a triangle among obstacles."""
    p = problem(GoalTask("obstacles", seed, "", count, 3, "planar", "mild"))
    planner = StepPlanner(rasterise(p.environment), p.item, load_robot("epuck_ring"))
    return times_of(planner.planning(Scene(p.start, p.robots, (), np.zeros((0, 3))), p.goal))


def times_of(work):
    """CPU time [s] of every slice, until there is a plan or none is found."""
    times = []
    while True:
        began = time.thread_time()
        try:
            next(work)
        except (StopIteration, NoStep):
            return times
        times.append(time.thread_time() - began)


def test_no_slice_of_a_plan_is_long():
    """Of two runs, which have the same slices, the quicker one of each: the machine may be busy."""
    first, again = slices(0, 3), slices(0, 3)
    times = [min(pair) for pair in zip(first, again, strict=True)]
    assert len(times) > 50 and max(times) < LONGEST


@pytest.mark.study
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("count", [2, 3])
def test_no_slice_of_the_hardest_plans_is_long(seed, count):
    slices(1, 3)
    times = slices(seed, count)
    assert len(times) > 50 and max(times) < LONGEST


def test_a_long_search_for_the_objects_way_is_cut_into_slices():
    """Through the gap in the wall a disc fits that lies in the triangle, but not the triangle: the
    search looks at all that can be reached before it gives up."""
    walls = [{"centre": [1.0, s * 2.1], "size": [0.1, 3.8]} for s in (-1, 1)]
    values = {"size": [12.0, 8.0], "resolution": 0.02, "boxes": walls}
    grid = rasterise(from_mapping(EnvironmentSpec, values, "room"))
    start, goal = np.array([-5.4, 0.0, 0.0]), np.array([5.0, 0.0, 2.0])
    planner = StepPlanner(grid, load_object("plate_triangle"), load_robot("epuck_ring"))
    robots = np.array([[-5.0, y, 0.0] for y in (-1.0, 1.0)])
    object_way.warm_up()
    times = times_of(planner.planning(Scene(start, robots, (), np.zeros((0, 3))), goal))
    assert len(times) > 8 and max(times) < LONGEST


class Client:
    """Asks an optimizer's node for steps of the triangle."""

    def __init__(self, mapped=True):
        """mapped: whether there is a map from the start."""
        scenario = self.scenario = scenario_from_mapping(TRIANGLE, "test", "test")
        self.node, self.optimizer = rclpy.create_node("client"), OptimizerNode(scenario)
        self.spinner = Spinner([self.optimizer, self.node])
        self.maps = self.node.create_publisher(OccupancyGrid, "/map", LATCHED)
        self.action = ActionClient(self.node, PlanGroupPush, "/plan_group_push")
        if mapped:
            self.map()
        ready = lambda: self.optimizer.ready >= mapped and self.action.server_is_ready()  # noqa: E731
        assert self.spinner.until(ready, 30.0)

    def map(self):
        self.maps.publish(grid_to_ros(self.scenario.grid, 0.0))

    def send(self, goal):
        robots = [np.array([-1.2, y, 0.0]) for y in (-0.4, 0.4)]
        request = PlanGroupPush.Goal(
            robots=["e0", "e1"],
            start=pose_to_ros(np.zeros(3)),
            goal=pose_stamped_to_ros(np.array(goal), 0.0),
            places=[pose_to_ros(pose) for pose in robots],
        )
        sent = self.action.send_goal_async(request)
        assert self.spinner.until(sent.done, 10.0) and sent.result().accepted
        return sent.result()

    def result(self, handle, limit=60.0):
        answer = handle.get_result_async()
        assert self.spinner.until(answer.done, limit)
        return answer.result().result


@pytest.fixture
def client(ros):
    client = Client()
    yield client
    client.spinner.close()


@pytest.fixture
def unmapped(ros):
    client = Client(mapped=False)
    yield client
    client.spinner.close()


def test_a_request_before_the_first_map_waits_for_it(unmapped):
    """So it is with a goal that comes just after the start: the map may reach the job's owner
    before the optimizer."""
    handle = unmapped.send([0.3, 0.0, 0.0])
    unmapped.spinner.until(lambda: False, 0.5)
    assert unmapped.optimizer._work is None
    unmapped.map()
    assert unmapped.result(handle).error_code == R.NONE


def test_a_request_that_is_cancelled_before_the_first_map_does_not_begin_with_it(unmapped):
    handle = unmapped.send([0.3, 0.0, 0.0])
    handle.cancel_goal_async()
    assert unmapped.result(handle).error_code == R.CANCELED
    unmapped.map()
    assert unmapped.spinner.until(lambda: unmapped.optimizer.ready, 10.0)
    unmapped.spinner.until(lambda: False, 0.5)
    assert unmapped.optimizer._work is None and unmapped.optimizer.plans == 0


def test_without_a_map_a_request_ends_and_says_why(unmapped, monkeypatch):
    monkeypatch.setattr(map_feed, "PATIENCE", 0.5)
    result = unmapped.result(unmapped.send([0.3, 0.0, 0.0]))
    assert result.error_code == R.NO_MAP and result.error_msg == "no map has been received on /map"


def test_a_cancel_is_heard_while_a_hard_plan_is_made(client):
    """A turn on the spot, for which two robots need a detour: seconds of work."""
    handle = client.send([0.0, 0.0, 2.5])
    began = time.thread_time()
    client.spinner.until(lambda: time.thread_time() - began > 0.3, 10.0)
    assert client.optimizer._work is not None, "the plan was too easy for this test"
    began = time.thread_time()
    handle.cancel_goal_async()
    assert client.result(handle).error_code == R.CANCELED
    assert time.thread_time() - began < LONGEST and client.optimizer._work is None


def test_a_new_request_replaces_the_one_under_way(client):
    """Each slice queues one: with two chains of them, ``_queued`` would be false in some."""
    first, second = client.send([0.0, 0.0, 2.5]), client.send([0.0, 0.0, -2.5])
    chain, step = [], client.optimizer._on_slice
    client.optimizer._on_slice = lambda: (chain.append(client.optimizer._queued), step())
    assert client.result(first).error_code == R.CANCELED
    assert client.spinner.until(lambda: len(chain) > 50, 30.0) and all(chain)
    second.cancel_goal_async()
    assert client.result(second).error_code == R.CANCELED


def test_a_goal_at_the_start_and_an_error_of_the_planner_end_the_request_only(client, monkeypatch):
    answer = client.result(client.send([0.0, 0.0, 0.0]))
    assert answer.error_code == R.NO_STEP and "at the goal already" in answer.error_msg

    def broken(*_):
        raise ZeroDivisionError("float division by zero")

    with monkeypatch.context() as patch:
        patch.setattr(StepPlanner, "planning", broken)
        answer = client.result(client.send([0.3, 0.0, 0.0]))
    assert answer.error_code == R.NO_STEP and "ZeroDivisionError" in answer.error_msg
    assert client.result(client.send([0.3, 0.0, 0.0])).error_code == 0
