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
    cells = len(swarm_outline.BELIEVED) * len(swarm_outline.ARMS) * len(swarm_outline.SCENARIOS)
    assert len(tasks) == 2 * cells
    assert len({t.trace for t in tasks}) == len(tasks)


@pytest.mark.long
def test_with_a_radius_only_the_estimator_saves_most_of_the_time(tmp_path):
    """One target, a metre and a half away. The world has the right outline."""
    options = StudyOptions(("swarm_square",), 1, 1, tmp_path)
    tasks = {
        (t.believed, t.arm): replace(t, targets=((1.0, 1.0),)) for t in swarm_outline.tasks(options)
    }
    exact, told, estimated = (
        swarm_outline.trial(tasks[cell])
        for cell in (("exact", "told"), ("disc", "told"), ("disc", "estimated"))
    )
    assert exact["success"] and exact["targets"] == 1
    assert exact["object_floor_friction"] == estimated["object_floor_friction"]
    assert estimated["success"] and exact["lambda_1"] < estimated["lambda_1"] < 3.0
    assert told["lambda_1"] > 3.0 * estimated["lambda_1"]
    found = swarm_outline.statistics([exact, told, estimated])
    assert found["disc, estimated"]["targets"] == 1 and found["disc, estimated"]["of"] == 6
    assert found["disc, told"]["lambda_1"] == told["lambda_1"]
    low, high = found["disc, estimated"]["wilson"]
    assert 0.0 < low < 1 / 6 < high < 0.6
