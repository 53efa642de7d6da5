"""Late poses: the study, and a slice of it."""

from dataclasses import replace

import pytest

from push_study.experiments import group_latency
from push_study.study import StudyOptions


def options(tmp_path, trials=1):
    return StudyOptions(("bend",), trials, 1, tmp_path, world="planar")


def test_runs_differ_in_the_latency_alone(tmp_path):
    tasks = group_latency.tasks(options(tmp_path, 2))
    assert len(tasks) == 2 * 2 * len(group_latency.CELLS)
    assert len({t.trace for t in tasks}) == len(tasks)
    first = tasks[0].doubt
    for task in tasks:
        doubt = task.doubt
        assert doubt.latency == (task.latency_s, task.latency_s)
        assert doubt.believed_latency == (task.latency_s if task.known else 0.0)
        same = replace(doubt, latency=first.latency, believed_latency=first.believed_latency)
        assert same == first


@pytest.mark.long
def test_a_known_latency_costs_no_accuracy_and_an_unknown_one_does(tmp_path):
    """The ratio of position errors. Orientation errors may grow by 1 mrad."""
    tasks = [t for t in group_latency.tasks(options(tmp_path)) if t.robots == 2]
    rows = [group_latency.trial(t) for t in tasks]
    assert all(r["success"] and r["collision_ticks"] == 0 for r in rows)
    found = group_latency.statistics(rows)
    for latency in ("20", "50", "100"):
        assert found[f"greatest_ratio_{latency}_ms_known"] <= 1.2
    assert found["greatest_ratio_100_ms_unknown"] > 2.0
    turned = {
        (t.latency_s, t.known): r["orientation_error_rad"] for t, r in zip(tasks, rows, strict=True)
    }
    assert all(turned[cell] < turned[0.0, True] + 1e-3 for cell in group_latency.CELLS if cell[1])
    assert [r["applied_latency_s"] for r in rows] == pytest.approx([t.latency_s for t in tasks])
