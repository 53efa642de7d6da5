"""The study of swarm sizes."""

import numpy as np
import pytest

from push_study.experiments import swarm_scale


@pytest.mark.parametrize("count", swarm_scale.ROBOTS)
def test_all_discs_have_room_at_their_start(count):
    """The rooms of 500 and of 1000 discs were too small, and the study refused to run."""
    for seed in range(1, 4):
        task = swarm_scale.ScaleTask("swarm_square", seed, count, "planar", "mild")
        scenario = swarm_scale.scenario_of(task)  # which is checked
        assert len(scenario.robots) == count
        starts = np.array([pose[:2] for _, pose in scenario.robots.values()])
        assert np.abs(starts).max() < 0.5 * min(scenario.environment.size)
