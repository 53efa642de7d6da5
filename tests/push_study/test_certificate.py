"""A slice of the study of alarms: three draws, of which one slips when nothing is done."""

from pathlib import Path

import numpy as np
import pytest

from push_study.experiments import certificate
from push_study.observer import Trace
from push_study.study import StudyOptions


def trace_of(aside, states):
    """Ground truth at 100 Hz of an object in front of a robot that drives along x."""
    trace = Trace()
    for k, y in enumerate(aside):
        trace.time.append(0.01 * k)
        trace.robot.append(np.array([0.001 * k, 0.0, 0.0]))
        trace.object.append(np.array([0.001 * k + 0.095, y, 0.0]))
    trace.states = [(t, name, "", 0) for t, name in states]
    return trace


def test_a_slip_begins_when_the_object_was_last_at_its_place():
    aside = np.concatenate([np.full(100, 0.003), 0.003 + 1e-4 * np.arange(100)])
    pushing = [(0.0, "PUSHING")]
    ((begun, far),) = certificate.slips(trace_of(aside, pushing))
    assert begun == pytest.approx(1.04, abs=0.02) and far == pytest.approx(0.0099, abs=1e-4)
    assert not certificate.slips(trace_of(aside, [(0.0, "POSITIONING")]))
    assert not certificate.slips(trace_of(aside[:115], pushing)), "1.4 mm"


@pytest.mark.long
def test_alarms_come_before_slips_and_no_object_is_lost(tmp_path, capsys):
    options = StudyOptions(scenarios=("line",), trials=3, seed=2, out=Path(tmp_path))
    tasks = certificate.tasks(options)
    rows = [certificate.trial(task) for task in tasks]
    found = certificate.statistics(rows)
    assert found["slipped"] >= 1 and found["in_time"] == found["slipped"]
    assert found["answered_losses"] == found["told_losses"] == 0
    assert found["told_false_alarms"] == 0
    certificate.conclude(options, tasks, rows)
    assert "alarm at least 0.2 s before" in capsys.readouterr().out
    assert (tmp_path / "certificate.png").is_file()
