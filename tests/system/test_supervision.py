"""The supervisor among the other nodes: goals in every state; bodies, maps, worlds that change."""

from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.action import ActionClient
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from push_model.jobs import JobError
from push_model.occupancy import rasterise
from push_model.specs import BoxSpec, EnvironmentSpec
from push_msgs.action import MoveObject
from push_msgs.msg import JobState, PushPlan
from push_ros.conversions import grid_to_ros, pose_stamped_to_ros
from push_ros.qos import COMMAND, LATCHED
from push_scenario.scenario import load_scenario
from push_study.graph_run import LockstepRun
from push_study.observer import final_errors
from push_supervisor.node import SupervisorNode
from tests.push_planner.preemptive_case import needs_preemptive_push

START = np.array([-0.45, 0.0, 0.0])
RUNNING = ("DETACHING", "PLANNING", "POSITIONING", "APPROACH", "PUSHING")
"""In the order of a job whose robot is at the object when it begins."""


class Run:
    """A lockstep run, what it is asked, and what is driven."""

    def __init__(self, run):
        self.run, self.goal = run, run.scenario.goal
        node = run.observer
        self.plans, self.driven = [], []
        node.create_subscription(PushPlan, "/push_plan", self.plans.append, LATCHED)
        self.maps = node.create_publisher(OccupancyGrid, "/map", LATCHED)
        self.worlds = node.create_publisher(String, "/scenario", LATCHED)
        self.topic = node.create_publisher(PoseStamped, "/goal_pose", COMMAND)
        self.action = ActionClient(node, MoveObject, "/move_object")
        self.results = []
        run.start()
        topics = (self.topic, self.maps, self.worlds)
        assert run.spinner.until(self.action.server_is_ready, 10.0)
        assert run.spinner.until(lambda: all(p.get_subscription_count() for p in topics), 10.0)
        self.record()

    def record(self):
        """Note each push with the plan that was published last."""
        peers = self.run.supervisor._peers
        push = peers.push

        def noted(number, segment, *rest):
            self.driven.append((self.plans[-1] if self.plans else None, segment))
            push(number, segment, *rest)

        peers.push = noted

    @property
    def state(self):
        return self.run.observer.state

    def until(self, condition, limit=120.0):
        assert self.run.spin_until(condition, limit), self.state
        return self.state

    def enters(self, name):
        return self.until(lambda: self.state.state_name == name)

    def ends(self):
        self.until(lambda: self.state.job > 0, 5.0)
        self.until(lambda: self.state.state == JobState.IDLE and not self.state.plan_ready)
        return self.state

    def pushing(self, way=0.05):
        self.enters("PUSHING")
        x, y = self.run.observer.trace.object[-1][:2]
        self.until(lambda: np.hypot(*(self.run.observer.trace.object[-1][:2] - (x, y))) > way)

    def at_the_object(self):
        """The robot stands in contact, so that a job begins with backing off."""
        name, robot = self.run.scenario.robot()
        ((_, (x, y, _)),) = self.run.scenario.objects.values()
        pose = np.array([x - robot.push_distance - 0.047, y, 0.0])
        self.run.bridge.world.place(name, pose)
        begun = self.run.bridge.time
        self.until(lambda: self.run.bridge.time > begun + 0.5)

    def by_topic(self, goal):
        message = goal if isinstance(goal, PoseStamped) else pose_stamped_to_ros(goal, 0.0)
        self.topic.publish(message)

    def by_action(self, goal):
        """Its result comes to ``results``."""
        message = goal if isinstance(goal, PoseStamped) else pose_stamped_to_ros(goal, 0.0)
        sent = self.action.send_goal_async(MoveObject.Goal(goal=message))
        self.until(sent.done, 5.0)
        answer = sent.result().get_result_async()
        answer.add_done_callback(lambda f: self.results.append(f.result().result))

    def reached(self, goal, replans=0):
        state = self.ends()
        assert state.error_code == 0 and state.replans == replans, state
        assert final_errors(self.run.observer.trace, goal)[0] < 0.02

    def call(self, kind, name, request):
        client = self.run.observer.create_client(kind, name)
        assert self.run.spinner.until(client.service_is_ready, 5.0)
        done = client.call_async(request)
        assert self.run.spinner.until(done.done, 5.0) and done.result().success


