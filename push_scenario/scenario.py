"""Scenario files: environment, robots, objects, goal, settings; by path or name. No ROS here."""

import importlib.util
import math
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from push_model.arrays import Array
from push_model.occupancy import MapSpec, OccupancyGrid, rasterise
from push_model.settings import SettingsError, from_mapping
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_scenario.map_file import is_map, load_map, map_to_mapping

NODES = ("bridge", "planner", "controller", "supervisor")
"""Nodes that a scenario may have parameters for."""


@dataclass(frozen=True)
class Scenario:
    """parameters: node name to a mapping of that node's settings; goal ``(3,)``."""

    name: str
    environment: EnvironmentSpec | MapSpec
    robots: dict[str, tuple[RobotSpec, Array]]
    objects: dict[str, tuple[ObjectSpec, Array]]
    goal: Array | None
    parameters: dict[str, dict[str, Any]]

    @property
    def text(self) -> str:
        """The scenario as YAML that needs no other file."""
        environment = (
            map_to_mapping(self.environment)
            if isinstance(self.environment, MapSpec)
            else asdict(self.environment)
        )
        values = {
            "environment": environment,
            "robots": _bodies_to_mapping(self.robots),
            "objects": _bodies_to_mapping(self.objects),
            "goal": None if self.goal is None else self.goal.tolist(),
            "parameters": self.parameters,
        }
        return yaml.safe_dump(values, sort_keys=False)

    @property
    def grid(self) -> OccupancyGrid:
        """Occupancy grid of the environment."""
        return rasterise(self.environment)

    @property
    def radii(self) -> dict[str, float]:
        """[m] of the circle about a robot's axle midpoint, or an object's centre, that holds it."""
        robots = {name: spec.footprint_radius for name, (spec, _) in self.robots.items()}
        items = {name: spec.geometry.circumradius for name, (spec, _) in self.objects.items()}
        return robots | items

    def robot(self, name: str = "") -> tuple[str, RobotSpec]:
        """Name and type of a robot; of the first when no name is given."""
        return _pick(name, {k: v[0] for k, v in self.robots.items()}, "robot")

    def object(self, name: str = "") -> tuple[str, ObjectSpec]:
        """Name and type of an object; of the first when no name is given."""
        return _pick(name, {k: v[0] for k, v in self.objects.items()}, "object")

    def settings(self, node: str, **changes: Any) -> "Scenario":
        """The scenario with some settings of a node replaced; a key may be dotted with ``__``."""
        values = {
            k: (dict(v) if isinstance(v, Mapping) else v)
            for k, v in self.parameters.get(node, {}).items()
        }
        for key, value in changes.items():
            *path, last = key.split("__")
            inner = values
            for part in path:
                inner = inner.setdefault(part, {})
            inner[last] = value
        return replace(self, parameters={**self.parameters, node: values})


def _bodies_to_mapping(bodies: Mapping[str, tuple[Any, Array]]) -> dict[str, Any]:
    return {
        name: {"type": asdict(spec), "start": start.tolist()}
        for name, (spec, start) in bodies.items()
    }


def _pick(name: str, known: Mapping[str, Any], kind: str) -> tuple[str, Any]:
    name = name or next(iter(known), "")
    if name not in known:
        raise SettingsError(f"unknown {kind} '{name}'; the scenario has: {', '.join(known)}")
    return name, known[name]


def config_directory() -> Path:
    """Folder of the files in config/; PLANAR_PUSH_CONFIG names another one."""
    override = os.environ.get("PLANAR_PUSH_CONFIG")
    if override:
        return Path(override)
    beside = Path(__file__).resolve().parent.parent / "config"
    if beside.is_dir():
        return beside
    spec = importlib.util.find_spec("push_config")
    if spec is not None and spec.submodule_search_locations:
        return Path(next(iter(spec.submodule_search_locations)))
    raise SettingsError("no config folder found; set PLANAR_PUSH_CONFIG")


