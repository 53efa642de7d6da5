"""Who makes up a system: names, namespaces, command lines, what is refused."""

from dataclasses import asdict

import numpy as np
import pytest
import yaml

from push_bringup.node_kinds import MODULES, SECTIONS
from push_bringup.node_settings import check_settings, resolved
from push_bringup.preparation import check_bag, prepare
from push_bringup.systems import LIVE, nodes_of, single, teams_of
from push_model.settings import SettingsError
from push_scenario.scenario import load_scenario, scenario_from_mapping, scenario_from_text


def parameters(words):
    """ROS parameters of a command line."""
    values = [w for f, w in zip(words, words[1:], strict=False) if f == "-p"]
    return {k: yaml.safe_load(v) for k, v in (w.split(":=", 1) for w in values)}


def test_one_robot_without_teams():
    nodes = single(load_scenario("short"))
    assert [(n.name, n.namespace) for n in nodes] == [
        ("bridge", "/"),
        ("controller", "/epuck1"),
        ("planner", "/"),
        ("supervisor", "/"),
    ]
    assert {n.kind for n in nodes} < set(MODULES)
    words = nodes[-1].words("short")
    assert words[:3] == ["--ros-args", "-r", "__ns:=/"]
    expected = {"scenario": "short", "world": "/", "robot": "epuck1", "object": "box"}
    assert parameters(words) == expected


@pytest.mark.parametrize("namespace", ["", "a", "/a/", "/lab/a"])
def test_teams_have_planner_and_supervisor_and_robots_their_controllers(namespace):
    nodes = single(load_scenario("two-singles"), namespace)
    root = "/" + namespace.strip("/") if namespace else ""
    places = {n.name: n.namespace for n in nodes}
    assert places == {
        "bridge": root or "/",
        "south/controller": f"{root}/epuck1",
        "south/planner": f"{root}/south",
        "south/supervisor": f"{root}/south",
        "north/controller": f"{root}/epuck2",
        "north/planner": f"{root}/north",
        "north/supervisor": f"{root}/north",
    }
    assert {n.world for n in nodes} == {root or "/"}
    assert {(n.team, n.robot, n.item) for n in nodes if n.kind == "supervisor"} == {
        ("south", "epuck1", "box1"),
        ("north", "epuck2", "box2"),
    }


@pytest.mark.parametrize("namespace", ["1a", "a b", "a//b", "ä", "a/-"])
def test_a_namespace_that_ros_would_refuse(namespace):
    with pytest.raises(SettingsError, match="namespace"):
        nodes_of("single", load_scenario("short"), namespace)


def test_an_unknown_system_and_a_team_too_large():
    with pytest.raises(SettingsError, match=r"'quartet'.*single"):
        nodes_of("quartet", load_scenario("short"))
    scenario = load_scenario("two-singles")
    text = yaml.safe_load(scenario.text)
    del text["teams"]["north"]
    text["teams"]["south"]["robots"] = ["epuck1", "epuck2"]
    both = scenario_from_text(yaml.safe_dump(text), "both", "both")
    with pytest.raises(SettingsError, match="'south' has 2 robots"):
        single(both)


def test_parameters_given_in_code_replace_the_scenarios_and_are_checked():
    made = prepare("short", parameters={"planner": {"push_speed": 0.05}}).scenario
    assert made.parameters["planner"]["push_speed"] == 0.05
    deep = {"bridge": {"motion_capture": {"latency": 0.02}}, "controller": {"mpc": {"horizon": 12}}}
    made = prepare("short", parameters=deep).scenario
    assert made.parameters["bridge"]["motion_capture"]["latency"] == 0.02
    assert made.parameters["controller"]["mpc"]["horizon"] == 12
    for wrong, word in (
        ({"planner": {"push_speed": -1.0}}, "push_speed"),
        ({"planner": {"push_sped": 1.0}}, "push_sped"),
        ({"controller": {"tracker": {"deadline": "soon"}}}, "deadline"),
        ({"controller": {"horizon": 3}}, "horizon"),
        ({"bridge": {"physics": {"weather": 1}}}, "weather"),
        ({"plumber": {}}, "plumber"),
        ({"planner": 3}, "planner"),
    ):
        with pytest.raises(SettingsError, match=word):
            prepare("short", parameters=wrong)


def test_the_live_deadline_yields_to_the_scenario_and_lockstep_has_none():
    deadline = LIVE["controller"]["tracker"]["deadline"]
    made = prepare("short").scenario.parameters["controller"]["tracker"]
    assert made["deadline"] == deadline > 0.0
    own = {"controller": {"tracker": {"deadline": 0.2}}}
    made = prepare("short", parameters=own).scenario.parameters["controller"]["tracker"]
    assert made["deadline"] == 0.2
    assert "controller" not in load_scenario("short").parameters


def test_a_factor_overrides_the_scenario_only_when_it_is_given():
    scenario = load_scenario("short").settings("bridge", real_time_factor=2.0)
    assert prepare(scenario).scenario.parameters["bridge"]["real_time_factor"] == 2.0
    assert prepare(scenario, factor=4).scenario.parameters["bridge"]["real_time_factor"] == 4.0
    assert prepare("short").scenario.parameters["bridge"]["real_time_factor"] == 1.0
    with pytest.raises(SettingsError, match="real_time_factor"):
        prepare("short", factor=-1.0)


