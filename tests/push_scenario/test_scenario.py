"""FAULTS 20: files that are wrong are refused, and say what was expected."""

import math
from dataclasses import asdict, replace

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from push_model import SettingsError, from_mapping
from push_model.bumpers import RingBumper
from push_model.occupancy import rasterise
from push_model.specs import ObjectSpec, RobotSpec
from push_scenario.files import parse_yaml
from push_scenario.scenario import (
    config_directory,
    load_scenario,
    read_yaml,
    scenario_from_mapping,
    scenario_names,
)

GOOD = {
    "environment": "env1",
    "robots": {"r": {"type": "epuck", "start": [0, 0, 0]}},
    "objects": {"b": {"type": "box9", "start": [0.3, 0, 0]}},
}


@pytest.mark.parametrize("name", scenario_names())
def test_every_shipped_scenario_is_sound(name):
    scenario = load_scenario(name)
    grid = rasterise(scenario.environment)
    for _, start in [*scenario.robots.values(), *scenario.objects.values()]:
        assert grid.contains(start[0], start[1])
    again = scenario_from_mapping(yaml.safe_load(scenario.text), name, "again")
    assert again.text == scenario.text


@pytest.mark.parametrize(("kind", "cls"), [("robots", RobotSpec), ("objects", ObjectSpec)])
def test_every_shipped_type_is_sound(kind, cls):
    files = sorted((config_directory() / kind).glob("*.yaml"))
    made = [from_mapping(cls, read_yaml(path), path.name) for path in files]
    assert len(made) >= 4
    for spec in made:
        assert from_mapping(cls, asdict(spec)) == spec


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"robots": {}}, ["robots", "at least one"]),
        ({"colour": 1}, ["unknown key 'colour'", "environment"]),
        ({"environment": "atlantis"}, ["s.yaml.environment", "atlantis", "env1"]),
        ({"robots": {"r": {"type": "x", "start": [0, 0, 0]}}}, ["s.yaml.robots.r.type", "'x'"]),
        (
            {
                "environment": "atlantis",
                "robots": {"r": {"type": "epuk", "start": [0, 0]}, "s": {"type": "euck"}},
                "objects": {"b": {"type": "bocks", "start": [0, 0, 0]}},
            },
            ["atlantis", "'epuk'", "r.start", "'euck'", "s: missing key 'start'", "'bocks'"],
        ),
        ({"robots": {"r": {"type": "epuck", "start": [0, 0]}}}, ["r.start", "[0, 0]"]),
        ({"robots": {"r": {"type": "epuck", "start": [0, 0, 0], "mass": -1}}}, ["mass", "-1"]),
        ({"robots": {"r r": {"type": "epuck", "start": [0, 0, 0]}}}, ["r r"]),
        ({"objects": {"r": {"type": "box9", "start": [0, 0, 0]}}}, ["both a robot and an object"]),
        ({"goal": [0, 0, "a"]}, ["goal", "[x, y, theta]"]),
        ({"parameters": {"planner": 3}}, ["parameters"]),
        ({"robots": {"r": {"type": "epuck"}}}, ["robots.r", "'start'", "'placement'"]),
        ({"robots": {"r": {"type": "epuck", "count": 3}}}, ["robots.r", "'placement'"]),
        ({"goal": [0, 0, math.inf]}, ["goal", "[x, y, theta]", "inf"]),
        ({"goal": [0, 0, 0], "goals": [[0, 0, 0]]}, ["one of 'goal', 'goals'"]),
        ({"events": [{"kind": "quake", "at": 1}]}, ["events[0].kind", "displace", "quake"]),
        ({"robots": {True: {}}}, ["s.yaml.robots: a key must be text, got True"]),
        ({"robots": {"r": {"type": {}, "start": [0, 0, 0]}}}, ["'bumper' (a mapping of kind flat"]),
        ({"robots": 3, "goal": "x"}, ["s.yaml.robots", "s.yaml.goal"]),
        ({"robots": {"r": {"type": 3, "start": [0, 0, 0], "mass": 1}}}, ["r.type", "3"]),
        ({"robots": {"r\u00f6": {"type": "epuck", "start": [0, 0, 0]}}}, ["letters"]),
        (
            {"environment": {"size": [2, 2], "boxes": [{"centre": [0, 0], "size": [0.1, -1]}]}},
            ["boxes[0]", "size must be positive"],
        ),
    ],
)
def test_wrong_scenarios_name_the_place(change, words):
    with pytest.raises(SettingsError) as error:
        scenario_from_mapping({**GOOD, **change}, "s", "s.yaml")
    for word in words:
        assert word in str(error.value)


