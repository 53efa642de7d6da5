"""A slice of each study of swarms that has no test of its own: its first trial, and its tables."""

import pytest

from push_study.experiments import swarm_maps, swarm_scale, swarm_upsets
from push_study.study import StudyOptions


@pytest.mark.long
@pytest.mark.parametrize("study", [swarm_maps, swarm_scale, swarm_upsets])
def test_a_slice_of_the_study_is_reached_and_prints_its_tables(study, tmp_path, capsys):
    options = StudyOptions(study.SCENARIOS, 1, 1, tmp_path)
    (first, *_) = tasks = study.tasks(options)
    row = study.trial(first)
    assert row["success"], row
    study.conclude(options, tasks, [row])
    assert capsys.readouterr().out.strip() and any(tmp_path.glob("*.png"))
