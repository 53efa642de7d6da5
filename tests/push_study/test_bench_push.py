"""Area clearing in the rooms of benchnpin, where its environment is installed (make benchpush)."""

import math
import sys

import numpy as np
import pytest

from planar_push.main import main
from push_model.settings import SettingsError
from push_study.bench_push import policies, room
from push_study.experiments import bench_push
from push_study.study import StudyOptions


def installed():
    try:
        room.python()
    except SettingsError:
        return False
    return True


def test_without_its_environment_the_study_says_what_to_do(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv(room.PYTHON, str(tmp_path / "nowhere"))
    out = tmp_path / "out"
    assert main(["experiment", "bench-push", "--trials", "1", "--out", str(out)]) == 2
    assert "make benchpush" in " ".join(capsys.readouterr().err.split()) and not out.exists()


def test_an_unknown_scenario_is_refused(tmp_path):
    with pytest.raises(SettingsError, match="no scenario called 'clear'"):
        bench_push.tasks(StudyOptions(("clear",), 1, 1, tmp_path))


def test_a_room_that_does_not_start_says_why(tmp_path, monkeypatch):
    """A Python without benchnpin."""
    monkeypatch.setenv(room.PYTHON, sys.executable)
    with room.Room("clear_env") as made, pytest.raises(RuntimeError, match="benchnpin"):
        made.reset(1)


def told(pose, boxes):
    square = [[-5.0, -5.0], [-5.0, 5.0], [5.0, 5.0], [5.0, -5.0]]
    edges = [[square[k], square[(k + 1) % 4]] for k in range(4)]
    return {
        "area": square, "limits": [8.0, 8.0], "edges": edges, "fixed": [], "speed": 0.2,
        "turn": math.pi / 30, "pose": pose, "boxes": boxes,
    }  # fmt: skip


def test_the_sweeping_robot_keeps_to_the_action_space_and_ends():
    """A robot that moves exactly; a box that the front takes along moves with it."""
    box = np.array([[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]]) + [2.0, 1.0]
    pose = np.array([0.0, -4.0, 0.5 * math.pi])
    policy = policies.sweeping(told(pose.tolist(), [box.tolist()]))
    actions, action = [], next(policy)
    for _ in range(3000):
        actions.append(action)
        pose[2] += 0.2 * action[1] * math.pi / 60
        ahead = np.array([math.cos(pose[2]), math.sin(pose[2])])
        pose[:2] += 0.2 * action[0] * 0.2 * ahead
        front = (box - pose[:2]) @ ahead
        beside = (box.mean(axis=0) - pose[:2]) @ [-ahead[1], ahead[0]]
        if action[0] > 0.0 and abs(beside) < 1.2 and 0.0 < front.min() < policies.FRONT.ahead:
            box = box + (policies.FRONT.ahead - front.min()) * ahead
        try:
            action = policy.send(told(pose.tolist(), [box.tolist()]))
        except StopIteration:
            break
    assert len(actions) < 3000 and np.abs(actions).max() <= 1.0
    assert np.abs(box).max() > 5.0 and (np.abs(box.mean(axis=0)) > 5.4).any()


@pytest.mark.long
@pytest.mark.skipif(not installed(), reason="the environment of benchnpin is not installed")
def test_the_open_room_is_cleared_and_equal_seeds_give_equal_rows():
    tasks = [bench_push.ClearingTask("clear-sweeps", seed, "") for seed in (1, 2, 3)]
    rows = [bench_push.trial(task) for task in tasks]
    assert all(row["success"] and row["efficiency"] > 0.6 for row in rows)
    again = bench_push.trial(tasks[1])
    assert {k: v for k, v in again.items() if k != "cpu_s"} == {
        k: v for k, v in rows[1].items() if k != "cpu_s"
    }
