"""The planner node: modes, bodies, maps that change, and requests that replace each other."""

from dataclasses import replace

import numpy as np
import pytest
import rclpy
from nav_msgs.msg import OccupancyGrid, Path
from rclpy.action import ActionClient

from push_model.belief import Interval
from push_model.occupancy import rasterise
from push_model.specs import BoxSpec, EnvironmentSpec
from push_msgs.action import PlanPush
from push_msgs.msg import Belief, Circle, PushPlan
from push_msgs.srv import PlanRobotPath
from push_planner.node import PlannerNode
from push_ros import map_feed
from push_ros.conversions import grid_to_ros, pose_stamped_to_ros, pose_to_ros
from push_ros.process import Spinner
from push_ros.qos import BELIEF, LATCHED
from push_ros.report_conversions import belief_to_ros
from push_scenario.scenario import load_scenario
from tests.push_planner.preemptive_case import needs_preemptive_push

START, GOAL = np.array([-0.45, 0.0, 0.0]), np.array([0.4, 0.2, 0.2])
WALL = EnvironmentSpec((3.0, 2.0), boxes=(BoxSpec((0.4, 0.2), (0.2, 0.2)),))
R = PlanPush.Result


class Client:
    """Asks a planner node, on a map of its own."""

    def __init__(self, scenario, mapped=True):
        """mapped: whether there is a map from the start."""
        self.node = rclpy.create_node("client")
        self.planner = PlannerNode(scenario)
        self.spinner = Spinner([self.planner, self.node])
        self.plans, self.paths, self.stages = [], [], []
        self.node.create_subscription(PushPlan, "/push_plan", self.plans.append, LATCHED)
        self.node.create_subscription(Path, "/push_path", self.paths.append, LATCHED)
        self.maps = self.node.create_publisher(OccupancyGrid, "/map", LATCHED)
        self.action = ActionClient(self.node, PlanPush, "/plan_push")
        if mapped:
            self.map(scenario.grid)
        ready = lambda: self.planner.ready >= mapped and self.action.server_is_ready()  # noqa: E731
        assert self.spinner.until(ready, 15.0)

    def map(self, grid):
        self.maps.publish(grid_to_ros(grid, 0.0))

    def send(self, goal=GOAL, **fields):
        request = PlanPush.Goal(
            start=pose_stamped_to_ros(START, 0.0), goal=pose_stamped_to_ros(goal, 0.0), **fields
        )
        sent = self.action.send_goal_async(request, lambda m: self.stages.append(m.feedback.stage))
        assert self.spinner.until(sent.done, 10.0) and sent.result().accepted
        return sent.result()

    def result(self, handle):
        answer = handle.get_result_async()
        assert self.spinner.until(answer.done, 120.0)
        self.spinner.until(lambda: False, 0.1)
        return answer.result().result


def make(mapped=True, **changes):
    return Client(load_scenario("short").settings("planner", **changes), mapped)


@pytest.fixture
def client(ros):
    client = make(improvement_rounds=0)
    yield client
    client.spinner.close()


def test_the_answer_is_what_was_published_last(client):
    result = client.result(client.send())
    assert result.error_code == R.NONE and client.plans[-1] == result.plan
    count = sum(len(s.trajectory.time) > 1 for s in result.plan.segments)
    assert count == len(result.plan.segments) and len(client.paths[-1].poses) > 50


@pytest.mark.long
def test_a_plan_with_a_pre_emptive_push_is_published_whole(ros):
    _, goal, few = needs_preemptive_push(load_scenario("short"), START)
    client = make(**few)
    try:
        direct = client.result(client.send(goal))
        assert direct.error_code == R.NO_PUSH_SEQUENCE and not client.plans
        whole = client.result(client.send(goal, mode=PlanPush.Goal.PREEMPTIVE))
        assert whole.error_code == R.NONE, whole.error_msg
        assert client.plans[-1] == whole.plan and len(whole.plan.segments) >= 2
        first = whole.plan.segments[0].object_start.position
        assert (first.x, first.y) == pytest.approx(tuple(START[:2]))
        assert any("pre-emptive push" in stage for stage in client.stages)
    finally:
        client.spinner.close()


def test_bodies_stand_in_the_way_of_this_plan_only(client):
    on_the_goal = [Circle(x=0.4, y=0.2, radius=0.06)]
    assert client.result(client.send(obstacles=on_the_goal)).error_code == R.GOAL_OCCUPIED
    assert client.result(client.send()).error_code == R.NONE


@pytest.mark.parametrize(
    "fields",
    [
        {"mode": 7},
        {"obstacles": [Circle(x=0.0, y=0.0, radius=-0.1)]},
        {"obstacles": [Circle(x=float("nan"), y=0.0, radius=0.1)]},
    ],
)
def test_requests_that_cannot_be_are_refused(client, fields):
    result = client.result(client.send(**fields))
    assert result.error_code == R.INVALID_GOAL and result.error_msg


def test_a_new_map_drops_a_plan_under_way_and_begins_it_anew(client):
    """The same map again changes nothing."""
    handle = client.send()
    assert client.spinner.until(lambda: client.planner._work is not None, 10.0)
    work = client.planner._work
    client.map(client.planner._grid)
    client.spinner.until(lambda: False, 0.2)
    assert client.planner._work in (work, None)
    handle = client.send()
    assert client.spinner.until(lambda: client.planner._work is not None, 10.0)
    client.map(rasterise(WALL))
    assert client.result(handle).error_code == R.GOAL_OCCUPIED


