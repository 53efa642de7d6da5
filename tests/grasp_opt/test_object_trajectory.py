"""Trajectories of objects in time."""

import numpy as np
import pytest

from grasp_opt.object_trajectory import sampled, screw


def test_a_screw_in_time_has_the_twist_that_its_poses_have():
    random = np.random.default_rng(2)
    for _ in range(50):
        start, motion = random.uniform(-1.0, 1.0, 3), random.uniform(-1.0, 1.0, 3)
        task = screw(start, motion, 0.05, 0.05, 0.25)
        rate = np.gradient(task.pose, task.time, axis=0)
        assert task.twist[3:-3] == pytest.approx(rate[3:-3], abs=1e-3)
        moving = np.linalg.norm(task.body_twists, axis=1) > 1e-3
        unit = task.body_twists[moving] / np.linalg.norm(task.body_twists[moving], axis=1)[:, None]
        assert np.ptp(unit, axis=0) == pytest.approx(np.zeros(3), abs=1e-6)
        assert (np.hypot(*task.twist[:, :2].T) + 0.25 * np.abs(task.twist[:, 2])).max() < 0.0501
        again = sampled(task.time, task.pose)
        assert again.twist[3:-3] == pytest.approx(task.twist[3:-3], abs=2e-3)


def test_times_that_do_not_ascend_from_zero_are_no_trajectory():
    for time in ([0.0, 1.0], [0.1, 1.0, 2.0], [0.0, 1.0, 1.0]):
        with pytest.raises(ValueError, match="ascend from 0"):
            sampled(np.array(time), np.zeros((len(time), 3)))