def test_text_of_a_scenario_needs_no_other_file(tmp_path):
    """What goes into a bag can be read back anywhere, changed settings included."""
    (tmp_path / "here").mkdir()
    kind = {**yaml.safe_load((config_directory() / "robots" / "epuck.yaml").read_text())}
    (tmp_path / "here" / "kind.yaml").write_text(yaml.safe_dump(kind))
    values = {**GOOD, "robots": {"r": {"type": "kind.yaml", "start": [0, 0, 0], "mass": 0.2}}}
    (tmp_path / "here" / "s.yaml").write_text(yaml.safe_dump(values))
    scenario = load_scenario(str(tmp_path / "here" / "s.yaml")).settings("bridge", seed=9)
    again = scenario_from_mapping(yaml.safe_load(scenario.text), "s", "bag")
    assert again.text == scenario.text
    assert again.robot()[1] == scenario.robot()[1] and again.robot()[1].mass == 0.2
    assert again.environment == scenario.environment
    assert again.parameters == {"bridge": {"seed": 9}}


def test_a_folder_without_scenarios_is_named(tmp_path, monkeypatch):
    monkeypatch.setenv("PLANAR_PUSH_CONFIG", str(tmp_path))
    with pytest.raises(SettingsError, match=f"none, there is no file in {tmp_path}/scenarios"):
        load_scenario("short")


def test_malformed_yaml_names_the_file(tmp_path):
    path = tmp_path / "bad.yaml"
    path.write_text("robots: [}")
    with pytest.raises(SettingsError, match=r"bad\.yaml"):
        load_scenario(str(path))
    with pytest.raises(SettingsError, match="cannot be read"):
        load_scenario(str(tmp_path / "none.yaml"))


@pytest.mark.parametrize(
    "text",
    [
        "supervisor: {auto_execute: false}\n  supervisor: {position_tolerance: 0.005}",
        "supervisor: {auto_execute: false, auto_execute: true}",
    ],
)
def test_a_key_that_occurs_twice_is_refused(tmp_path, text):
    """The last one won without a word: a robot drove although auto_execute was set to false."""
    path = tmp_path / "twice.yaml"
    path.write_text(yaml.safe_dump(GOOD) + f"parameters:\n  {text}\n")
    with pytest.raises(SettingsError, match=r"twice\.yaml.*occurs twice in one mapping(?s:.*)line"):
        load_scenario(str(path))


def test_merged_keys_may_be_replaced():
    values = parse_yaml("a: &a {x: 1, y: 2}\nb: {<<: *a, y: 3}\nc: {<<: [*a, {z: 4}]}", "here")
    assert values["b"] == {"x": 1, "y": 3} and values["c"] == {"x": 1, "y": 2, "z": 4}


def test_overrides_within_a_scenario():
    """Keys beside the type replace the type's; a drive's and a bumper's one by one."""
    robot = {"type": "epuck", "start": [0, 0, 0], "drive": {"wheel_friction": 0.4}}
    robot["bumper"] = {"kind": "ring", "radius": 0.06}
    box = {"type": "box9", "start": [0.3, 0, 0], "mass": 0.08}
    box["shape"] = {"ellipse": {"semi_axis_x": 0.1, "semi_axis_y": 0.05}}
    values = {**GOOD, "robots": {"r": robot}, "objects": {"b": box}}
    scenario = scenario_from_mapping(values, "s", "s")
    plain = scenario_from_mapping(GOOD, "s", "s")
    assert scenario.objects["b"][0].mass == 0.08
    assert scenario.objects["b"][0].geometry.kind == "ellipse"
    assert scenario.robot()[1].drive == replace(plain.robot()[1].drive, wheel_friction=0.4)
    assert scenario.robot()[1].bumper == RingBumper(0.06, z=0.0205)


@given(
    st.dictionaries(
        st.sampled_from(["environment", "robots", "objects", "goal", "parameters"]),
        st.recursive(
            st.none() | st.integers() | st.text(max_size=4),
            lambda x: st.lists(x, max_size=3) | st.dictionaries(st.text(max_size=4), x, max_size=3),
            max_leaves=5,
        ),
    )
)
def test_junk_scenarios_are_refused_not_crashed_on(values):
    try:
        scenario_from_mapping({**GOOD, **values}, "s", "s.yaml")
    except SettingsError:
        pass


def test_grid_marks_walls_and_passage(scenario):
    grid = scenario.grid

    def occupied(x, y):
        column, row = ((np.array([x, y]) - grid.origin) / grid.resolution).astype(int)
        return bool(grid.occupied[row, column])

    assert occupied(0.0, 0.5) and occupied(1.51, 0.0) and occupied(0.0, -1.01)
    assert not occupied(0.0, 0.0) and not occupied(1.4, 0.9)