def read_yaml(path: Path) -> Any:
    """The contents of a YAML file; errors name the file."""
    try:
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SettingsError(f"{path}: cannot be read: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise SettingsError(f"{path}: not valid YAML: {error}") from None


def find(kind: str, name: str) -> Path:
    """The file of a name in config/<kind>/, or the path that the name is."""
    path = Path(name)
    if path.suffix in (".yaml", ".yml"):
        return path
    candidate = config_directory() / kind / f"{name}.yaml"
    if not candidate.is_file():
        known = sorted(p.stem for p in candidate.parent.glob("*.yaml"))
        raise SettingsError(f"no {kind} called '{name}'; known: {', '.join(known)}")
    return candidate


def scenario_names() -> list[str]:
    """Names in config/scenarios."""
    return sorted(p.stem for p in (config_directory() / "scenarios").glob("*.yaml"))


def load_scenario(name: str) -> Scenario:
    """A scenario by name or path.

    Raises
    ------
    SettingsError: names file, key, value and what was expected.
    """
    path = find("scenarios", name)
    return scenario_from_mapping(read_yaml(path), path.stem, str(path), path.parent)


def scenario_from_mapping(
    values: Any, name: str, where: str, folder: Path | None = None
) -> Scenario:
    """A scenario from parsed YAML."""
    keys = {"environment", "robots", "objects", "goal", "parameters"}
    if not isinstance(values, Mapping):
        raise SettingsError(f"{where}: expected a mapping, got {values!r}")
    for key in values:
        if key not in keys:
            raise SettingsError(
                f"{where}: unknown key '{key}'; expected one of: {', '.join(sorted(keys))}"
            )
    for key in ("environment", "robots"):
        if key not in values:
            raise SettingsError(f"{where}: missing key '{key}'")
    environment = _environment(values["environment"], f"{where}.environment", folder)
    robots = _bodies(RobotSpec, "robots", values["robots"], f"{where}.robots", folder)
    objects = _bodies(
        ObjectSpec, "objects", values.get("objects") or {}, f"{where}.objects", folder
    )
    if not robots:
        raise SettingsError(f"{where}.robots: at least one robot is needed")
    twice = set(robots) & set(objects)
    if twice:
        raise SettingsError(f"{where}: {sorted(twice)} name both a robot and an object")
    goal = values.get("goal")
    parameters = values.get("parameters") or {}
    if not isinstance(parameters, Mapping) or not all(
        isinstance(v, Mapping) for v in parameters.values()
    ):
        raise SettingsError(f"{where}.parameters: expected node names with mappings")
    for node in parameters:
        if node not in NODES:
            raise SettingsError(
                f"{where}.parameters: unknown node '{node}'; expected one of: {', '.join(NODES)}"
            )
    return Scenario(
        name,
        environment,
        robots,
        objects,
        None if goal is None else _pose(goal, f"{where}.goal"),
        {str(k): dict(v) for k, v in parameters.items()},
    )


def _read(kind: str, value: Any, where: str, folder: Path | None) -> tuple[Any, str, Path | None]:
    """The YAML that a value names or is, where it stands, and the folder of paths in it."""
    if not isinstance(value, str):
        return value, where, folder
    path = Path(value)
    if path.suffix not in (".yaml", ".yml"):
        path = find(kind, value)
    elif not path.is_absolute() and folder is not None:
        path = folder / path
    return read_yaml(path), str(path), path.parent


def _environment(value: Any, where: str, folder: Path | None) -> EnvironmentSpec | MapSpec:
    value, where, folder = _read("environments", value, where, folder)
    if is_map(value):
        return load_map(value, where, folder)
    return from_mapping(EnvironmentSpec, value, where)


def _bodies(
    cls: type[Any], kind: str, values: Any, where: str, folder: Path | None
) -> dict[str, tuple[Any, Array]]:
    if not isinstance(values, Mapping):
        raise SettingsError(f"{where}: expected names with mappings, got {values!r}")
    result = {}
    for name, entry in values.items():
        here = f"{where}.{name}"
        if not (str(name).isascii() and str(name).isidentifier()):
            raise SettingsError(f"{here}: a name must be letters, digits and underscores")
        if not isinstance(entry, Mapping) or not {"type", "start"} <= set(entry):
            raise SettingsError(f"{here}: expected keys 'type' and 'start', got {entry!r}")
        overrides = {k: v for k, v in entry.items() if k not in ("type", "start")}
        spec, source, _ = _read(kind, entry["type"], f"{here}.type", folder)
        if not isinstance(spec, Mapping):
            raise SettingsError(f"{source}: expected a name or a mapping, got {spec!r}")
        result[str(name)] = (
            from_mapping(cls, {**spec, **overrides}, here if overrides else source),
            _pose(entry["start"], f"{here}.start"),
        )
    return result


def _pose(value: Any, where: str) -> Array:
    if (
        not isinstance(value, (list, tuple))
        or len(value) != 3
        or not all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in value)
        or not all(math.isfinite(v) for v in value)
    ):
        raise SettingsError(f"{where}: expected [x, y, theta] in m and rad, got {value!r}")
    return np.array(value, dtype=np.float64)
