"""A whole experiment, small: a scenario given by path, in a map of its own."""

import fcntl
import json
import os
from pathlib import Path

import numpy as np
import pytest

from planar_push.main import main
from push_model.settings import SettingsError
from push_record.bag import read_metadata
from push_record.revision import revision
from push_study.cluster import isolated
from push_study.experiments.single_robot import SingleRobotTask, trial
from push_study.pool import local_results
from push_study.study import StudyOptions, complete, experiment_names, run_study
from push_view.report import PRODUCTS

MEASURES = {
    "scenario",
    "seed",
    "success",
    "reason",
    "position_error_m",
    "orientation_error_rad",
    "duration_s",
    "pushes",
    "contact_losses",
    "planning_cpu_s",
    "min_clearance_m",
}


@pytest.mark.long
def test_experiment_leaves_summary_traces_plot_bag_and_report(room, tmp_path, capsys):
    out = tmp_path / "out"
    options = StudyOptions((room,), 1, 5, out, workers=1)
    summary = run_study("single-robot", options)
    assert complete(summary)
    assert summary == json.loads((out / "summary.json").read_text())
    assert (summary["experiment"], summary["seed"], summary["requested"]) == ("single-robot", 5, 1)
    (row,) = summary["trials"]
    assert row.keys() >= MEASURES and row["seed"] == 5
    assert row["success"], row
    assert row["position_error_m"] < 0.02 and row["pushes"] == 1
    assert summary["aggregate"]["success"] == 1.0
    assert set(summary["aggregate"]["position_error_m"]) == {"mean", "std", "max"}
    files = ["in_a_room.png", "trace-in_a_room-5.npz", "trials.csv", "trials.jsonl", "study.json"]
    for name in [*files, *(f"report/{p}" for p in PRODUCTS)]:
        assert (out / name).stat().st_size > 50, name
    metadata = read_metadata(out / "bag")
    assert metadata["seed"] == "5" and "data:image/png;base64" in metadata["scenario"]
    assert "1/1" in capsys.readouterr().out
    written = (out / "bag" / "metadata.yaml").stat().st_mtime_ns
    assert run_study("single-robot", options)["trials"] == summary["trials"]  # none is run again
    assert (out / "bag" / "metadata.yaml").stat().st_mtime_ns == written
    with pytest.raises(FileExistsError, match="seed"):
        run_study("single-robot", StudyOptions((room,), 1, 6, out, workers=1))


@pytest.mark.long
def test_rows_of_a_worker_that_stays_equal_those_of_fresh_processes(tmp_path):
    """To the bit; only what contains CPU time may differ."""
    tasks = [SingleRobotTask("short", seed, str(tmp_path / "pool")) for seed in (5, 6)]
    pool = dict(local_results(trial, list(enumerate(tasks)), 1))
    fresh = isolated(trial, SingleRobotTask("short", 6, str(tmp_path / "fresh")))
    costs = {"planning_cpu_s", "charged_s", "charged_ratio"}
    rows = [{k: v for k, v in r.items() if k not in costs} for r in (pool[1], fresh)]
    assert rows[0] == rows[1] and pool[0]["success"] and rows[0]["success"]
    assert pool[0]["position_error_m"] != pool[1]["position_error_m"]
    files = [np.load(tmp_path / where / "trace-short-6.npz") for where in ("pool", "fresh")]
    for key in ("time", "robot", "object"):
        assert files[0][key].tobytes() == files[1][key].tobytes(), key


def test_a_trial_gives_its_domain_and_its_context_back(tmp_path, monkeypatch):
    """What a worker must not keep from one trial to the next, also when a trial fails."""
    import rclpy

    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    held = len(list(Path(f"/proc/{os.getpid()}/fd").iterdir()))
    for _ in range(3):
        with pytest.raises(SettingsError):
            trial(SingleRobotTask("atlantis", 1, str(tmp_path)))
    assert "ROS_DOMAIN_ID" not in os.environ and not rclpy.ok()
    assert len(list(Path(f"/proc/{os.getpid()}/fd").iterdir())) <= held


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["--trials", "0"], "at least 1"),
        (["--workers", "-1"], "at least 0"),
        (["--seed", "-4"], "at least 0"),
        (["--trials", "many"], "whole number"),
        (["--scenarios", "short,atlantis"], "atlantis"),
        (["--scenarios", "short,short"], "each once"),
        (["--scheduler", "tcp://nowhere:1"], "Dask"),
        (["--uncertainty", "much"], "expected one of none, mild, contest, hard"),
    ],
)
def test_wrong_words_are_refused_before_anything_starts(tmp_path, capsys, words, what):
    out = tmp_path / "out"
    try:
        code = main(["experiment", "single-robot", "--out", str(out), *words])
    except SystemExit as refusal:  # by the grammar
        code = refusal.code
    assert code == 2 and what in capsys.readouterr().err
    assert not out.exists()


def test_an_unknown_experiment_is_answered_with_those_that_are(capsys):
    assert "single-robot" in experiment_names()
    assert main(["experiment", "alchemy"]) == 2
    assert "single-robot" in capsys.readouterr().err


def test_a_folder_that_holds_something_else_is_left_alone(tmp_path, capsys):
    (tmp_path / "thesis.tex").write_text("years of work")
    words = ["experiment", "single-robot", "--scenarios", "short", "--trials", "1"]
    assert main([*words, "--out", str(tmp_path)]) == 2
    assert "not a study" in capsys.readouterr().err
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


def test_two_processes_are_not_at_one_study_at_once(tmp_path, capsys):
    out = tmp_path / "out"
    words = ["experiment", "single-robot", "--scenarios", "short", "--out", str(out)]
    study = {"experiment": "single-robot", "seed": 1, "uncertainty": "mild", "world": "pybullet"}
    study["revision"] = revision()
    out.mkdir()
    (out / "study.json").write_text(json.dumps(study))
    folder = os.open(out, os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)
        assert main(words) == 2
    finally:
        os.close(folder)
    assert f"another process writes to the study in {out}" in capsys.readouterr().err
    assert [p.name for p in out.iterdir()] == ["study.json"]


@pytest.mark.parametrize("text", ["", '{"experiment": "sin', "[1, 2]", "\x00"])
def test_a_study_whose_mark_cannot_be_read_is_refused_with_what_to_do(tmp_path, capsys, text):
    (tmp_path / "study.json").write_text(text)
    words = ["experiment", "single-robot", "--scenarios", "short", "--trials", "1"]
    assert main([*words, "--out", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert "study.json cannot be read" in error and "choose another --out" in error
    assert [p.name for p in tmp_path.iterdir()] == ["study.json"]


def test_a_study_that_died_before_it_had_its_mark_is_begun_anew(tmp_path, monkeypatch):
    (tmp_path / "study.new").write_text('{"experi')
    monkeypatch.setattr("push_study.study.run_trials", lambda *args: [])
    monkeypatch.setattr("push_study.experiments.single_robot.conclude", lambda *args: None)
    run_study("single-robot", StudyOptions(("short",), 1, 5, tmp_path))
    assert json.loads((tmp_path / "study.json").read_text())["seed"] == 5
    assert not (tmp_path / "study.new").exists()


def test_a_study_in_which_nothing_succeeds_is_not_complete():
    rows = [{"success": False}, {"success": False}]
    assert not complete({"trials": rows, "requested": 2})
    assert not complete({"trials": [{"success": True}], "requested": 2})
    assert complete({"trials": [{"success": True}, *rows], "requested": 3})
