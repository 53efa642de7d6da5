"""Section 3.1.4: formations of discs, the study's statistics, and a slice of it in both worlds."""

import numpy as np
import pytest
from scipy.stats import pearsonr

from grasp_opt.object_trajectory import study_trajectories
from grasp_opt.wrench_cone import HELD
from push_model import SettingsError, se2
from push_scenario.bodies import load_object
from push_study.experiments import grasp_study
from push_study.experiments.grasp_study import GraspTask
from push_study.formation import push
from push_study.statistics import contingency, correlation, cross_validated, fisher, rank_sum
from push_study.study import StudyOptions, run_study


def some(count, world, seed=1, shapes=grasp_study.SCENARIOS):
    random = np.random.default_rng(seed)
    names = list(study_trajectories())
    for k in range(count):
        shape, trajectory = shapes[k % len(shapes)], names[random.integers(6)]
        yield GraspTask(shape, seed, "", trajectory, k, world)


def drawn(task):
    item, trajectory = load_object(task.scenario), study_trajectories()[task.trajectory]
    return item, grasp_study.draw(task, item, trajectory), trajectory


@pytest.mark.long
def test_what_the_test_lets_pass_is_transported_and_what_it_does_not_slips():
    """60 pushes in the planar world, far enough from the boundary to be certain."""
    certain = held = 0
    for task in some(60, "planar"):
        row = grasp_study.trial(task)
        assert row["test"] == (row["margin"] >= -HELD)
        if abs(row["margin"]) < 0.1 or row["margin"] == 1.0:
            continue
        certain += 1
        held += row["test"]
        assert row["success"] == row["test"], row
        if row["test"]:
            assert row["displacement"] < 0.03 and row["astray_m"] < 5e-3, row
            assert row["energy_n"] == pytest.approx(row["least_energy_n"], rel=0.15)
    assert certain > 30 and 0.2 < held / certain < 0.9


@pytest.mark.long
def test_both_worlds_say_the_same_of_a_grasp():
    agree = total = 0
    for task in some(8, "planar", 5):
        rows = {}
        for world in ("planar", "pybullet"):
            rows[world] = grasp_study.trial(GraspTask(**{**vars(task), "world": world}))
        a, b = rows["planar"], rows["pybullet"]
        assert a["margin"] == b["margin"] and a["least_energy_n"] == b["least_energy_n"]
        total += 1
        agree += a["success"] == b["success"]
        if a["success"] and b["success"]:
            assert a["energy_n"] == pytest.approx(b["energy_n"], rel=0.03)
            assert a["position_error_m"] == pytest.approx(b["position_error_m"], abs=2e-3)
    assert agree >= total - 1


def test_discs_turn_with_their_formation():
    """Else they roll along the object: 0.05 m times the turn of the way."""
    task = GraspTask("plate_square", 1, "", "polynomial-2", 4, "planar")
    item, contacts, trajectory = drawn(task)
    done = push(item, contacts, trajectory, 0.05, "planar")
    assert abs(trajectory.pose[-1, 2]) > 0.7
    assert done.success and done.astray < 1e-3 and done.displacement < 5e-3
    # forces carry the floor's friction
    k = len(done.forces) // 2
    total = done.forces[k].sum(axis=0)
    body = se2.transform(se2.pose(0, 0, -done.objects[k, 2]), total[None])[0]
    assert body[0] == pytest.approx(item.limit_surface().max_force, rel=0.1)


@pytest.mark.long
def test_equal_tasks_give_equal_rows_and_worlds_the_same_grasps():
    task = next(some(1, "planar", 3))
    assert grasp_study.trial(task) == grasp_study.trial(task)
    one = drawn(task)[1]
    other = drawn(GraspTask(**{**vars(task), "world": "pybullet"}))[1]
    assert np.array_equal(one.points, other.points)


def test_statistics_by_hand():
    test = np.array([True, True, False, False, False])
    good = np.array([True, False, False, False, True])
    assert contingency(test, good).tolist() == [[2.0, 1.0], [1.0, 1.0]]
    # the thesis's own tables
    assert fisher(np.array([[181, 8], [18, 33]])) == pytest.approx(3.2187e-20, rel=1e-3)
    assert fisher(np.array([[3, 1], [1, 3]])) == pytest.approx(0.485714, abs=1e-6)
    low, high = np.arange(20.0), np.arange(20.0) + 100.0
    assert rank_sum(low, high) < 1e-6 < rank_sum(low, low + 0.1)
    assert np.isnan(rank_sum(low, np.array([])))


def test_correlations_and_their_intervals():
    random = np.random.default_rng(0)
    inside = 0
    for _ in range(300):
        x = random.normal(size=60)
        y = 0.6 * x + 0.8 * random.normal(size=60)
        c = correlation(np.append(x, np.inf), np.append(y, 1.0))
        assert c.r == pytest.approx(pearsonr(x, y).statistic) and c.count == 60
        inside += c.low < 0.6 < c.high
    assert 0.9 < inside / 300 < 0.99
    assert np.isnan(correlation(np.ones(10), np.arange(10.0)).r)


def test_cross_validation_finds_what_is_there_and_nothing_else():
    random = np.random.default_rng(1)
    x = random.normal(size=(400, 3))
    y = 2.0 * x[:, 0] - x[:, 2] + 0.5 * random.normal(size=400)
    assert cross_validated(x, y).r > 0.95
    noise = [
        cross_validated(random.normal(size=(100, 5)), random.normal(size=100)).r for _ in range(30)
    ]
    assert np.mean(noise) < 0.05  # an optimist would find 0.2
    assert np.isnan(cross_validated(x[:20], y[:20]).r)


@pytest.mark.long
def test_a_slice_of_the_study_prints_its_tables(tmp_path, capsys):
    options = StudyOptions(
        ("plate_hexagon", "plate_ellipse"), 4, 2, tmp_path / "s", workers=1, world="planar"
    )
    summary = run_study("grasp-study", options)
    said = capsys.readouterr().out
    assert summary["requested"] == 48 == len(summary["trials"])
    assert "(thesis 1.66e-15)" in said and "least energy" in said and "181" in said
    assert (tmp_path / "s" / "indices.png").is_file()
    found = grasp_study.findings(summary["trials"])
    assert found.table.sum() == 48 and found.fisher < 1e-4
    with pytest.raises(SettingsError, match="unknown world 'moon'"):
        run_study(
            "grasp-study", StudyOptions(("plate_hexagon",), 1, 1, tmp_path / "m", world="moon")
        )
    with pytest.raises(SettingsError, match=r"bridge\.world"):
        run_study("three-push", StudyOptions(("three-push",), 1, 1, tmp_path / "t", world="planar"))
