"""The section ``lab`` of a scenario: read, checked, written out."""

import copy

import numpy as np
import pytest
import yaml

from push_model.settings import SettingsError
from push_scenario.lab import axes_matrix
from push_scenario.scenario import load_scenario, scenario_from_mapping, scenario_from_text

TEXT = """
environment: open
robots:
  epuck1: {type: epuck, start: [0.0, 0.0, 0.0]}
objects:
  box: {type: box9, start: [0.5, 0.0, 0.0]}
on: lab
lab:
  poses: {kind: pose_array, topic: /mocap, order: [A, B]}
  robots: {epuck1: {kind: epuck2, host: 127.0.0.1}}
  bodies: {epuck1: {name: A, offset: [0.0, 0.01, 1.0]}, box: {name: B}}
  axes: [z, x, y]
  units: mm
"""


def changed(path, value):
    values = yaml.safe_load(TEXT)
    inner = values
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    return values


def test_the_key_on_is_not_taken_for_a_truth_value(tmp_path):
    """YAML 1.1 reads a bare ``on`` as true."""
    file = tmp_path / "mine.yaml"
    file.write_text(TEXT)
    scenario = load_scenario(str(file))
    assert scenario.on == "lab" and scenario.lab.marker("box") == "B"
    assert scenario.lab.robots["epuck1"].port == 1000
    assert scenario.lab.offset("epuck1").tolist() == [0.0, 0.01, 1.0]


def test_the_text_of_a_scenario_has_its_lab():
    scenario = scenario_from_text(TEXT, "mine", "mine.yaml")
    again = scenario_from_text(scenario.text, "mine", "mine.yaml")
    assert again.lab == scenario.lab and again.on == "lab" and again.text == scenario.text


def test_a_scenario_with_a_lab_may_be_simulated():
    values = yaml.safe_load(TEXT)
    del values[True]
    scenario = scenario_from_mapping(values, "mine", "mine.yaml")
    assert scenario.on == "sim" and scenario.lab is not None


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (("lab", "axes"), ["x", "z", "y"], "mirror image"),
        (("lab", "axes"), ["x", "x", "y"], "three of x, y, z"),
        (("lab", "axes"), "up", "z_up, y_up"),
        (("lab", "units"), "cm", "units"),
        (("lab", "poses", "oops"), 1, "lab.poses: unknown key 'oops'"),
        (("lab", "poses"), {"kind": "vicon"}, "lab.poses.kind: expected one of"),
        (("lab", "robots"), {}, "no driver for the robot 'epuck1'"),
        (("lab", "robots", "epuck9"), {"kind": "twist", "topic": "/a"}, "epuck9"),
        (("lab", "robots", "epuck1", "port"), 0, "port"),
        (("lab", "bodies", "bx"), {}, r"lab.bodies: \['bx'\] not in the scenario"),
        (("lab", "bodies", "box"), {"name": "A"}, "same name in motion capture"),
        (("lab", "latency_spread"), 0.1, "latency_spread needs a latency"),
        (("lab",), None, "needs the section 'lab'"),
        ((True,), "real", "on: expected one of"),
        (("events",), [{"kind": "kill", "at": 1.0, "robot": "epuck1"}], "simulation only"),
    ],
)
def test_what_is_wrong_is_named(path, value, words):
    values = copy.deepcopy(changed(path, value))
    with pytest.raises(SettingsError, match=words):
        scenario_from_mapping(values, "mine", "mine.yaml")


@pytest.mark.parametrize("axes", ["z_up", "y_up", ("z", "x", "y"), ("-y", "x", "z")])
def test_axes_are_rotations(axes):
    matrix = axes_matrix(axes)
    assert np.allclose(matrix @ matrix.T, np.eye(3)) and np.linalg.det(matrix) == pytest.approx(1.0)


def test_y_up_puts_y_above():
    assert (axes_matrix("y_up") @ [0.0, 1.0, 0.0]).tolist() == [0.0, 0.0, 1.0]
