"""The study of selected grasps: a slice of it in the planar world."""

import numpy as np
import pytest

from grasp_opt.object_trajectory import study_trajectories
from push_model.settings import SettingsError, from_mapping
from push_scenario.bodies import load_object, load_robot
from push_study.experiments import grasp_selection
from push_study.experiments.grasp_selection import SelectionTask
from push_study.given_grasp import GraspSettings, choose
from push_study.study import StudyOptions


def task(grasp, trajectory="polynomial-2", scenario="plate_hexagon", law="group"):
    return SelectionTask(scenario, 1, "", trajectory, grasp, law, "planar", "mild")


def chosen(task):
    """The selection of a task."""
    item, robot = load_object(task.scenario), load_robot(grasp_selection.ROBOT)
    path = study_trajectories(grasp_selection.SPEED, grasp_selection.ACCELERATION)
    settings = from_mapping(GraspSettings, grasp_selection.settings_of(task))
    return choose(settings, item, robot, 3, path[task.trajectory]).selection


@pytest.mark.long
def test_the_selected_grasp_is_better_by_its_criterion_and_both_meet_the_requirements():
    for trajectory in ("polynomial-1", "sinusoid-2"):
        best, some = chosen(task("selected", trajectory)), chosen(task("random", trajectory))
        assert best.value > some.value and min(best.margin, some.margin) >= 0.02 - 1e-9
        for found in (best, some):
            centres = found.contacts.centres(load_robot("epuck_ring").footprint_radius)
            away = np.hypot(*(centres[:, None] - centres[None]).transpose(2, 0, 1))
            assert away[np.triu_indices(3, 1)].min() >= 0.115 - 1e-9


@pytest.mark.long
@pytest.mark.parametrize(("law", "bound"), [("group", 5e-3), ("mpc", 15e-3)])
def test_robots_take_the_grasp_and_push_to_the_end(law, bound):
    row = grasp_selection.trial(task("selected", law=law))
    assert row["success"], row["reason"]
    assert row["collision_ticks"] == 0 and row["position_error_m"] < bound
    assert row["final_position_error_m"] < 2.0 * bound
    assert row["planning_cpu_s"] > 0.05, "the choice of the grasp is planning"
    delay = row["charged_s"] - row["duration_s"]
    assert 0.0 <= row["planning_cpu_s"] - delay < 0.04, "of each plan, a frame of 10 ms is free"
    assert row["applied_latency_s"] == pytest.approx(0.01)


def test_a_grasp_that_there_is_not_is_told_and_the_table_counts_it(tmp_path, capsys):
    missing = grasp_selection.trial(task("random", "sinusoid-1", "plate_square"))
    assert not missing["success"] and "passes the test" in missing["reason"]
    options = StudyOptions(("plate_square",), 1, 1, tmp_path, world="planar")
    assert len(grasp_selection.tasks(options)) == 24
    grasp_selection.conclude(options, [], [missing])
    assert "random   group   0 of 1" in capsys.readouterr().out


def test_only_convex_objects_are_taken(tmp_path):
    with pytest.raises(SettingsError, match="not convex"):
        grasp_selection.tasks(StudyOptions(("swarm_flower",), 1, 1, tmp_path))
