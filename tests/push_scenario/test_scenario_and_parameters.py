"""FAULTS 20: files and parameters that are wrong are refused, and say what was expected."""

from dataclasses import asdict

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from push_model import SettingsError, from_mapping
from push_model.occupancy import rasterise
from push_model.specs import ObjectSpec, RobotSpec
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
        ({"environment": "atlantis"}, ["atlantis", "env1"]),
        ({"robots": {"r": {"type": "epuck", "start": [0, 0]}}}, ["r.start", "[0, 0]"]),
        ({"robots": {"r": {"type": "epuck", "start": [0, 0, 0], "mass": -1}}}, ["mass", "-1"]),
        ({"robots": {"r r": {"type": "epuck", "start": [0, 0, 0]}}}, ["r r"]),
        ({"objects": {"r": {"type": "box9", "start": [0, 0, 0]}}}, ["both a robot and an object"]),
        ({"goal": [0, 0, "a"]}, ["goal", "[x, y, theta]"]),
        ({"parameters": {"planner": 3}}, ["parameters"]),
        ({"parameters": {"planer": {}}}, ["parameters", "unknown node 'planer'", "planner"]),
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


def test_malformed_yaml_names_the_file(tmp_path):
    path = tmp_path / "bad.yaml"
    path.write_text("robots: [}")
    with pytest.raises(SettingsError, match=r"bad\.yaml"):
        load_scenario(str(path))
    with pytest.raises(SettingsError, match="cannot be read"):
        load_scenario(str(tmp_path / "none.yaml"))


def test_overrides_within_a_scenario():
    values = {**GOOD, "objects": {"b": {"type": "box9", "start": [0, 0, 0], "mass": 0.08}}}
    assert scenario_from_mapping(values, "s", "s").objects["b"][0].mass == 0.08


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


def test_ros_parameters_follow_the_dataclass(ros, scenario):
    from rclpy.exceptions import ParameterNotDeclaredException
    from rclpy.parameter import Parameter

    from push_planner.node import PlannerNode

    node = PlannerNode(scenario)
    try:
        assert node.get_parameter("push_speed").value == node.settings.push_speed
        descriptor = node.describe_parameter("push_speed")
        assert "[m/s]" in descriptor.description
        assert descriptor.floating_point_range[0].to_value == 2.0
        (low,) = node.set_parameters([Parameter("push_speed", value=-1.0)])
        assert not low.successful and node.settings.push_speed > 0
        (kind,) = node.set_parameters([Parameter("push_speed", value="fast")])
        assert not kind.successful
        with pytest.raises(ParameterNotDeclaredException):
            node.set_parameters([Parameter("warp", value=1.0)])
        (cross,) = node.set_parameters([Parameter("heading_offsets", value=[0.0, 0.2])])
        assert cross.successful and node.settings.heading_offsets == (0.0, 0.2)
        (good,) = node.set_parameters([Parameter("push_speed", value=0.05)])
        assert good.successful and node.settings.push_speed == 0.05
    finally:
        node.destroy_node()


def test_unknown_scenario_settings_are_refused(ros, scenario):
    from push_mpc.node import ControllerNode

    with pytest.raises(SettingsError, match="warp"):
        ControllerNode(scenario.settings("controller", mpc__warp=3))
    with pytest.raises(SettingsError, match="horizon"):
        ControllerNode(scenario.settings("controller", mpc__horizon=-3))


def test_grid_marks_walls_and_passage(scenario):
    grid = scenario.grid

    def occupied(x, y):
        column, row = ((np.array([x, y]) - grid.origin) / grid.resolution).astype(int)
        return bool(grid.occupied[row, column])

    assert occupied(0.0, 0.5) and occupied(1.51, 0.0) and occupied(0.0, -1.01)
    assert not occupied(0.0, 0.0) and not occupied(1.4, 0.9)
