"""Curves through the corners of a way: kinematics, limits, and what the check refuses."""

import math
from dataclasses import replace

import numpy as np
import pytest

from push_model.kinematics import DifferentialDrive
from push_planner import PlannerSettings
from push_planner.robot_drive import fastest_drive

DRIVE = DifferentialDrive(0.0205, 0.0265, 6.28)
SETTINGS = PlannerSettings()


def free(points, margin):
    return True


def narrow(points, margin):
    return False


def driven(corners, start, goal, keeps=free, **changes):
    settings = replace(SETTINGS, **changes)
    return fastest_drive(np.array(corners), np.array(start), np.array(goal), keeps, DRIVE, settings)


def checked(way, start, goal):
    """What holds for every motion: ends, limits, no sideways motion, twists that fit the poses."""
    assert way.pose[0] == pytest.approx(start, abs=1e-9)
    turned = np.exp(1j * (way.pose[-1, 2] - goal[2]))
    assert way.pose[-1, :2] == pytest.approx(goal[:2], abs=1e-9) and turned == pytest.approx(1.0)
    assert not way.twist[[0, -1]].any()
    v, omega = way.twist.T
    fastest = (1.0 - SETTINGS.wheel_reserve) * DRIVE.max_speed
    assert (np.abs(v) + DRIVE.half_track * np.abs(omega)).max() <= fastest + 1e-9
    dt, step = np.diff(way.time), np.diff(way.pose, axis=0)
    middle = 0.5 * (way.pose[1:, 2] + way.pose[:-1, 2])
    ahead = step[:, 0] * np.cos(middle) + step[:, 1] * np.sin(middle)
    aside = -step[:, 0] * np.sin(middle) + step[:, 1] * np.cos(middle)
    assert np.abs(aside).max() < 2e-4
    assert ahead == pytest.approx(0.5 * (v[1:] + v[:-1]) * dt, abs=1.5e-3)
    assert np.abs(np.diff(way.pose[:, 2])).max() < 0.4, "no jump of the heading"
    return way


@pytest.mark.long
def test_random_ways_are_driven_within_all_limits_and_never_slower_than_with_stops():
    random = np.random.default_rng(3)
    faster = 0
    for _ in range(150):
        corners = np.cumsum(random.uniform(-0.3, 0.3, (random.integers(2, 6), 2)), axis=0)
        headings = random.uniform(-np.pi, np.pi, 2)
        start, goal = [*corners[0], headings[0]], [*corners[-1], headings[1]]
        way = checked(driven(corners, start, goal), start, goal)
        stops = checked(driven(corners, start, goal, narrow), start, goal)
        assert way.duration <= stops.duration + 1e-9
        # A robot that turns less briskly than is the default gains more.
        slow, slow_stops = (
            driven(corners, start, goal, keeps, turn_acceleration=7.0) for keeps in (free, narrow)
        )
        faster += slow.duration < 0.9 * slow_stops.duration
    assert faster > 75


def test_wheels_of_a_wide_robot_speed_up_no_more_in_a_turn_than_on_a_line():
    wide = DifferentialDrive(0.0975, 0.165, 6.28)
    random = np.random.default_rng(4)
    for _ in range(50):
        start, goal = [0.0, 0.0, 0.0], [0.0, 0.0, random.uniform(0.2, 3.1)]
        corners = np.array([start[:2], goal[:2]])
        way = fastest_drive(corners, np.array(start), np.array(goal), free, wide, SETTINGS)
        rise = np.abs(np.diff(way.twist[:, 1]) / np.diff(way.time)).max()
        assert rise * wide.half_track <= SETTINGS.move_acceleration + 1e-6


def test_a_corner_is_rounded_on_its_outer_side_without_a_stop():
    """A bend to the left: the inner side is where the obstacle is."""
    corners = np.array([[0.0, 0.0], [0.3, 0.0], [0.3 + 0.3 * math.cos(0.8), 0.3 * math.sin(0.8)]])
    start, goal = [0.0, 0.0, 0.0], [*corners[-1], 0.8]
    way = checked(driven(corners, start, goal), start, goal)
    assert (np.abs(way.twist[1:-1, 0]) > 1e-3).all(), "it stops nowhere"
    for a, b in zip(corners, corners[1:], strict=False):
        normal = np.array([a[1] - b[1], b[0] - a[0]]) / np.hypot(*(b - a))
        inner = (way.pose[:, :2] - a) @ normal
        assert inner.max() < 1e-9 or (inner[inner > 0.0].max() > 0.05)
    beside = np.hypot(*(way.pose[:, :2] - corners[1]).T).min()
    assert beside < 5e-3, "it passes through the corner"


def test_what_does_not_keep_its_distance_is_driven_straight_with_turns_in_place():
    corners, start, goal = [[0, 0], [0.3, 0], [0.3, 0.3]], [0.0, 0.0, 1.0], [0.3, 0.3, 2.0]
    way = checked(driven(corners, start, goal, narrow), start, goal)
    x, y = way.pose[:, :2].T
    assert (np.minimum(np.abs(y), np.abs(x - 0.3)) < 1e-9).all()

    def left_part(points, margin):
        assert 0.0 <= margin < 1e-3
        return bool(points[:, 0].max() < 0.45)

    corners = [[0, 0], [0.2, 0.0], [0.4, 0.1], [0.6, 0.1]]
    start, goal = [0.0, 0.0, 0.0], [0.6, 0.1, 0.0]
    way = checked(driven(corners, start, goal, left_part), start, goal)
    right = way.pose[way.pose[:, 0] > 0.4 + 1e-6]
    assert np.abs(right[:, 1] - 0.1).max() < 1e-9, "straight where a curve is refused"
    assert np.abs(way.pose[way.pose[:, 0] < 0.2, 1]).max() > 1e-3, "a curve elsewhere"


def test_it_drives_astern_where_that_saves_turns():
    way = checked(driven([[0, 0], [-0.4, 0]], [0, 0, 0.0], [-0.4, 0, 0.0]), [0, 0, 0], [-0.4, 0, 0])
    fastest = (1.0 - SETTINGS.wheel_reserve) * DRIVE.max_speed
    assert way.twist[:, 0].min() == pytest.approx(-fastest, rel=0.01)
    assert np.abs(way.twist[:, 1]).max() < 1e-9


@pytest.mark.parametrize("gap", [0.0, 1e-3])
def test_a_way_of_no_length_is_a_turn(gap):
    way = driven([[0, 0], [gap, 0]], [0, 0, 0.0], [gap, 0, 1.0])
    assert way.pose[-1, 2] == pytest.approx(1.0) and not way.twist[:, 0].any()
    still = driven([[0, 0], [gap, 0]], [0, 0, 1.0], [gap, 0, 1.0])
    assert still.duration < 0.1
