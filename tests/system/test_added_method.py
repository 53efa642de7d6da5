"""A method that no package knows, examples/bulldozer.py, runs as a node, in a study, on the page
and in a bag, without an edit anywhere else.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rclpy.node import Node

from planar_push.main import main
from push_bringup.preparation import prepare
from push_bringup.systems import nodes_of
from push_job.method import Task
from push_model.jobs import JobError
from push_model.settings import SettingsError
from push_record.contents import load
from push_record.recorder import RecorderNode
from push_ros.names import Names
from push_ros.process import Spinner
from push_scenario.scenario import scenario_from_mapping
from push_study.graph_run import LockstepRun
from push_study.team_run import run_team
from push_study.uncertainty import uncertainty
from push_view.report import write_report
from push_view.report_panel import LivePanel

sys.path.append(str(Path(__file__).resolve().parents[2] / "examples"))
import bulldozer

NAME = "bulldozer:METHOD"


def scenario(count=1, mass=0.3, **parameters):
    values = {
        "environment": {"size": [3.0, 2.0]},
        "robots": {
            f"e{k}": {"type": "epuck_ring", "start": [-0.8, 0.4 * k, 0.0]} for k in range(count)
        },
        "objects": {"object": {"type": "swarm_square", "start": [-0.5, 0.0, 0.0], "mass": mass}},
        "parameters": {"bridge": {"world": "planar"}, **parameters},
    }
    return scenario_from_mapping(values, "added", "test")


GOAL = np.array([0.0, 0.0, 0.0])


@pytest.mark.long
def test_its_node_brings_the_object_there_and_page_and_bag_show_it(tmp_path):
    believed = scenario(**{NAME: {"speed": 0.1}})
    bag = tmp_path / "bag"
    with LockstepRun(
        believed, lambda: [RecorderNode(bag, believed, 1)], quiet=True, system=NAME
    ) as run:
        run.start()
        page = LivePanel(run.observer, Names("/", "/"), ["e0"])
        state = run.reach(GOAL, 60.0)
        assert state is not None and state.error_code == 0 and state.refusals == 0
        assert state.system == "bulldozer"
        rows = {r["name"]: r["text"] for r in page.rows()}
        assert rows["phase"] == "shove" and rows["still to go"].endswith("mm")
        assert {s["layer"] for s in page.shapes()} == {"beeline"}
        speed = np.diff(np.array(run.observer.trace.robot)[50:150, 0]).max() * 100.0
        assert speed == pytest.approx(0.1, rel=0.2), "its setting came through"
    contents = load(bag)
    (job,) = contents.jobs.values()
    (series,) = job.reports.values()
    assert series.method == "bulldozer" and len(series.figures["still to go"][2]) > 20
    assert write_report(bag, tmp_path / "report", animate=False)["position_error_m"] < 0.06


@pytest.mark.long
def test_a_study_runs_it_in_its_uncertainty():
    outcome = run_team(NAME, scenario(), Task((GOAL,)), uncertainty("mild"), 1, 60.0)
    assert outcome.success and 0.0 < outcome.error[0] < 0.06 and outcome.seconds > 3.0
    assert outcome.trace.phases["shove"] == pytest.approx(outcome.seconds, abs=0.2)
    assert len(outcome.trace.ways) == pytest.approx(outcome.seconds / 0.2, abs=2)


def test_planning_is_charged_where_it_takes_longer_than_to_the_next_frame(monkeypatch):
    whole, costs = bulldozer.Bulldozer.step, iter([0.003] * 5 + [0.25])

    def step(self, seen, belief):
        return replace(whole(self, seen, belief), planning=next(costs, 0.0))

    monkeypatch.setattr(bulldozer.Bulldozer, "step", step)
    outcome = run_team(NAME, scenario(), Task((GOAL,)), uncertainty("mild"), 1, 60.0)
    assert outcome.success and outcome.planning == pytest.approx(0.265)
    assert outcome.delay == pytest.approx(0.25 - 0.01, abs=1e-6), "frames come at 100 Hz"
    assert outcome.charged == outcome.seconds + outcome.delay


def test_its_settings_and_its_team_are_checked_before_anything_starts(capsys):
    nodes = nodes_of(NAME, scenario())
    assert [n.kind for n in nodes] == ["bridge", NAME]
    words = nodes[1].words("file")
    assert f'method:="{NAME}"' in words and 'robots:=["e0"]' in words
    with pytest.raises(SettingsError, match="works alone"):
        prepare(scenario(2), system=NAME)
    with pytest.raises(SettingsError, match="speed"):
        prepare(scenario(**{NAME: {"speed": 9.0}}), system=NAME)
    full = prepare(scenario(**{NAME: {"speed": 0.1}}), system=NAME).scenario
    assert full.parameters[NAME]["within"] == 0.05, "defaults are written out"
    assert main(["launch", "nowhere:METHOD"]) == 2
    assert "nowhere" in capsys.readouterr().err


def test_what_it_refuses_is_refused_at_the_door():
    loaded = scenario(mass=0.6)
    outcome = run_team(NAME, loaded, Task((GOAL,)), uncertainty("none"), 1, 60.0)
    assert not outcome.success and outcome.code is JobError.TOO_HEAVY
    assert "0.4 kg" in outcome.reason and outcome.seconds == 0.0


def test_a_process_of_its_own_hosts_it_too(ros):
    from push_ros.method_node import MethodNode

    node = MethodNode(NAME, scenario())
    spinner = Spinner([node])
    try:
        assert isinstance(node, Node) and node.spec.name == "bulldozer"
        assert node.get_parameter("speed").value == 0.08
    finally:
        spinner.close()