@pytest.mark.parametrize(("item", "anew"), [("other", False), ("box", True)])
def test_a_belief_begins_a_plan_anew_only_if_it_is_about_its_object(ros, item, anew):
    scenario = load_scenario("short")
    spec, _ = scenario.objects["box"]
    scenario = replace(scenario, objects={**scenario.objects, "other": (spec, np.ones(3))})
    client = Client(scenario)
    beliefs = client.node.create_publisher(Belief, "/belief", BELIEF)
    assert client.spinner.until(lambda: beliefs.get_subscription_count() > 0, 10.0)
    try:
        client.send(object="box")
        assert client.spinner.until(lambda: client.planner._work is not None, 10.0)
        work, before = client.planner._work, client.planner._beliefs.current
        values = {(item, "contact_friction"): Interval(0.31, 0.3, 0.4)}
        beliefs.publish(belief_to_ros("estimator", values))
        assert client.spinner.until(lambda: client.planner._beliefs.current != before, 10.0)
        assert client.planner._work is not None
        assert (client.planner._work is not work) is anew
    finally:
        client.spinner.close()


@pytest.fixture
def unmapped(ros):
    client = make(mapped=False, improvement_rounds=0)
    yield client
    client.spinner.close()


def test_a_request_before_the_first_map_waits_for_it(unmapped):
    """So it is with a planner that has just been started again. Paths are offered with the map."""
    paths = unmapped.node.create_client(PlanRobotPath, "/plan_robot_path")
    handle = unmapped.send()
    unmapped.spinner.until(lambda: False, 0.5)
    assert unmapped.planner._work is None and not paths.service_is_ready()
    unmapped.map(load_scenario("short").grid)
    assert unmapped.result(handle).error_code == R.NONE
    assert unmapped.spinner.until(paths.service_is_ready, 10.0)
    answer = paths.call_async(PlanRobotPath.Request(start=pose_to_ros(START - [0.3, 0.0, 0.0])))
    assert unmapped.spinner.until(answer.done, 10.0) and answer.result().error_code == 0


def test_a_request_that_is_cancelled_before_the_first_map_does_not_begin_with_it(unmapped):
    handle = unmapped.send()
    handle.cancel_goal_async()
    assert unmapped.result(handle).error_code == R.CANCELED
    unmapped.map(load_scenario("short").grid)
    assert unmapped.spinner.until(lambda: unmapped.planner.ready, 10.0)
    unmapped.spinner.until(lambda: False, 0.5)
    assert unmapped.planner._work is None and not unmapped.plans


def test_without_a_map_a_request_ends_and_says_why(unmapped, monkeypatch):
    """New beliefs meanwhile do not make it wait longer."""
    monkeypatch.setattr(map_feed, "PATIENCE", 0.5)
    answer = unmapped.send().get_result_async()
    believed = unmapped.planner._believe  # what each new belief does
    assert unmapped.spinner.until(lambda: bool(believed() or answer.done()), 10.0)
    result = answer.result().result
    assert result.error_code == R.NO_MAP and result.error_msg == "no map has been received on /map"


def test_what_is_too_heavy_is_not_planned(ros):
    scenario = load_scenario("short")
    spec, place = scenario.objects["box"]
    client = Client(replace(scenario, objects={"box": (replace(spec, mass=0.3), place)}))
    try:
        result = client.result(client.send())
        assert result.error_code == R.TOO_HEAVY and "needs" in result.error_msg
        assert not client.plans and not client.stages
    finally:
        client.spinner.close()


def test_a_flood_of_requests_leaves_the_last_one_and_one_chain_of_slices(client):
    """Slices queue the next ones once: with two chains, each request would take two turns of the
    executor."""
    handles = [client.send(GOAL + [0.0, 0.02 * k, 0.0]) for k in range(-5, 6)]
    slices = []
    step = client.planner._on_slices
    client.planner._on_slices = lambda: (slices.append(client.planner._queued), step())
    results = [client.result(handle) for handle in handles]
    assert [r.error_code for r in results] == [R.CANCELED] * 10 + [R.NONE]
    assert results[-1].plan.goal.position.y == pytest.approx(0.3)
    assert client.planner.plans == 1 and all(slices)


def test_a_cancel_ends_it_at_once(client):
    handle = client.send()
    assert client.spinner.until(lambda: client.planner._work is not None, 10.0)
    handle.cancel_goal_async()
    assert client.result(handle).error_code == R.CANCELED
    assert client.planner._work is None


def test_a_robot_that_cannot_push_starts_and_says_so(ros):
    scenario = load_scenario("short")
    ring = load_scenario("ring20").robot()[1]
    robots = {name: (ring, *rest) for name, (_, *rest) in scenario.robots.items()}
    client = Client(replace(scenario, robots=robots))
    try:
        result = client.result(client.send())
        assert result.error_code == R.NO_PUSH_SEQUENCE
        assert "a flat bumper is needed" in result.error_msg and "'box'" in result.error_msg
    finally:
        client.spinner.close()
