"""The controller node among other bodies, driven by a pose stream that integrates its commands."""

import math

import numpy as np
import pytest
import rclpy
import yaml
from geometry_msgs.msg import TwistStamped
from rclpy.action import ActionClient

from push_model import line, unicycle_step
from push_mpc.node import ControllerNode
from push_msgs.action import FollowTrajectory
from push_msgs.msg import Poses, Report
from push_ros.conversions import poses_to_ros, time_from_ros, trajectory_to_ros
from push_ros.process import Spinner
from push_ros.qos import COMMAND, STATUS, STREAM
from push_scenario.scenario import scenario_from_mapping

WORLD = yaml.safe_load("""
environment: {size: [3.0, 2.0]}
robots:
  me: {type: epuck, start: [-1.0, 0.0, 0.0]}
  other: {type: epuck, start: [1.0, 0.5, 0.0]}
objects:
  box: {type: box9, start: [1.0, -0.5, 0.0]}
""")


class Course:
    """Unicycles move as commanded; everything else stands where it is put."""

    def __init__(self):
        self.scenario = scenario_from_mapping(WORLD, "course", "course")
        self.controller = ControllerNode(self.scenario, "me")
        self.node = rclpy.create_node("course")
        self.poses = {
            "me": np.array([-1.0, 0.0, 0.0]),
            "other": np.array([1.0, 0.5, 0.0]),
            "box": np.array([1.0, -0.5, 0.0]),
        }
        self.tick, self.answer = 100, None
        self.publisher = self.node.create_publisher(Poses, "/poses", STREAM)
        self.node.create_subscription(TwistStamped, "/me/cmd_vel", self.on_command, COMMAND)
        self.client = ActionClient(self.node, FollowTrajectory, "/me/follow_trajectory")
        self.spinner = Spinner([self.controller, self.node])
        ready = lambda: (  # noqa: E731
            self.client.server_is_ready() and self.publisher.get_subscription_count() > 0
        )
        assert self.spinner.until(ready, 15.0)

    def on_command(self, message):
        self.answer = message

    def step(self):
        self.tick += 1
        self.publisher.publish(poses_to_ros(self.poses, self.tick / 100))
        answered = lambda: (  # noqa: E731
            self.answer is not None
            and round(100 * time_from_ros(self.answer.header.stamp)) == self.tick
        )
        assert self.spinner.until(answered, 15.0)
        twist = self.answer.twist
        self.poses["me"] = unicycle_step(self.poses["me"], twist.linear.x, twist.angular.z, 0.01)

    def refused(self):
        """A further frame with the stamp of the last one; the speed [m/s] that answers it."""
        self.answer = None
        self.publisher.publish(poses_to_ros(self.poses, self.tick / 100))
        assert self.spinner.until(lambda: self.answer is not None, 15.0)
        return self.answer.twist.linear.x

    def gap(self, name):
        return float(np.hypot(*(self.poses["me"] - self.poses[name])[:2]))

    def follow(self, **fields):
        way = trajectory_to_ros(line(self.poses["me"], 1.0, 0.1, 0.2))
        sent = self.client.send_goal_async(FollowTrajectory.Goal(trajectory=way, **fields))
        assert self.spinner.until(sent.done, 15.0) and sent.result().accepted
        return sent.result().get_result_async()


@pytest.fixture
def course(ros):
    course = Course()
    yield course
    course.spinner.close()


@pytest.mark.parametrize("name", ["other", "box"])
def test_it_goes_round_or_waits_but_touches_no_other_body(course, name):
    course.step()
    result = course.follow()
    spec, _ = course.scenario.robots["me"]
    reach = spec.body_radius + course.scenario.radii[name]
    least = math.inf
    for tick in range(2400):
        if tick == 200:  # it walks into the way
            course.poses[name] = np.array([course.poses["me"][0] + 0.3, 0.01, 0.0])
        course.step()
        least = min(least, course.gap(name))
        if result.done():
            break
    assert result.done()
    assert least > reach - 0.003, (least, reach)
    assert least < 0.25, "the body was never in the way"


def test_the_object_that_is_named_may_be_touched(course):
    """A retreat or an approach begins or ends at it."""
    course.poses["box"] = np.array([-0.95, 0.0, 0.0])
    course.step()
    result = course.follow(object="box")
    for _ in range(1500):
        course.step()
        if result.done():
            break
    assert result.result().result.error_code == FollowTrajectory.Result.NONE


def test_an_unknown_object_is_refused(course):
    way = trajectory_to_ros(line(course.poses["me"], 1.0, 0.1, 0.2))
    goal = FollowTrajectory.Goal(trajectory=way, object="moon")
    sent = course.client.send_goal_async(goal)
    assert course.spinner.until(sent.done, 15.0)
    assert not sent.result().accepted


def test_it_reports_again_after_the_clock_went_back(course):
    """A reset of the world, and the next trajectory: its reports come from its first tick on."""
    reports = []
    course.node.create_subscription(Report, "/me/report", reports.append, STATUS)
    counts = []
    for _ in range(2):
        course.step()
        course.follow()
        reports.clear()
        for _ in range(40):
            course.step()
        assert course.spinner.until(lambda: bool(reports), 5.0)
        counts.append(len(reports))
        course.tick = 5  # the world was reset
        course.poses["me"] = np.array([-1.0, 0.0, 0.0])
        for _ in range(3):
            course.step()
    assert counts[1] >= counts[0] - 2, counts


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"mode": FollowTrajectory.Goal.PUSH, "object": "box"},
    ],
)
def test_without_a_push_there_is_none_to_go_on_with(course, fields):
    """Neither for a robot that stands nor for one that drives alone, which goes on."""
    course.step()
    for moving in (False, True):
        if moving:
            course.follow()
            for _ in range(50):
                course.step()
        way = trajectory_to_ros(line(course.poses["me"], 1.0, 0.1, 0.2))
        goal = FollowTrajectory.Goal(
            trajectory=way, going_on=True, curvature_min=-2.0, curvature_max=2.0, **fields
        )
        sent = course.client.send_goal_async(goal)
        assert course.spinner.until(sent.done, 15.0) and not sent.result().accepted
        for _ in range(10):
            course.step()
        assert course.controller.tracker.active is moving
        assert (course.answer.twist.linear.x > 0.05) is moving


@pytest.mark.parametrize("count", [1, 10])
def test_after_refused_frames_it_accelerates_from_a_stand(course, count):
    course.step()
    course.follow()
    for _ in range(100):
        course.step()
    assert course.answer.twist.linear.x > 0.09
    assert {course.refused() for _ in range(count)} == {0.0}
    course.step()
    assert 0.0 <= course.answer.twist.linear.x <= 0.5 * 0.01 + 1e-6  # [m/s^2], [s]
    for _ in range(100):
        course.step()
    assert course.answer.twist.linear.x > 0.09
