"""The study of robots that have only their own sensing."""

import numpy as np
import pytest

from push_model.settings import SettingsError
from push_study.experiments import own_sensing
from push_study.study import StudyOptions


def test_every_condition_has_room_and_settings_of_its_own(tmp_path):
    told = set()
    for task in own_sensing.tasks(StudyOptions(own_sensing.SCENARIOS, 2, 1, tmp_path)):
        scenario, goal, way = own_sensing.scenario_of(task)  # which is checked
        condition = own_sensing.CONDITIONS[task.scenario]
        assert len(scenario.robots) == condition.robots
        assert scenario.parameters["own-sensing"]["sensor"] == condition.sensor
        assert np.isnan(goal.goal[2]) and way == pytest.approx(1.98, abs=0.01)
        told.add((task.scenario, task.contest))
    assert len(told) == 2 * len(own_sensing.CONDITIONS), "both objects are pushed"
    with pytest.raises(SettingsError, match="no condition or map called 'range-9'"):
        own_sensing.tasks(StudyOptions(("range-9",), 1, 1, tmp_path))


def test_a_map_is_tried_with_every_object_from_places_of_the_maps_study(tmp_path):
    tasks = own_sensing.tasks(StudyOptions(("transport_middle",), 2, 1, tmp_path))
    assert len({(t.contest, t.seed) for t in tasks}) == len(tasks) == 14
    for task in tasks[:7]:
        scenario, goal, way = own_sensing.scenario_of(task)
        start = scenario.objects["object"][1]
        assert np.allclose(start[:2], [0.0, -1.0]) and np.allclose(goal.goal[:2], [0.0, 1.0])
        assert 2.5 < way < 4.0 and len(scenario.robots) == 20


@pytest.mark.long
def test_a_slice_of_the_study_is_reached_and_prints_its_table(tmp_path, capsys):
    options = StudyOptions(("robots-10",), 1, 1, tmp_path)
    (task,) = tasks = own_sensing.tasks(options)
    row = own_sensing.trial(task)
    assert row["success"] and row["lambda"] < 4.0, row
    own_sensing.conclude(options, tasks, [row, {**row, "success": False}])
    assert "robots-10" in capsys.readouterr().out
    found = own_sensing.statistics([row, {**row, "success": False}])["robots-10"]
    assert (found["reached"], found["of"]) == (1, 2)
    assert found["lambda_max"] == row["lambda"]
