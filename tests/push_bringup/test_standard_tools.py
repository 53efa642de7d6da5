"""Launch files, the RViz and the Foxglove layout against the topics and nodes of the suite."""

import ast
import json
import re
from pathlib import Path

import pytest
import yaml

from push_bringup.failures import DomainInUse
from push_bringup.launch_description import arguments_of, processes_of
from push_bringup.preparation import prepare
from push_bringup.systems import SYSTEMS
from push_model.settings import SettingsError
from push_record.topics import recorded_topics
from push_ros.claims import claim_world
from push_scenario.scenario import load_scenario

ROOT = Path(__file__).resolve().parents[2]
TOPICS = recorded_topics(load_scenario("env1-target1"))
LAUNCH_FILES = sorted((ROOT / "launch").glob("*.launch.py"))
DISPLAYS = {
    "Map": "nav_msgs/msg/OccupancyGrid",
    "MarkerArray": "visualization_msgs/msg/MarkerArray",
    "Path": "nav_msgs/msg/Path",
    "Pose": "geometry_msgs/msg/PoseStamped",
    "SetGoal": "geometry_msgs/msg/PoseStamped",
}
SHOWN_IN_3D = {*DISPLAYS.values(), "tf2_msgs/msg/TFMessage"}


def test_every_topic_of_the_rviz_file_exists_with_its_type_and_durability():
    manager = yaml.safe_load((ROOT / "config/planar_push.rviz").read_text())
    manager = manager["Visualization Manager"]
    assert manager["Global Options"]["Fixed Frame"] == "map"
    shown = [d for d in (*manager["Displays"], *manager["Tools"]) if "Topic" in d]
    assert len(shown) == 5
    for display in shown:
        kind = display["Class"].removeprefix("rviz_default_plugins/")
        topic = TOPICS[display["Topic"]["Value"]]
        assert topic.type_name == DISPLAYS[kind], kind
        durable = display["Topic"]["Durability Policy"] == "Transient Local"
        assert durable == topic.latched, kind


def panels(node):
    """Panels of a layout tree."""
    return [node] if isinstance(node, str) else panels(node["first"]) + panels(node["second"])


def test_every_topic_and_field_of_the_foxglove_layout_exists():
    layout = json.loads((ROOT / "config/planar_push.foxglove.json").read_text())
    panel = layout["configById"]
    assert sorted(panels(layout["layout"])) == sorted(panel)
    for topic in panel["3D!planar"]["topics"]:
        assert TOPICS[topic].type_name in SHOWN_IN_3D, topic
    publish = panel["3D!planar"]["publish"]
    assert TOPICS[publish["poseTopic"]].type_name == "geometry_msgs/msg/PoseStamped"
    assert TOPICS[panel["DiagnosticSummary!all"]["topicToRender"]].type_name.endswith("Array")
    paths = [panel["RawMessages!job"]["topicPath"]]
    paths += [p["value"] for c in panel.values() for p in c.get("paths", [])]
    assert len(paths) == 9
    for path in paths:
        topic, _, name = path.partition(".")
        known = TOPICS[topic].message.get_fields_and_field_types()
        assert not name or name in known, path


@pytest.mark.parametrize(
    "path", sorted((ROOT / "launch").glob("*.launch.py")), ids=lambda p: p.name
)
def test_a_launch_file_describes_its_system(path):
    tree = ast.parse(path.read_text())
    (function,) = [n for n in tree.body if isinstance(n, ast.FunctionDef)]
    assert function.name == "generate_launch_description"
    (call,) = [n for n in ast.walk(function) if isinstance(n, ast.Call)]
    assert call.func.id == "describe"
    name = path.name.removesuffix(".launch.py")
    given = [ast.literal_eval(a) for a in call.args]
    assert given == ([] if name == "system" else [name])
    assert name == "system" or name in SYSTEMS
    text = ast.get_docstring(tree)
    assert path.name in text
    used = re.findall(r"(\w+):=", text)
    assert set(used) <= {a.name for a in arguments_of(given[0] if given else "")}


def test_every_system_has_a_launch_file():
    names = {p.name.removesuffix(".launch.py") for p in (ROOT / "launch").glob("*.launch.py")}
    assert names == {*SYSTEMS, "system"}


@pytest.mark.parametrize("system", SYSTEMS)
def test_a_launch_file_starts_what_planar_push_launch_starts(system, tmp_path):
    values = {a.name: a.default for a in arguments_of(system)}
    found = processes_of({**values, "system": system}, tmp_path)
    expected = prepare(values["scenario"], system=system).write(tmp_path)
    assert [(p.name, p.command[3:]) for p in found] == [
        (c.name, [c.module, *c.words]) for c in expected
    ]
    assert all(p.environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST" for p in found)


def test_arguments_of_a_launch_file_are_checked_before_anything_starts(tmp_path, domain):
    values = {"system": "single", "scenario": "short"}
    with pytest.raises(SettingsError, match="factor"):
        processes_of({**values, "factor": "fast"}, tmp_path)
    with pytest.raises(SettingsError, match="no scenarios called"):
        processes_of({**values, "scenario": "nowhere"}, tmp_path)
    named = processes_of({**values, "namespace": "lab", "record": str(tmp_path / "bag")}, tmp_path)
    assert named[0].name == "recorder" and "__ns:=/lab" in named[1].command
    assert [p.name for p in named if not p.restartable] == ["recorder"], "its folder exists then"
    claim = claim_world(str(domain), "/")
    with pytest.raises(DomainInUse):
        processes_of(values, tmp_path)
    claim.close()
