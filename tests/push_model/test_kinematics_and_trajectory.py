import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from push_model import (
    DifferentialDrive,
    along_curve,
    concatenate,
    line,
    rotation,
    unicycle_step,
)
from push_scenario.bodies import load_robot

DRIVE = DifferentialDrive(0.0205, 0.0265, 6.28)


@given(st.floats(-1, 1), st.floats(-20, 20))
def test_saturation_keeps_curvature_and_respects_the_wheels(v, omega):
    sv, so = DRIVE.saturate(v, omega)
    assert max(abs(w) for w in DRIVE.wheel_speeds(sv, so)) <= 6.28 * (1 + 1e-12)
    assert sv * omega == pytest.approx(so * v, abs=1e-9)
    assert DRIVE.twist(*DRIVE.wheel_speeds(v, omega)) == pytest.approx((v, omega), abs=1e-9)


@given(st.floats(-1, 1), st.floats(-3, 3), st.floats(0.001, 2))
def test_unicycle_step_is_the_integral(v, omega, dt):
    state = np.zeros(3)
    n = 400
    for _ in range(n):  # mid-point rule
        middle = state[2] + 0.5 * omega * dt / n
        state = state + dt / n * np.array([v * math.cos(middle), v * math.sin(middle), omega])
    exact = unicycle_step(np.zeros(3), v, omega, dt)
    assert exact[:2] == pytest.approx(state[:2], abs=1e-4)


def test_linearisation_moves_points_as_asked_or_slower_in_the_same_direction():
    random = np.random.default_rng(3)
    drive, lead = DifferentialDrive(0.0205, 0.0265, 6.28), 0.025
    velocities, headings = random.normal(0.0, 0.06, (500, 2)), random.uniform(-4.0, 4.0, 500)
    twists = drive.follow(velocities, headings, lead)
    slower = 0
    for (v, omega), velocity, heading in zip(twists, velocities, headings, strict=True):
        c, s = math.cos(heading), math.sin(heading)
        moved = np.array([v * c - lead * omega * s, v * s + lead * omega * c])
        share = float(moved @ velocity / (velocity @ velocity))
        assert moved == pytest.approx(share * velocity, abs=1e-9) and 0.0 < share <= 1.0 + 1e-9
        assert np.abs(drive.wheel_speeds(v, omega)).max() <= drive.max_wheel_speed + 1e-9
        slower += share < 1.0 - 1e-9
    assert 20 < slower < 480
    with pytest.raises(ValueError, match="lead"):
        drive.follow(velocities, headings, 0.0)


@pytest.mark.parametrize("distance", [0.5, -0.3, 0.001])
def test_line_ends_at_rest_where_it_should(distance):
    t = line(np.array([1.0, 2.0, 0.5]), distance, 0.1, 0.2)
    end = [1.0 + distance * math.cos(0.5), 2.0 + distance * math.sin(0.5), 0.5]
    assert t.pose[-1] == pytest.approx(end)
    assert t.twist[0] == pytest.approx([0, 0]) and t.twist[-1] == pytest.approx([0, 0])
    assert np.abs(t.twist[:, 0]).max() <= 0.1 + 1e-12
    way = np.trapezoid(t.twist[:, 0], t.time)
    assert way == pytest.approx(distance, rel=0.02, abs=1e-4)


def test_curve_respects_wheels_and_acceleration():
    angle = np.linspace(0, math.pi / 2, 200)
    points = 0.2 * np.column_stack([np.sin(angle), 1 - np.cos(angle)])
    t = along_curve(points, angle, np.full(200, 5.0), DRIVE, 0.12, 0.1)
    wheel = np.abs(t.twist[:, 0]) + 0.0265 * np.abs(t.twist[:, 1])
    assert wheel.max() <= DRIVE.max_speed + 1e-9
    assert np.abs(np.diff(t.twist[:, 0]) / np.diff(t.time)).max() <= 0.1 * 1.2
    assert t.twist[-1] == pytest.approx([0, 0])


