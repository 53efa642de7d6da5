"""The motions between pushes, against the geometry they stand for."""

import numpy as np
import pytest

from push_model import CurvatureLimits, PushSegment, line, se2
from push_model.occupancy import rasterise
from push_model.specs import EnvironmentSpec
from push_supervisor import SupervisorSettings, motions

START = np.array([0.4, -0.2, 0.7])


@pytest.fixture
def segment():
    """The robot 9.5 cm behind the object, on the side it pushes along its x axis."""
    robot = se2.compose(START, np.array([-0.095, 0.0, 0.0]))
    way = line(robot, 0.5, 0.07, 0.1)
    end = se2.compose(START, np.array([0.5, 0.0, 0.0]))
    limits = CurvatureLimits(-2.0, 2.0)
    last = way.pose[-1]
    wait = se2.compose(robot, np.array([-0.06, 0.0, 0.0]))
    return PushSegment(0, START, end, robot, last, wait, 0.5, 0.5, 0.5, limits, 0.1, way)


def test_contact_follows_the_object(segment):
    assert segment.grasp == pytest.approx([0.095, 0.0, 0.0])
    moved = np.array([-1.0, 2.0, -2.0])
    assert se2.between(segment.contact(moved), moved) == pytest.approx(segment.grasp)


def test_standoff_lies_behind_the_contact(segment):
    item = np.array([0.1, 0.3, -0.4])
    wait = motions.standoff(segment, item)
    assert se2.between(wait, segment.contact(item)) == pytest.approx([0.06, 0.0, 0.0])


def test_approach_ends_in_contact_and_comes_along_the_normal(segment):
    """Also when the robot stands a little aside: the controller has the way to make up for it."""
    item = np.array([0.1, 0.3, -0.4])
    robot = se2.compose(segment.contact(item), np.array([-0.06, 0.01, 0.1]))
    way = motions.approach(segment, robot, item, SupervisorSettings())
    assert way.pose[-1] == pytest.approx(segment.contact(item))
    begin = se2.between(robot, way.pose[0])
    assert abs(begin[0]) < 0.002 and begin[1] == pytest.approx(-0.01, abs=0.002)
    assert way.twist[:, 0].max() <= SupervisorSettings().approach_speed + 1e-9


def test_retreat_goes_straight_back(segment):
    way = motions.retreat(segment.robot_end, SupervisorSettings())
    back = se2.between(segment.robot_end, way.pose[-1])
    assert back == pytest.approx([-SupervisorSettings().detach_distance, 0.0, 0.0])
    assert (way.twist[:, 0] <= 0.0).all() and not way.twist[:, 1].any()


def test_wall_circles_leave_no_gap_a_robot_could_slip_through():
    grid = rasterise(EnvironmentSpec((1.0, 0.8)))
    circles = motions.wall_circles(grid, 0.035, 0.008)
    x = np.linspace(-0.5, 0.5, 500)
    for y in (-0.4, 0.4):
        gap = np.hypot(circles[:, None, 0] - x, circles[:, None, 1] - y) - circles[:, 2:]
        assert gap.min(axis=0).max() < 0.0


def test_near_keeps_what_the_motion_can_come_close_to(segment):
    on_the_way = se2.compose(START, np.array([0.2, 0.3, 0.0]))[:2]
    circles = np.array([[*on_the_way, 0.04], [5.0, 5.0, 0.04]])
    assert motions.near(circles, segment.trajectory).tolist() == circles[:1].tolist()
    assert motions.near(np.zeros((0, 3)), segment.trajectory).shape == (0, 3)


def test_displacement_is_measured_from_the_planned_start(segment):
    item = se2.compose(START, np.array([0.03, -0.04, 0.2]))
    assert motions.displacement(segment, item) == pytest.approx((0.05, 0.2))
