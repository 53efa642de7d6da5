"""The tracking study: a slice of it in the graph, in both worlds."""

import itertools
import math

import numpy as np
import pytest

from grasp_opt.contact_outline import ContactOutline
from grasp_opt.placement import Placer
from push_model.settings import SettingsError, from_mapping
from push_model.traction import lift_share, standing_traction, traction
from push_scenario.bodies import load_object, load_robot
from push_study.experiments import group_tracking
from push_study.experiments.group_tracking import THETA0, TrackingTask
from push_study.given_grasp import GraspSettings, choose
from push_study.study import StudyOptions, run_study

ALL = itertools.product(group_tracking.SCENARIOS, group_tracking.ROBOTS, group_tracking.PLACEMENTS)
FREE = ("planning_cpu_s", "charged_s")
"""Measures that depend on the machine."""


def task(tmp_path, scenario="double-bend", robots=2, placement="even", world="planar"):
    return TrackingTask(scenario, 3, str(tmp_path), robots, placement, world, "mild")


@pytest.mark.long
@pytest.mark.parametrize(("scenario", "robots", "placement"), list(ALL))
def test_every_task_is_tracked_in_the_planar_world(tmp_path, scenario, robots, placement):
    row = group_tracking.trial(task(tmp_path, scenario, robots, placement))
    assert row["success"] and row["collision_ticks"] == 0, row["reason"]
    assert row["position_error_m"] < 5e-3 and row["orientation_error_rad"] < 0.02
    delay = row["charged_s"] - row["duration_s"]
    assert 0.0 <= row["planning_cpu_s"] - delay < 0.04, "of each plan, a frame of 10 ms is free"
    assert row["duration_s"] > row["push_duration_s"] > 18.0 and row["planning_cpu_s"] > 0.0
    assert row["applied_latency_s"] == pytest.approx(0.01), "that of the bridge's motion capture"


@pytest.mark.long
def test_a_push_in_pybullet_with_noise_is_tracked(tmp_path):
    row = group_tracking.trial(task(tmp_path, "bend", 2, "optimised", "pybullet"))
    assert row["success"] and row["collision_ticks"] == 0
    assert row["position_error_m"] < 3e-3 and row["orientation_error_rad"] < 0.01
    assert 0.8 < row["object_floor_friction"] / 0.6 < 1.2, "what is drawn is told"


@pytest.mark.long
def test_a_push_can_be_repeated_to_the_bit(tmp_path):
    one, other = (group_tracking.trial(task(tmp_path)) for _ in range(2))
    assert set(FREE) < set(one) and {k: v for k, v in one.items() if k not in FREE} == {
        k: v for k, v in other.items() if k not in FREE
    }


def test_placements_are_what_they_are_called():
    item, robot = load_object(group_tracking.OBJECT), load_robot(group_tracking.ROBOT)
    outline, path = ContactOutline(item.geometry), group_tracking.trajectories()["double-bend"]
    placer = Placer(item, path, 3, robot.footprint_radius)

    def placed(placement):
        values = group_tracking.settings_of(task("x", robots=3, placement=placement))
        settings = from_mapping(GraspSettings, values)
        return placer.placement(choose(settings, item, robot, 3, path).way)

    even, best = placed("even"), placed("optimised")
    angles = outline.angle_of_way(even.way)
    assert np.sort(angles) == pytest.approx(np.sort(THETA0[3]), abs=1e-6)
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
    for name in ("position_error_m", "force_n", "planning_cpu_s", "charged_s"):
        assert summary["aggregate"][name]["mean"] > 0.0, name
    assert summary["aggregate"]["pairs_wave_2"] == 1 == summary["aggregate"]["pairs_wave_3"]
    assert "wave" in capsys.readouterr().out
    assert (tmp_path / "study" / "wave-2.png").is_file()
    with pytest.raises(SettingsError, match="no trajectory called 'loop'"):
        run_study("group-tracking", StudyOptions(("loop",), 1, 1, tmp_path / "other"))
