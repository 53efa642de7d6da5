"""JSON schemas of scenario, robot, object and environment files, for editors that complete YAML.

A file names its schema in its first line, ``# yaml-language-server: $schema=<path>``.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_scenario.bodies import BodyEntry
from push_scenario.map_file import MapFile
from push_scenario.scenario import ScenarioFile

DIALECT = "https://json-schema.org/draft/2020-12/schema"
_NESTED = ("drive", "bumper")  # a scenario may replace single keys of these


def schemas() -> dict[str, dict[str, Any]]:
    """A schema for each kind of file: ``scenario``, ``robot``, ``object``, ``environment``."""
    kinds: dict[str, Any] = {
        "scenario": ScenarioFile,
        "robot": RobotSpec,
        "object": ObjectSpec,
        "environment": EnvironmentSpec | MapFile,
    }
    made = {kind: _strict(TypeAdapter(cls).json_schema()) for kind, cls in kinds.items()}
    scenario, definitions = made["scenario"], made["scenario"]["$defs"]
    for kind in ("robot", "object", "environment"):
        own = dict(made[kind])
        definitions.update(own.pop("$defs", {}))
        definitions[kind] = own
    properties = scenario["properties"]
    properties["environment"] |= _named("environment")
    for kind in ("robot", "object"):
        entry = _strict(TypeAdapter(BodyEntry).json_schema())
        definitions.update(entry.pop("$defs"))
        changes = dict(definitions[kind]["properties"])
        changes |= {k: {"type": "object"} for k in _NESTED if k in changes}
        entry["properties"] = {**changes, **entry["properties"]}
        entry["properties"]["type"] |= _named(kind)
        properties[f"{kind}s"] |= {"additionalProperties": entry}
    properties["parameters"] |= {"additionalProperties": {"type": "object"}}
    return {kind: {"$schema": DIALECT, **schema} for kind, schema in made.items()}


def write_schemas(folder: Path) -> list[Path]:
    """Write ``<kind>.json`` into a folder; returns the paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for kind, schema in schemas().items():
        path = folder / f"{kind}.json"
        path.write_text(json.dumps(schema, indent=1) + "\n", encoding="utf-8")
        paths.append(path)
    return paths


def _named(kind: str) -> dict[str, Any]:
    """A name, a path, or the contents."""
    return {"anyOf": [{"type": "string"}, {"$ref": f"#/$defs/{kind}"}]}


def _strict(value: Any) -> Any:
    """The schema with ``kind`` required where it selects the member of a union."""
    if isinstance(value, list):
        return [_strict(v) for v in value]
    if not isinstance(value, Mapping):
        return value
    result = {k: _strict(v) for k, v in value.items() if k != "discriminator"}
    if "discriminator" in value:
        result["oneOf"] = [{**member, "required": ["kind"]} for member in result["oneOf"]]
    return result
