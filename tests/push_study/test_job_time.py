"""The time of a job by state, and the least time of a path, against figures by hand."""

import math

import numpy as np
import pytest

from push_model.kinematics import DifferentialDrive
from push_study.job_time import job_times, path, shortest_time, time_by_state
from push_study.observer import Trace

DRIVE = DifferentialDrive(wheel_radius=0.02, half_track=0.05, max_wheel_speed=5.0)  # 0.1 m/s


def test_a_straight_line_takes_its_length_at_the_maximum_speed():
    way = np.column_stack([np.linspace(0.0, 0.3, 7), np.zeros(7), np.zeros(7)])
    assert shortest_time(way, DRIVE) == pytest.approx(3.0)
    assert shortest_time(way[::-1], DRIVE) == pytest.approx(3.0), "backward too"


def test_a_turn_in_place_takes_what_the_wheels_need_also_across_pi():
    turn = np.column_stack([np.zeros(9), np.zeros(9), 3.0 + np.linspace(0.0, math.pi, 9)])
    assert shortest_time(turn, DRIVE) == pytest.approx(0.05 * math.pi / 0.1)


def test_on_an_arc_the_outer_wheel_decides():
    radius, angles = 0.4, np.linspace(0.0, 1.0, 1001)
    arc = np.column_stack([radius * np.sin(angles), radius * (1.0 - np.cos(angles)), angles])
    assert shortest_time(arc, DRIVE) == pytest.approx((radius + 0.05) / 0.1, rel=1e-5)


def test_times_by_state_add_up_to_the_time_of_the_job():
    trace = Trace(
        robot=[np.array([0.001 * i, 0.0, 0.0]) for i in range(101)],
        states=[
            (0.0, "IDLE", "waiting", 0),
            (1.0, "PLANNING", "", 0),
            (1.5, "POSITIONING", "", 0),
            (2.0, "PUSHING", "push 1", 0),
            (5.0, "PUSHING", "push 2", 0),
            (9.0, "DETACHING", "", 0),
            (9.5, "IDLE", "", 0),
        ],
    )
    spent = time_by_state(trace.states)
    assert spent == {
        "PLANNING": 0.5,
        "POSITIONING": 0.5,
        "APPROACH": 0.0,
        "PUSHING": 7.0,
        "DETACHING": 0.5,
    }
    row = job_times(trace, DRIVE, 2.0)
    assert row["job_time_s"] == pytest.approx(8.5) and row["pushing_s"] == 7.0
    assert row["path_length_m"] == pytest.approx(0.1)
    assert row["time_ratio"] == pytest.approx(8.5)
    # A plan of 2 s took 0.5 s of simulated time.
    assert row["charged_s"] == row["charged_ratio"] == pytest.approx(10.0)
    assert job_times(trace, DRIVE, 0.3)["charged_s"] == row["job_time_s"]


def test_a_job_that_was_not_seen_has_no_ratio():
    assert len(path(Trace())) == 0
    row = job_times(Trace(), DRIVE, 0.0)
    assert row["job_time_s"] == 0.0 and math.isnan(row["time_ratio"])
