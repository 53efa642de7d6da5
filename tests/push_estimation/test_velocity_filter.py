"""Velocity from poses, against the Kalman filter of the textbook and against what is true."""

import math

import numpy as np
import pytest

from push_estimation.velocity_filter import VelocityFilter


def test_it_is_the_kalman_filter_of_constant_velocity():
    """Against the matrix form, at uneven times."""
    random = np.random.default_rng(3)
    noise, driven = 2e-3, 0.4
    track = VelocityFilter(noise, 0.01, driven, 1.5)
    state, P, last = np.zeros(2), np.diag([noise**2, 1.0]), 0.0
    for k, t in enumerate(np.cumsum(random.uniform(0.005, 0.04, 300))):
        x = 0.3 * math.sin(t) + random.normal(0.0, noise)
        track.update(float(t), np.array([x, 0.0, 0.0]))
        if k == 0:
            state[0], last = x, t
            continue
        dt, last = t - last, t
        F = np.array([[1.0, dt], [0.0, 1.0]])
        g = np.array([dt**2 / 2.0, dt])
        state, P = F @ state, F @ P @ F.T + driven**2 * np.outer(g, g)
        K = P[:, 0] / (P[0, 0] + noise**2)
        state, P = state + K * (x - state[0]), P - np.outer(K, P[0])
        assert track.pose[0] == pytest.approx(state[0], abs=1e-9)
        assert track.twist[0] == pytest.approx(state[1], abs=1e-7)


def test_noisy_poses_of_a_turning_body():
    """Headings beyond pi, a rate that is never a jump."""
    random = np.random.default_rng(1)
    track = VelocityFilter(2e-4, 1.7e-3, 0.3, 1.5)
    errors = []
    for k in range(1000):
        t = 0.02 * k
        pose = np.array([0.05 * t, -0.02 * t, math.remainder(3.0 + 0.4 * t, 2.0 * math.pi)])
        track.update(t, pose + random.normal(0.0, 1.0, 3) * [2e-4, 2e-4, 1.7e-3])
        if k > 100:
            errors.append(track.twist - [0.05, -0.02, 0.4])
            assert abs(math.remainder(track.pose[2] - pose[2], 2.0 * math.pi)) < 0.01
    assert np.abs(errors).max(axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=0.25)
    assert np.std(errors, axis=0)[0] < 0.01 and np.std(errors, axis=0)[2] < 0.06


def test_poses_of_the_same_or_an_earlier_time_change_nothing():
    track = VelocityFilter(2e-4, 1e-3, 0.3, 1.5)
    for t in (0.0, 0.1, 0.2):
        track.update(t, np.array([t, 0.0, 0.0]))
    before = track.pose.copy(), track.twist.copy()
    for t in (0.2, 0.1):
        track.update(t, np.array([5.0, 5.0, 1.0]))
    assert np.array_equal(track.pose, before[0]) and np.array_equal(track.twist, before[1])
    track.reset()
    track.update(0.05, np.array([1.0, 2.0, 3.0]))
    assert np.array_equal(track.pose, [1.0, 2.0, 3.0]) and not track.twist.any()
