"""What our law makes of a wrong outline: the study, and a slice of it."""

from dataclasses import replace

import numpy as np
import pytest
from shapely import Polygon

from push_scenario.bodies import load_object
from push_study.experiments import swarm_outline
from push_study.study import StudyOptions


@pytest.mark.parametrize("name", swarm_outline.SCENARIOS)
def test_only_the_outline_is_mistaken(name):
    item = load_object(name)
    for scale in (0.9, 1.1):
        wrong = swarm_outline.mistaken(item, scale)
        assert wrong.outline == pytest.approx(scale * item.outline)
        assert replace(wrong, shape=item.shape) == item
    disc = swarm_outline.mistaken(item, None).outline
    radius = np.hypot(*item.outline.T).max()
    assert np.hypot(*disc.T) == pytest.approx(radius)
    assert Polygon(disc).area > Polygon(item.outline).area


def test_every_belief_is_a_task_with_a_trace_of_its_own(tmp_path):
    options = StudyOptions(swarm_outline.SCENARIOS, 2, 1, tmp_path)
    tasks = swarm_outline.tasks(options)
    assert len(tasks) == 2 * len(swarm_outline.BELIEVED) * len(swarm_outline.SCENARIOS)
    assert len({t.trace for t in tasks}) == len(tasks)


@pytest.mark.long
def test_a_wrong_outline_costs_time_and_the_world_keeps_the_right_one(tmp_path):
    """One target, a metre and a half away."""
    options = StudyOptions(("swarm_square",), 1, 1, tmp_path)
    tasks = {t.believed: replace(t, targets=((1.0, 1.0),)) for t in swarm_outline.tasks(options)}
    exact, large = (swarm_outline.trial(tasks[b]) for b in ("exact", "+10 %"))
    assert exact["success"] and exact["targets"] == 1
    assert exact["object_floor_friction"] == large["object_floor_friction"]
    assert not large["success"] or large["lambda"] > exact["lambda"]
