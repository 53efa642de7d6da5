"""Bags against each other: what differs first, and what is not compared."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from push_msgs.msg import ControllerStatus, JobState, PushPlan
from push_record.bag import BagWriter
from push_record.compare import changed_settings, compare_bags
from push_record.contents import BagContents
from push_record.parting import partings
from push_record.run_of_bag import CannotRerun, run_of_bag
from push_ros.conversions import pose_stamped_to_ros, poses_to_ros, time_to_ros

KINDS = {
    "/clock": "rosgraph_msgs/msg/Clock",
    "/poses": "push_msgs/msg/Poses",
    "/epuck1/controller/status": "push_msgs/msg/ControllerStatus",
    "/push_plan": "push_msgs/msg/PushPlan",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "/scenario": "std_msgs/msg/String",
    "/job_state": "push_msgs/msg/JobState",
    "/goal_pose": "geometry_msgs/msg/PoseStamped",
}


def write(folder, ticks=20, change=lambda topic, k, message: message, metadata=None, text="a: 1"):
    """A bag of some ticks; ``change`` alters a message, or leaves it out by None."""
    writer = BagWriter(folder, metadata or {})
    for topic, kind in KINDS.items():
        writer.add_topic(topic, kind, False)

    def put(topic, k, message):
        message = change(topic, k, message)
        if message is not None:
            writer.write(topic, max(0, k) * 10**7, bytes(serialize_message(message)))

    put("/scenario", -1, String(data=text))
    for k in range(1, ticks + 1):
        seconds = 0.01 * k
        put("/clock", k, Clock(clock=time_to_ros(seconds)))
        put("/poses", k, poses_to_ros({"box": np.array([seconds, 0.5, 0.0])}, seconds))
        status = ControllerStatus(robot="epuck1", v=0.07, obstacle_margin=float("nan"))
        put("/epuck1/controller/status", k, status)
        if k == 5:
            put("/push_plan", k, PushPlan(object="box", cost=1.5))
            put("/diagnostics", k, DiagnosticArray())
    writer.close()
    return folder


def test_equal_bags_are_equal_and_costs_are_not_compared(tmp_path):
    def measured(topic, k, message):
        if topic.endswith("status"):
            message.solve_time = 1e-4 * k
        if topic == "/push_plan":
            message.statistics.plan_time, message.header.stamp.sec = 0.7, 1700000000
        return None if topic == "/diagnostics" else message

    found = compare_bags(write(tmp_path / "a"), write(tmp_path / "b", change=measured))
    assert found.equal and found.first is None and found.messages == 3 * 20 + 2
    assert set(found.topics) == set(KINDS) - {"/diagnostics", "/job_state", "/goal_pose"}


def test_the_first_difference_is_named_to_the_field(tmp_path):
    def altered(topic, k, message):
        if topic == "/poses" and k >= 12:
            message.y[0] = np.nextafter(0.5, 1.0)
        if topic == "/epuck1/controller/status" and k == 12:
            message.v = 0.08
        return message

    found = compare_bags(write(tmp_path / "a"), write(tmp_path / "b", change=altered))
    first = found.first
    assert not found.equal
    assert (first.topic, first.index, first.field) == ("/poses", 11, "y[0]")
    assert first.time == pytest.approx(0.12)
    assert (first.first, first.second) == ("0.5", "0.5000000000000001")
    assert found.topics["/poses"].unequal == 9
    assert found.topics["/epuck1/controller/status"].unequal == 1 and found.topics["/clock"].equal


@pytest.mark.parametrize("side", [0, 1])
def test_a_message_that_only_one_bag_has_is_a_difference(tmp_path, side):
    def without(topic, k, message):
        return None if topic == "/epuck1/controller/status" and k == 20 else message

    bags = [write(tmp_path / "a"), write(tmp_path / "b", change=without)]
    found = compare_bags(*(bags if side == 0 else reversed(bags)))
    count = found.topics["/epuck1/controller/status"]
    if side == 0:
        assert (count.only_first, found.first.topic) == (1, "/epuck1/controller/status")
    else:  # it is at the log time at which the recording of the first ended
        assert found.equal and found.beyond == 1


def test_what_the_second_bag_has_after_the_end_of_the_first_does_not_count(tmp_path):
    found = compare_bags(write(tmp_path / "a", 20), write(tmp_path / "b", 25))
    assert found.equal and found.beyond == 15
    assert not compare_bags(write(tmp_path / "c", 25), write(tmp_path / "d", 20)).equal


def test_scenarios_are_compared_by_their_values(tmp_path):
    first = "parameters:\n  planner: {push_speed: 0.07, list: [1, 2]}\n"
    second = "parameters:\n  planner: {push_speed: 0.06, list: [1, 2]}\n  new: 1\n"
    expected = [
        "parameters.planner.push_speed: 0.07 in the first bag, 0.06 in the second",
        "parameters.new: nothing in the first bag, 1 in the second",
    ]
    assert changed_settings(first, second) == expected
    bags = write(tmp_path / "a", text=first), write(tmp_path / "b", text=second)
    found = compare_bags(*bags)
    assert found.settings == expected and not found.equal and found.first is None


def test_a_bag_that_lacks_something_says_what(tmp_path, scenario):
    with pytest.raises(CannotRerun, match="no scenario"):
        run_of_bag(write(tmp_path / "a"))
    about = {"scenario": scenario.text, "scenario_name": "x"}
    with pytest.raises(CannotRerun, match="system"):
        run_of_bag(write(tmp_path / "b", metadata=about, text=scenario.text))
    with pytest.raises(CannotRerun, match="clock"):
        run_of_bag(write(tmp_path / "c", ticks=0, metadata=about))


class Jobs:
    """Writes a bag with goals and states of jobs."""

    def __init__(self, path, scenario):
        about = {"scenario": scenario.text, "scenario_name": "x", "pace": "live"}
        self.writer = BagWriter(path, about)
        for topic, kind in KINDS.items():
            self.writer.add_topic(topic, kind, False)

    def put(self, topic, moment, message):
        self.writer.write(topic, round(1e9 * moment), bytes(serialize_message(message)))

    def state(self, moment, job, number, goal=None):
        message = JobState(system="single", state=number, job=job, object="box")
        message.header.stamp = time_to_ros(moment)
        if goal is not None:
            message.goal = pose_stamped_to_ros(goal, 0.0)
        self.put("/job_state", moment + 0.01, message)


def test_a_task_without_a_goal_cannot_be_repeated(tmp_path, scenario):
    bag = Jobs(tmp_path / "b", scenario)
    bag.put("/clock", 0.01, Clock(clock=time_to_ros(0.01)))
    bag.state(0.5, 1, JobState.PLANNING, np.array([1.0, 0.5, 0.0]))
    bag.state(5.0, 1, JobState.IDLE, np.array([1.0, 0.5, 0.0]))
    bag.state(7.0, 2, JobState.PUSHING)
    bag.writer.close()
    with pytest.raises(CannotRerun, match="push_along, swarm_move"):
        run_of_bag(tmp_path / "b")


def test_goals_are_found_with_the_stamps_of_their_jobs(tmp_path, scenario):
    """A goal of a message has the time of its job; one that came by an action is found there."""
    goals = np.array([1.0, 0.5, 0.0]), np.array([0.5, 0.25, 1.0])
    bag = Jobs(tmp_path / "b", scenario)
    put, state = bag.put, bag.state
    put("/clock", 0.01, Clock(clock=time_to_ros(0.01)))
    put("/goal_pose", 1.0, pose_stamped_to_ros(goals[0], 0.0))
    state(0.98, 1, JobState.PLANNING, goals[0])
    state(5.0, 1, JobState.IDLE, goals[0])
    state(7.0, 2, JobState.PLANNING, goals[1])
    put("/clock", 9.0, Clock(clock=time_to_ros(9.0)))
    bag.writer.close()
    run = run_of_bag(tmp_path / "b")
    assert run.system == "single" and not run.repeatable and run.end == pytest.approx(9.0)
    first, second = run.inputs
    assert isinstance(first.data, bytes) and first.time == pytest.approx(0.98)
    assert second.data == pytest.approx((0.5, 0.25, 1.0)) and second.time == pytest.approx(7.0)
    assert (first.after_job, second.after_job) == (False, True)


def test_how_far_two_runs_part(scenario):
    """One goes the same way half a second later, and ends 3 mm beside it."""
    times = 0.02 * np.arange(500)
    contents = []
    for late, off in ((0.0, 0.0), (0.5, 0.003)):
        x = 0.1 * np.clip(times - late, 0.0, 8.0)
        box = np.column_stack([x, np.full(500, off), np.zeros(500)])
        made = BagContents(scenario, {}, None, times, {"box": box})
        contents.append(made)
    (parting,) = partings(*contents)
    away, when = parting.largest
    assert away == pytest.approx(np.hypot(0.05, 0.003)) and 0.4 < when < 8.1
    assert parting.beyond(0.005) == pytest.approx(0.06)
    assert parting.beyond(0.1) is None
    assert parting.last == pytest.approx(0.003) and parting.path == pytest.approx(0.003)