def test_a_line_that_brakes_gently_takes_the_time_of_its_two_ramps():
    """0.06 m, no cruise: peak^2 (1/a + 1/b) / 2 = 0.06 m, duration peak (1/a + 1/b)."""
    t = line(np.zeros(3), 0.06, 1.0, 0.3, braking=0.1)
    peak = math.sqrt(2.0 * 0.06 / (1.0 / 0.3 + 1.0 / 0.1))
    assert t.duration == pytest.approx(peak * (1.0 / 0.3 + 1.0 / 0.1))
    assert t.twist[:, 0].max() == pytest.approx(peak, rel=0.05)
    before = t.sample(np.array([t.duration - 0.2]))[1][0, 0]
    assert before == pytest.approx(0.02, rel=0.05), "0.2 s before the end, at 0.1 m/s^2"
    assert t.pose[-1, 0] == pytest.approx(0.06) and t.pose[:, 0].max() <= 0.06 + 1e-9
    way = np.trapezoid(t.twist[:, 0], t.time)
    assert way == pytest.approx(0.06, rel=0.02)


@pytest.mark.parametrize("kappa", [5.0, -5.0, 1e-3])
def test_a_reserve_of_the_wheels_is_left_in_bends(kappa):
    angle = np.linspace(0, kappa, 400)  # 1 m
    points = np.column_stack([np.sin(angle), 1 - np.cos(angle)]) / kappa
    t = along_curve(points, angle, np.full(400, kappa), DRIVE, 1.0, 1.0, reserve=0.1)
    fastest = 0.9 * DRIVE.max_speed / (1.0 + abs(kappa) * DRIVE.half_track)
    assert t.twist[:, 0].max() == pytest.approx(fastest)
    wheel = np.abs(t.twist[:, 0]) + DRIVE.half_track * np.abs(t.twist[:, 1])
    assert wheel.max() == pytest.approx(0.9 * DRIVE.max_speed)


def test_a_change_of_speed_on_a_bend_turns_no_faster_than_it_may():
    angle = np.linspace(0, 2.0, 400)
    points = 0.02 * np.column_stack([np.sin(angle), 1 - np.cos(angle)])
    tight = along_curve(points, angle, np.full(400, 50.0), DRIVE, 0.1, 0.3, turn_acceleration=5.0)
    rate = np.diff(tight.twist[:, 1]) / np.diff(tight.time)
    assert np.abs(rate).max() == pytest.approx(5.0, rel=0.1)
    freely = along_curve(points, angle, np.full(400, 50.0), DRIVE, 0.1, 0.3)
    assert freely.duration < tight.duration


def test_concatenated_heading_is_continuous():
    a = rotation(np.array([0, 0, 3.0]), 0.5, 1.0, 2.0)
    b = line(np.array([0, 0, 3.5 - 2 * math.pi]), 0.2, 0.1, 0.1)
    t = concatenate([a, b])
    assert np.abs(np.diff(t.pose[:, 2])).max() < 0.2
    pose, twist = t.sample(np.array([-1.0, t.duration + 1.0]))
    assert pose[1] == pytest.approx(t.pose[-1]) and not twist.any()


def test_many_twists_are_limited_like_one():
    random = np.random.default_rng(1)
    twists = random.uniform(-1.0, 1.0, (50, 4, 3)) * [0.5, 0.5, 20.0]
    for name in ("epuck", "disc"):
        drive = load_robot(name).drive
        found = drive.saturate_all(twists)
        for told, limited in zip(twists.reshape(-1, 3), found.reshape(-1, 3), strict=True):
            if name == "disc":  # the square roots of math and numpy may differ in the last bit
                assert limited == pytest.approx(drive.saturate(*told.tolist()), rel=1e-14)
            else:
                v, omega = drive.saturate(told[0], told[2])
                assert limited.tolist() == [v, 0.0, omega]


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_a_part_of_a_trajectory_is_the_whole_between_two_times(first, second):
    further = line(np.array([0.5, 0.0, 0.0]), 0.3, 0.1, 1.0)
    whole = concatenate([line(np.zeros(3), 0.5, 0.1, 0.2), further])
    begin, end = sorted((first * whole.duration, second * whole.duration))
    part = whole.between(begin, end)
    assert part.duration >= 1e-3 - 1e-9 and part.duration == pytest.approx(end - begin, abs=2e-3)
    t = np.linspace(0.0, part.duration, 20)
    shift = min(begin, whole.duration - 1e-3)
    for got, expected in zip(part.sample(t), whole.sample(shift + t), strict=True):
        assert got == pytest.approx(expected, abs=1e-9)
    assert part.length == pytest.approx(part.pose[-1, 0] - part.pose[0, 0])