@contextmanager
def runs(scenario):
    with LockstepRun(scenario, quiet=True) as run:
        yield Run(run)


@pytest.fixture
def run():
    with runs(load_scenario("short")) as run:
        yield run


@pytest.mark.long
def test_what_is_driven_is_the_plan_that_was_published_last(run):
    """Random goals one after the other, each from where the last one ended."""
    random = np.random.default_rng(8)
    for _ in range(2):
        goal = np.array([*random.uniform([-0.6, -0.4], [0.6, 0.4]), random.uniform(-1.0, 1.0)])
        run.driven.clear()
        state = run.run.reach(goal)
        assert state.error_code == 0, state.reason
        latest, number = None, 0
        for plan, segment in run.driven:
            number = number + 1 if plan is latest else 0
            latest = plan
            same(segment, plan.segments[number])
        assert number == len(latest.segments) - 1  # none is left out


def same(segment, said):
    assert segment.trajectory.time.tolist() == list(said.trajectory.time)
    assert segment.trajectory.pose.T.tolist() == [
        list(column) for column in (said.trajectory.x, said.trajectory.y, said.trajectory.theta)
    ]


@pytest.mark.long
def test_a_pre_emptive_push_is_part_of_the_plan_that_is_driven():
    """Section 2.5, S2: no direct plan, so a push that leads away comes first, on the topic too."""
    scenario = load_scenario("short")
    _, goal, few = needs_preemptive_push(scenario, START)
    with runs(scenario.settings("planner", **few)) as run:
        run.by_topic(goal)
        run.enters("PUSHING")
        reasons = [reason for _, _, reason, _ in run.run.observer.trace.states]
        assert any("looking for a pre-emptive push" in r for r in reasons)
        assert len(run.plans) == 1 and len(run.plans[0].segments) >= 2
        run.reached(goal)
        assert len(run.driven) == len(run.plans[0].segments)
        for (plan, segment), said in zip(run.driven, run.plans[0].segments, strict=True):
            assert plan is run.plans[0]
            same(segment, said)


@pytest.mark.long
@pytest.mark.parametrize("way", ["cancel", "new supervisor"])
def test_a_robot_at_the_object_loses_no_planning_round(run, way):
    """It backs off before it plans, however it came to stand there."""
    other = run.goal + [0.1, 0.1, 0.2]
    run.by_topic(run.goal)
    run.pushing()
    if way == "cancel":
        run.call(Trigger, "/cancel", Trigger.Request())
        assert run.ends().error_code == JobError.CANCELED
    elif way == "new supervisor":  # FAULTS 11: the one before died and left the robot there
        run.run.spinner.remove(run.run.supervisor)
        run.until(lambda: not run.run.controller.tracker.active, 5.0)
        born = SupervisorNode(run.run.scenario)
        run.run.supervisor = born
        run.run.spinner.add(born)
        run.record()
        run.until(lambda: born.ready and run.state.job == 0, 10.0)
        assert run.run.spinner.until(lambda: run.topic.get_subscription_count() == 1, 10.0)
    before = len(run.run.observer.trace.states)
    run.by_topic(other)
    run.until(lambda: run.state.state_name == "DETACHING", 5.0)
    assert "backing off first" in run.state.reason
    run.reached(other)
    names = [name for _, name, _, _ in run.run.observer.trace.states[before:]]
    assert names.count("PLANNING") == 1


def goals_that_cannot_be(goal):
    bad = {JobError.GOAL_OCCUPIED: [1.49, 0.0, 0.0], JobError.OUTSIDE_MAP: [9.0, 0.0, 0.0]}
    messages = [(code, pose_stamped_to_ros(np.array(pose), 0.0)) for code, pose in bad.items()]
    nan, frame = pose_stamped_to_ros(goal, 0.0), pose_stamped_to_ros(goal, 0.0)
    nan.pose.position.x = float("nan")
    frame.header.frame_id = "moon"
    return [*messages, (JobError.INVALID_GOAL, nan), (JobError.UNKNOWN_FRAME, frame)]


