"""The motions between pushes, against the geometry they stand for."""

import numpy as np
import pytest

from push_model import CurvatureLimits, PushSegment, line, se2
from push_model.occupancy import rasterise
from push_model.outlines import convex_hull, distance, inside, overlap
from push_model.specs import EnvironmentSpec
from push_supervisor import SupervisorSettings, motions
from tests.outlines import CONCAVE, SLIM, U

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


@pytest.mark.parametrize("early", [0.002, 0.005])
def test_an_object_that_is_nearer_than_it_seems_is_touched_gently(segment, early):
    """v^2 = 2 a d, at a distance d from where the contact was expected."""
    settings, item = SupervisorSettings(), np.array([0.1, 0.3, -0.4])
    contact = segment.contact(item)
    way = motions.approach(segment, motions.standoff(segment, item), item, settings)
    left = np.hypot(*(way.pose[:, :2] - contact[:2]).T)
    speed = np.interp(early, left[::-1], way.twist[::-1, 0])
    assert speed == pytest.approx(np.sqrt(2.0 * settings.contact_braking * early), rel=0.1)
    assert speed < 0.05 and way.duration < 1.3


DISTANCE = SupervisorSettings().detach_distance
NO_WALLS = np.zeros((0, 3))


def retreated(robot, item, walls=NO_WALLS):
    """Way [m] of a retreat from a round object of 5 cm; positive ahead."""

    def gap(pose):
        return max(0.0, float(np.hypot(*(pose - item)[:2])) - 0.1)

    way = motions.retreat(robot, gap, walls, SupervisorSettings())
    moved = se2.between(robot, way.pose[-1])
    assert moved[1:] == pytest.approx([0.0, 0.0]) and not way.twist[:, 1].any()
    assert np.abs(way.twist[:, 0]).max() <= SupervisorSettings().approach_speed + 1e-9
    return float(moved[0])


@pytest.mark.parametrize("bearing", np.linspace(-np.pi, np.pi, 13))
@pytest.mark.parametrize("apart", [0.1, 0.12])
def test_retreat_leads_away_from_the_object_wherever_it_is(bearing, apart):
    robot = np.array([0.3, -0.2, 0.9])
    item = robot + [*(apart * np.array([np.cos(0.9 + bearing), np.sin(0.9 + bearing)])), 0.0]
    behind = abs(bearing) > np.pi / 2 + 0.1
    assert retreated(robot, item) == pytest.approx(DISTANCE if behind else -DISTANCE)


def test_retreat_ends_before_a_wall():
    random = np.random.default_rng(5)
    short = 0
    for _ in range(300):
        robot = np.array([0.0, 0.0, random.uniform(-4, 4)])
        item = se2.compose(robot, np.array([0.1, 0.0, 0.0]))
        walls = np.column_stack([random.uniform(-0.15, 0.15, (4, 2)), np.full(4, 0.045)])
        room = np.hypot(*(walls[:, :2] - robot[:2]).T) - walls[:, 2]
        way = retreated(robot, item, walls)
        assert -DISTANCE - 1e-9 <= way <= -1e-3 + 1e-9
        short += way > -0.5 * DISTANCE
        if way < -2e-3:  # there was room: a wall is never entered, or entered any further
            after = se2.compose(robot, np.array([way, 0.0, 0.0]))
            left = np.hypot(*(walls[:, :2] - after[:2]).T) - walls[:, 2]
            assert left.min() >= min(0.0, room.min()) - 1e-9
    assert 30 < short < 270


def test_circles_are_as_wide_as_the_ends_of_a_motion_allow(segment):
    """Walls are kept on the approach; one beside its end as far as the end is from it."""
    way = segment.trajectory
    ends = way.pose[[0, -1], :2]
    circles = np.array(
        [[*(ends[1] + [0.03, 0.0]), 0.05], [*(ends[0] - [0.0, 0.02]), 0.05], [9.0, 9.0, 0.05]]
    )
    assert motions.spared(circles, way)[:, 2] == pytest.approx([0.03, 0.02, 0.05])
    assert circles[:, 2] == pytest.approx(0.05)


@pytest.mark.parametrize("resolution", [0.01, 0.02, 0.05, 0.1])
@pytest.mark.parametrize("radius", [0.037, 0.25])
def test_wall_circles_leave_no_gap_a_robot_could_slip_through(resolution, radius):
    """Whatever the map's cells and the robot: on the walls' faces there is no room at all, and at
    the wanted distance from them nothing is lost by half a cell."""
    grid = rasterise(EnvironmentSpec((2.0, 1.6), resolution=resolution))
    circles = motions.wall_circles(grid, radius, 0.008)
    x = np.linspace(-1.0, 1.0, 500)
    for sign in (-1.0, 1.0):
        face = sign * 0.8
        gap = np.hypot(circles[:, None, 0] - x, circles[:, None, 1] - face) - circles[:, 2:]
        assert gap.min(axis=0).max() < 0.0
        clear = face - sign * (radius + 0.008 + 1e-9)
        inner = np.abs(x) < 1.0 - radius - 0.05
        gap = np.hypot(circles[:, None, 0] - x[inner], circles[:, None, 1] - clear)
        assert (gap - circles[:, 2:]).min() > -1e-6


@pytest.mark.parametrize("shape", [*CONCAVE, SLIM])
@pytest.mark.parametrize("radius", [0.02, 0.06, 0.25])
def test_circles_of_an_outline_keep_a_disc_off_it_and_ask_for_little_more(shape, radius):
    outline = np.array(shape)
    circles = motions.outline_circles(outline, radius)
    points = np.random.default_rng(0).uniform(-0.5, 0.7, (4000, 2))
    points = points[~inside(outline, points)]
    room = (
        np.hypot(points[:, None, 0] - circles[:, 0], points[:, None, 1] - circles[:, 1])
        - circles[:, 2]
    )
    free = room.min(axis=1) >= 0.0
    away = distance(outline, points)
    assert away[free].min() >= radius - 1e-9
    assert away[~free].max() <= radius + 5e-3 + 1e-9
    assert 100 < free.sum() < len(points) - 30


def test_out_of_a_recess_a_robot_backs_until_it_is_clear_of_the_hull(robot):
    outline = np.array(U)
    hull = convex_hull(outline)
    inner = np.array([0.12, 0.05 + robot.push_distance, -np.pi / 2])  # bumper on the floor of the U
    depth = motions.recess(inner, robot.outline, hull, 1.0)
    assert depth == pytest.approx(0.14 - 0.05, abs=2e-3)
    clear = se2.compose(inner, np.array([-depth, 0.0, 0.0]))
    assert not overlap(se2.transform(clear, robot.outline), hull)
    beside = np.array([0.12, -robot.push_distance - 1e-6, np.pi / 2])
    assert motions.recess(beside, robot.outline, hull, 1.0) == 0.0


def test_near_keeps_what_the_motion_can_come_close_to(segment):
    on_the_way = se2.compose(START, np.array([0.2, 0.3, 0.0]))[:2]
    circles = np.array([[*on_the_way, 0.04], [5.0, 5.0, 0.04]])
    assert motions.near(circles, segment.trajectory, 0.4).tolist() == circles[:1].tolist()
    assert motions.near(circles, segment.trajectory, 0.1).shape == (0, 3)
    assert motions.near(np.zeros((0, 3)), segment.trajectory, 0.4).shape == (0, 3)


def test_displacement_is_measured_from_the_planned_start(segment):
    item = se2.compose(START, np.array([0.03, -0.04, 0.2]))
    assert motions.displacement(segment, item) == pytest.approx((0.05, 0.2))