def test_what_the_processes_read_is_what_was_checked(tmp_path):
    setup = prepare(
        "two-singles", parameters={"planner": {"push_speed": 0.05}}, record=tmp_path / "bag"
    )
    (tmp_path / "s").mkdir()
    children = setup.write(tmp_path / "s")
    assert children[0].name == "recorder" and children[0].bag == tmp_path / "bag"
    assert len({c.name for c in children}) == len(children) == 8
    for child in children:
        read = load_scenario(parameters(child.words)["scenario"])
        assert read.name == "two-singles" and read.parameters == setup.scenario.parameters
        assert [t.name for t in teams_of(read)] == ["south", "north"]
        for name, (spec, start) in setup.scenario.robots.items():
            assert read.robots[name][0] == spec and np.array_equal(read.robots[name][1], start)
    children[0].deaths = 2
    assert parameters(children[0].words)["out"] == f"{tmp_path}/bag-3"


def test_a_bag_that_cannot_be_written_is_refused(tmp_path):
    check_bag(tmp_path / "new" / "bag")
    (tmp_path / "bag").mkdir()
    with pytest.raises(FileExistsError, match="bag exists already"):
        prepare("short", record=tmp_path / "bag")
    (tmp_path / "file").write_text("")
    with pytest.raises(SettingsError, match="cannot be written"):
        check_bag(tmp_path / "file" / "bag")


def test_what_is_started_has_every_setting_written_out():
    setup = prepare("short", parameters={"planner": {"push_speed": 0.05}})
    full = setup.scenario
    check_settings(full)
    assert set(full.parameters) == set(SECTIONS)
    assert full.parameters["planner"]["push_speed"] == 0.05  # what is said stays
    for node, sections in SECTIONS.items():
        for section, cls in sections.items():
            values = full.parameters[node]
            assert set(asdict(cls())) <= set(values[section] if section else values)
    read = scenario_from_text(full.text, "short", "bag")
    assert resolved(read).parameters == full.parameters == resolved(full).parameters


@pytest.mark.parametrize(
    ("node", "name", "why"),
    [("controller", "controller", "unknown controller"), ("bridge", "world", "unknown world")],
)
def test_what_is_chosen_by_name_is_known_before_anything_starts(node, name, why):
    """Its settings are those of what was chosen."""
    default = getattr(SECTIONS[node][""](), name)
    assert prepare("short", parameters={node: {name: default}}).scenario
    with pytest.raises(SettingsError, match=why):
        prepare("short", parameters={node: {name: "atlantis"}})
    with pytest.raises(SettingsError, match="unknown"):
        prepare("short", parameters={node: {"typo": 1}})


def test_the_system_torque_has_a_controller_for_each_robot_driven_by_torques():
    nodes = nodes_of("torque", load_scenario("wheel-slip"), "lab")
    assert [(n.name, n.kind, n.namespace) for n in nodes] == [
        ("bridge", "bridge", "/lab"),
        ("pioneer/controller", "torque_controller", "/lab/pioneer"),
    ]
    assert parameters(nodes[1].words("file"))["robot"] == "pioneer"
    with pytest.raises(SettingsError, match="driven by wheel torques"):
        prepare("short", system="torque")
    own = {"torque_controller": {"nmpc": {"friction": 0.7}}}
    made = prepare("wheel-slip", system="torque", parameters=own).scenario
    assert made.parameters["torque_controller"]["nmpc"]["friction"] == 0.7
    for wrong in ({"nmpc": {"friction": -1.0}}, {"mpc": {"horizon": 3}}):
        with pytest.raises(SettingsError):
            prepare("wheel-slip", system="torque", parameters={"torque_controller": wrong})


def group_values(**changes):
    values = {
        "environment": "open",
        "robots": {
            f"e{i}": {"type": "epuck_ring", "start": [-1.0, 0.3 * i, 0.0]} for i in range(3)
        },
        "objects": {"plate": {"type": "plate_hexagon", "start": [0.0, 0.0, 0.0]}},
    }
    return scenario_from_mapping({**values, **changes}, "several", "several")


def test_a_group_has_an_optimizer_and_one_node_for_all_its_robots():
    nodes = nodes_of("group", group_values(), "lab")
    assert [n.kind for n in nodes] == ["bridge", "optimizer", "group"]
    assert nodes[2].robots == ("e0", "e1", "e2") and nodes[2].item == "plate"
    assert 'robots:=["e0", "e1", "e2"]' in nodes[2].words("s")


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"robots": {"a": {"type": "epuck_ring", "start": [-1, 0, 0]}}}, "a group needs 2 to 5"),
        ({"objects": {}}, "no object to push"),
        (
            {
                "robots": {
                    "a": {"type": "epuck_ring", "start": [-1, 0, 0]},
                    "b": {"type": "epuck", "start": [-1, 0.5, 0]},
                }
            },
            "robots of several types",
        ),
        (
            {
                "robots": {
                    name: {"type": "epuck", "start": [-1, y, 0]}
                    for name, y in (("a", -0.4), ("b", 0.4))
                }
            },
            "without a ring bumper",
        ),
        (
            {"objects": {"plate": {"type": "swarm_flower", "start": [0.3, 0, 0]}}},
            "not convex",
        ),
    ],
)
def test_what_is_no_group_is_refused_with_the_reason(changes, why):
    with pytest.raises(SettingsError, match=why):
        nodes_of("group", group_values(**changes))


@pytest.mark.parametrize("system", ["swarm", "own-sensing"])
def test_a_trajectory_that_nothing_would_follow_is_refused(system):
    scenario = load_scenario("group-trajectory")
    assert nodes_of("group", scenario)
    with pytest.raises(SettingsError, match="a trajectory, which only the system 'group' follows"):
        nodes_of(system, scenario)
