"""The schemas that editors read: current, true of every shipped file, untrue of wrong ones."""

import copy
import json

import pytest
import yaml

from push_scenario.scenario import config_directory, load_scenario
from push_scenario.schema import schemas, write_schemas

KINDS = ("scenario", "robot", "object", "environment")
FILES = [(k, p) for k in KINDS for p in sorted((config_directory() / f"{k}s").glob("*.yaml"))]
TYPES = {
    "object": dict,
    "array": list,
    "string": str,
    "boolean": bool,
    "null": type(None),
    "integer": int,
    "number": (int, float),
}


def wrong(value, schema, whole):
    """What a JSON schema finds wrong with a value; the part of the standard that ours use."""
    found = []
    if "$ref" in schema:
        found += wrong(value, whole["$defs"][schema["$ref"].removeprefix("#/$defs/")], whole)
    if "anyOf" in schema and all(wrong(value, s, whole) for s in schema["anyOf"]):
        found.append(f"{value!r} is none of {len(schema['anyOf'])} kinds")
    if "oneOf" in schema and sum(not wrong(value, s, whole) for s in schema["oneOf"]) != 1:
        found.append(f"{value!r} is not exactly one of {len(schema['oneOf'])} kinds")
    if "const" in schema and value != schema["const"]:
        found.append(f"{value!r} is not {schema['const']!r}")
    if "enum" in schema and value not in schema["enum"]:
        found.append(f"{value!r} is not in {schema['enum']}")
    if "type" in schema and (
        not isinstance(value, TYPES[schema["type"]])
        or (isinstance(value, bool) and schema["type"] != "boolean")
    ):
        return [*found, f"{value!r} is no {schema['type']}"]
    if isinstance(value, (int, float)) and not (
        schema.get("minimum", value) <= value <= schema.get("maximum", value)
    ):
        found.append(f"{value!r} is out of range")
    if isinstance(value, dict):
        known = schema.get("properties", {})
        found += [f"{k} is missing" for k in schema.get("required", ()) if k not in value]
        for key, item in value.items():
            if key in known:
                found += wrong(item, known[key], whole)
            elif schema.get("additionalProperties") is False:
                found.append(f"{key} is unknown")
            elif isinstance(schema.get("additionalProperties"), dict):
                found += wrong(item, schema["additionalProperties"], whole)
    if isinstance(value, list):
        if not schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value)):
            found.append(f"{len(value)} items")
        first = schema.get("prefixItems", [])
        for i, item in enumerate(value):
            found += wrong(item, first[i] if i < len(first) else schema.get("items", {}), whole)
    return found


def check(kind, value):
    schema = schemas()[kind]
    return wrong(value, schema, schema)


def test_the_committed_schemas_are_current(tmp_path):
    """Write them anew with ``push_scenario.schema.write_schemas`` when a settings class changes."""
    for path in write_schemas(tmp_path):
        committed = config_directory() / "schema" / path.name
        assert json.loads(committed.read_text()) == json.loads(path.read_text())


@pytest.mark.parametrize(("kind", "path"), FILES, ids=[p.stem for _, p in FILES])
def test_every_shipped_file_follows_its_schema_and_names_it(kind, path):
    text = path.read_text()
    assert text.startswith(f"# yaml-language-server: $schema=../schema/{kind}.json\n")
    assert check(kind, yaml.safe_load(text)) == []


@pytest.mark.parametrize("name", ["env1-target1", "ring20", "pioneer"])
def test_the_text_of_a_scenario_follows_the_schema_too(name):
    assert check("scenario", yaml.safe_load(load_scenario(name).text)) == []


SCENARIO = {
    "environment": "env1",
    "robots": {"r": {"type": "epuck", "start": [0, 0, 0], "drive": {"wheel_friction": 0.5}}},
    "objects": {"o": {"type": "box9", "start": [1, 0, 0]}},
    "teams": {"t": {"robots": ["r"], "trajectory": [{"at": 0, "pose": [0, 0, 0]}]}},
    "events": [{"kind": "displace", "at": 1, "body": "o", "by": [0, 0, 1]}],
    "parameters": {"planner": {"push_speed": 0.05}},
}


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (["robots", "r", "mass"], -1),
        (["robots", "r", "colour"], "red"),
        (["robots", "r", "start"], [0, 0]),
        (["robots", "r", "placement"], {"spiral": {}}),
        (["objects", "o", "shape"], {"rectangle": {"length": 1}}),
        (["objects", "o", "type"], {"shape": {"kind": "rectangle", "length": 1, "width": 1}}),
        (["environment"], {"size": [1, 2], "boxes": [{"centre": [0, 0]}]}),
        (["environment"], {"image": "a.png"}),
        (["teams", "t", "trajectory"], [{"at": -1, "pose": [0, 0, 0]}]),
        (["events", 0, "kind"], "quake"),
        (["events", 0, "robot"], "r"),
        (["parameters", "planner"], 3),
        (["robot"], {}),
    ],
)
def test_what_is_wrong_is_marked(place, value):
    assert check("scenario", SCENARIO) == []
    changed = copy.deepcopy(SCENARIO)
    inner = changed
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    assert check("scenario", changed)


def test_kinds_of_drives_and_shapes_are_told_apart():
    epuck = yaml.safe_load((config_directory() / "robots" / "epuck.yaml").read_text())
    assert check("robot", epuck) == []
    assert check("robot", {**epuck, "drive": {**epuck["drive"], "kind": "torque"}})
    assert check(
        "robot", {**epuck, "drive": {k: v for k, v in epuck["drive"].items() if k != "kind"}}
    )
    assert check("robot", {**epuck, "bumper": {"kind": "ring", "radius": 0.05}}) == []
    box = yaml.safe_load((config_directory() / "objects" / "box9.yaml").read_text())
    assert check("object", {**box, "shape": {"kind": "rectangle", "length": 1, "width": 1}}) == []
    assert check("object", {**box, "shape": {"length": 1, "width": 1}})
