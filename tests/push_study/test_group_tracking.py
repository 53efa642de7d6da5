"""The tracking study: a slice of it, in both worlds."""

import math

import numpy as np
import pytest

from grasp_opt.contact_outline import ContactOutline
from push_model.settings import SettingsError
from push_model.traction import lift_share, standing_traction, traction
from push_scenario.bodies import load_object, load_robot
from push_study.experiments import group_tracking
from push_study.experiments.group_tracking import THETA0, TrackingTask
from push_study.study import StudyOptions, run_study


def task(tmp_path, scenario="double-bend", robots=2, placement="optimised", world="planar"):
    return TrackingTask(scenario, 3, str(tmp_path), robots, placement, world, "mild")


@pytest.mark.parametrize("robots", [2, 3])
@pytest.mark.parametrize("scenario", group_tracking.SCENARIOS)
def test_every_task_is_tracked_in_the_planar_world(tmp_path, scenario, robots):
    for placement in ("optimised", "even"):
        row = group_tracking.trial(task(tmp_path, scenario, robots, placement))
        assert row["success"] and not row["collision"], row["reason"]
        assert row["position_error_m"] < 5e-3 and row["orientation_error_rad"] < 0.02


@pytest.mark.long
def test_a_push_in_pybullet_with_noise_is_tracked(tmp_path):
    row = group_tracking.trial(task(tmp_path, "bend", 2, world="pybullet"))
    assert row["success"] and not row["collision"]
    assert row["position_error_m"] < 3e-3 and row["orientation_error_rad"] < 0.01
    assert 0.8 < row["object_floor_friction"] / 0.6 < 1.2, "what is drawn is told"


def test_a_push_can_be_repeated_to_the_bit(tmp_path):
    assert group_tracking.trial(task(tmp_path)) == group_tracking.trial(task(tmp_path))


def test_placements_are_what_they_are_called():
    item, robot = load_object(group_tracking.OBJECT), load_robot(group_tracking.ROBOT)
    outline = ContactOutline(item.geometry)
    even = group_tracking.placement_of(task("x", robots=3, placement="even"), item, robot)
    angles = outline.angle_of_way(even.way)
    assert np.sort(angles) == pytest.approx(np.sort(THETA0[3]), abs=1e-6)
    best = group_tracking.placement_of(task("x", robots=3), item, robot)
    assert best.cost < even.cost and best.margin >= 0.1 - 1e-6
    lift = lift_share(robot, item)
    most = standing_traction(robot, lift)
    assert most == pytest.approx(traction(robot, most, lift), rel=1e-6)
    assert np.linalg.norm(best.forces, axis=2).max() <= 0.9 * most + 1e-9


@pytest.mark.long
def test_a_study_ends_with_a_table_and_plots_and_refuses_unknown_trajectories(tmp_path, capsys):
    options = StudyOptions(("wave",), 1, 1, tmp_path / "study", world="planar", workers=1)
    summary = run_study("group-tracking", options)
    assert len(summary["trials"]) == 4 and math.isfinite(summary["trials"][0]["force_n"])
    assert "wave" in capsys.readouterr().out
    assert (tmp_path / "study" / "wave-2.png").is_file()
    with pytest.raises(SettingsError, match="no trajectory called 'loop'"):
        run_study("group-tracking", StudyOptions(("loop",), 1, 1, tmp_path / "other"))
