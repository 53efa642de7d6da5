"""A whole experiment, small: a scenario given by path, in a map of its own."""

import json

import pytest

from push_record.bag import read_metadata
from push_study.experiments.single_robot import single_robot
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
    "plan_time_s",
    "min_clearance_m",
}


def test_experiment_leaves_summary_traces_plot_bag_and_report(room, tmp_path, capsys):
    out = tmp_path / "out"
    single_robot([room], 1, 5, out, workers=1)
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["experiment"], summary["seed"], summary["requested"]) == ("single-robot", 5, 1)
    (row,) = summary["trials"]
    assert row.keys() >= MEASURES and row["seed"] == 5
    assert row["success"], row
    assert row["position_error_m"] < 0.02 and row["pushes"] == 1
    assert summary["aggregate"]["success"] == 1.0
    assert set(summary["aggregate"]["position_error_m"]) == {"mean", "std", "max"}
    files = ["in_a_room.png", "trace-in_a_room-5.npz", "trials.csv", "trials.jsonl"]
    for name in [*files, *(f"report/{p}" for p in PRODUCTS)]:
        assert (out / name).stat().st_size > 100, name
    metadata = read_metadata(out / "bag")
    assert metadata["seed"] == "5" and "data:image/png;base64" in metadata["scenario"]
    assert "1/1" in capsys.readouterr().out
    with pytest.raises(FileExistsError):
        single_robot([room], 1, 5, out, workers=1)