@pytest.mark.long
def test_goals_that_cannot_be_leave_the_job_alone_in_each_of_its_states(run):
    """FAULTS 2 and 22, by topic and by action."""
    run.at_the_object()
    run.by_topic(run.goal)
    refusals = 0
    for name in RUNNING:
        run.enters(name)
        for code, message in goals_that_cannot_be(run.goal):
            for send in (run.by_topic, run.by_action):
                refusals += 1
                send(message)
                run.until(lambda: run.state.refusals == refusals, 5.0)  # noqa: B023
                assert run.state.refusal_code == code and run.state.refusal
    run.reached(run.goal)
    assert run.state.job == 1 and run.state.refusals == refusals and len(run.driven) == 1
    run.until(lambda: len(run.results) == refusals // 2, 5.0)
    codes = [code for code, _ in goals_that_cannot_be(run.goal)] * len(RUNNING)
    assert [r.error_code for r in run.results] == codes
    visited = [name for _, name, _, _ in run.run.observer.trace.states]
    assert visited.count("IDLE") == 2 and len(run.plans) >= 1


@pytest.mark.long
def test_the_goal_that_is_pursued_changes_nothing_in_each_state(run):
    """FAULTS 28, by topic and by action, and as a flood."""
    run.at_the_object()
    run.by_topic(run.goal)
    for name in RUNNING:
        run.enters(name)
        for _ in range(5):
            run.by_topic(run.goal)
        run.by_action(run.goal)
        run.by_action(run.goal)
    run.reached(run.goal)
    assert run.state.job == 1 and len(run.driven) == 1
    run.until(lambda: len(run.results) == 2 * len(RUNNING), 5.0)
    codes = sorted(r.error_code for r in run.results)
    assert codes == [0] + [JobError.PREEMPTED] * (2 * len(RUNNING) - 1)


@pytest.mark.long
def test_of_a_flood_of_goals_the_last_one_wins(run):
    """FAULTS 28: in the middle of a push, forty goals at once, by topic and by action."""
    run.by_topic(run.goal)
    run.pushing()
    random = np.random.default_rng(4)
    for _ in range(20):
        for send in (run.by_topic, run.by_action):
            send(np.array([*random.uniform(-0.5, 0.5, 2), random.uniform(-1.0, 1.0)]))
    last = np.array([0.25, 0.1, 0.2])
    run.by_topic(last)
    run.until(lambda: run.state.goal.pose.position.x == 0.25, 10.0)
    run.reached(last)
    assert all(r.error_code == JobError.PREEMPTED for r in run.results)


WALL = EnvironmentSpec((3.0, 2.0), boxes=(BoxSpec((-0.15, 0.15), (0.06, 0.5)),))


@pytest.mark.long
@pytest.mark.parametrize("name", ["PLANNING", "POSITIONING", "PUSHING"])
def test_a_new_map_is_minded_at_once(run, name):
    """A wall appears across the way; the plan that is driven knows it."""
    run.by_topic(run.goal)
    run.enters(name)
    run.maps.publish(grid_to_ros(rasterise(WALL), 0.0))
    assert run.run.spinner.until(
        lambda: run.run.supervisor.surroundings.grid.equals(rasterise(WALL)), 5.0
    )
    run.reached(run.goal, replans=0 if name == "PLANNING" else 1)
    reasons = [reason for _, _, reason, _ in run.run.observer.trace.states]
    assert any("the map has changed" in r for r in reasons) == (name != "PLANNING")
    wall = np.array([[-0.18, -0.12], [-0.1, 0.4]])
    item = run.run.observer.trace.object
    low, high = wall[:, 0] - 0.045, wall[:, 1] + 0.045
    assert not any((low < p[:2]).all() and (p[:2] < high).all() for p in item)


@pytest.mark.long
def test_a_map_that_covers_the_goal_ends_the_job_with_its_code(run):
    run.by_topic(run.goal)
    run.pushing()
    grid = rasterise(EnvironmentSpec((3.0, 2.0), boxes=(BoxSpec((0.1, 0.04), (0.1, 0.1)),)))
    run.maps.publish(grid_to_ros(grid, 0.0))
    assert run.ends().error_code == JobError.GOAL_OCCUPIED
    run.by_topic(run.goal)
    run.until(lambda: run.state.refusals == 1, 5.0)
    assert run.state.refusal_code == JobError.GOAL_OCCUPIED


@pytest.mark.long
def test_a_world_with_other_bodies_ends_the_job(run):
    """The same scenario again does not; without its object no goal is taken."""
    text = run.run.scenario.text
    run.worlds.publish(String(data=text))
    run.by_topic(run.goal)
    run.pushing()
    run.worlds.publish(String(data=text))
    run.worlds.publish(String(data="[no scenario"))
    refused = run.run.supervisor._diagnostics.refused
    run.until(lambda: refused.get("/scenario", 0) == 1, 5.0)
    assert run.state.state_name == "PUSHING"
    run.worlds.publish(String(data=text.replace("box:", "crate:")))
    state = run.ends()
    assert state.error_code == JobError.UNKNOWN_OBJECT and "without box" in state.reason
    run.by_topic(run.goal)
    run.until(lambda: run.state.refusals == 1, 5.0)
    assert run.state.refusal_code == JobError.UNKNOWN_OBJECT
    run.worlds.publish(String(data=text))
    run.until(lambda: run.run.supervisor._objects._there("box")[1] is not None, 5.0)
    run.by_topic(run.goal)
    run.until(lambda: run.state.job == 2, 5.0)
    run.reached(run.goal)


@pytest.mark.long
def test_a_pause_in_any_state_freezes_the_job(run):
    """FAULTS 24: longer than the patience with anybody."""
    supervisor = run.run.supervisor
    impatient = type(supervisor.settings)(
        node_timeout=0.5, answer_timeout=0.6, controller_timeout=0.3, pose_timeout=0.3
    )
    supervisor._apply(impatient)
    run.at_the_object()
    run.by_topic(run.goal)
    for name in RUNNING:
        run.enters(name)
        run.call(SetBool, "/bridge/pause", SetBool.Request(data=True))
        run.run.spinner.until(lambda: False, 1.2)
        run.call(SetBool, "/bridge/pause", SetBool.Request(data=False))
    run.reached(run.goal)
    assert run.state.job == 1 and len(run.driven) == 1


def crowded(place, **settings):
    """Another object stands at a place."""
    scenario = load_scenario("short").settings("supervisor", **settings)
    spec, _ = scenario.objects["box"]
    objects = dict(scenario.objects) | {"crate": (spec, np.array(place))}
    return replace(scenario, objects=objects)


@pytest.mark.long
def test_a_body_on_the_goal_is_waited_for():
    with runs(crowded([0.1, 0.04, 0.4], wait=1.0)) as run:
        run.by_topic(run.goal)
        run.until(lambda: "make way" in run.state.reason)
        begun = run.run.bridge.time
        run.until(lambda: run.run.bridge.time > begun + 2.5, 5.0)
        assert run.state.state_name == "PLANNING" and not run.driven
        run.run.bridge.world.place("crate", np.array([0.8, 0.7, 0.0]))
        run.reached(run.goal)


def test_a_body_that_stays_on_the_goal_is_given_up_on():
    with runs(crowded([0.1, 0.04, 0.4], wait=0.5, max_waits=2)) as run:
        run.by_topic(run.goal)
        state = run.ends()
        assert state.error_code == JobError.GOAL_OCCUPIED and run.run.bridge.time > 1.0
        assert "overlap" in state.reason


@pytest.mark.parametrize("others", [False, True])
def test_a_blocked_path_is_waited_for_only_where_there_are_other_bodies(others):
    """The object itself does not make way."""
    scenario = crowded([0.8, 0.7, 0.0]) if others else load_scenario("short")
    with runs(scenario) as run:
        told, peers = [], run.run.supervisor._peers
        ask = peers.path
        peers.path = lambda *rest: (told.append(rest[-1]), ask(*rest))
        run.by_topic(run.goal)
        run.until(lambda: told)
        assert told[0] is others


@pytest.mark.long
def test_a_body_in_the_way_is_gone_round():
    """Neither object nor robot touches it."""
    with runs(crowded([-0.15, 0.02, 0.4])) as run:
        run.by_topic(run.goal)
        run.reached(run.goal)
        pose = run.run.bridge.world.poses()["crate"]
        assert pose[:2] == pytest.approx([-0.15, 0.02], abs=1e-3)
        assert pose[2] == pytest.approx(0.4, abs=4e-3)  # on its soft feet it creeps, untouched
        assert run.run.observer.trace.collisions == 0
