"""A scenario: environment, robots, objects, teams with goals, events, settings. No ROS here.

Poses of robots are of the axle midpoint, poses of objects and goals of the object's geometric frame
(see ``ObjectSpec``), all in the world frame, in [m, m, rad].
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from push_model.arrays import Array
from push_model.occupancy import MapSpec, OccupancyGrid, rasterise
from push_model.settings import SettingsError, bounded, from_mapping, settings
from push_model.settings_errors import Gathered
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_scenario.bodies import placed, read_groups
from push_scenario.events import Event, check_names
from push_scenario.files import (
    config_directory,
    dump_yaml,
    find,
    parse_yaml,
    read_named,
    read_yaml,
    scenario_names,
)
from push_scenario.lab import LabSettings, check_lab
from push_scenario.map_file import is_map, load_map, map_to_mapping
from push_scenario.poses import PoseValue, to_array, to_value
from push_scenario.room import Room
from push_scenario.start_check import aim_troubles, arrangement_troubles, start_troubles
from push_scenario.teams import (
    Team,
    TeamEntry,
    TimedPose,
    aims_to_mapping,
    check_aims,
    goals_of,
    made_teams,
)

__all__ = [
    "Scenario",
    "ScenarioFile",
    "config_directory",
    "find",
    "load_scenario",
    "read_yaml",
    "scenario_from_mapping",
    "scenario_from_text",
    "scenario_names",
]


@settings
class ScenarioFile:
    """The keys of a scenario file."""

    environment: Any = bounded(doc="A name in config/environments, a path, or the contents")
    robots: dict[str, Any] = bounded(doc="Name to type and start, or to type, count and placement")
    objects: dict[str, Any] = field(default_factory=dict)
    goal: PoseValue | None = bounded(None, doc="Goal [x, y, theta] [m, m, rad] of the first object")
    goals: tuple[PoseValue, ...] = bounded((), doc="Several goals, reached one after another")
    trajectory: tuple[TimedPose, ...] = bounded((), doc="Timed poses instead of goals")
    arrangement: dict[str, PoseValue] = field(default_factory=dict)
    teams: dict[str, TeamEntry] = field(default_factory=dict)
    events: tuple[Event, ...] = bounded((), doc="Events while the scenario runs")
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    on: Literal["sim", "lab"] = bounded(
        "sim", doc="'sim': simulated robots and motion capture; 'lab': those of the section lab"
    )
    lab: LabSettings | None = bounded(None, doc="Drivers of real robots and of motion capture")

    def __post_init__(self) -> None:
        if self.on == "lab" and self.lab is None:
            raise SettingsError("'on: lab' needs the section 'lab' with its drivers")
        if self.on == "lab" and self.events:
            raise SettingsError("events happen in simulation only; remove them for 'on: lab'")
        check_aims(self.goal, self.goals, self.trajectory)
        if self.teams and (self.goal is not None or self.goals or self.trajectory):
            raise SettingsError("with teams, goals belong to the teams, not to the scenario")
        if not self.robots:
            raise SettingsError("robots: at least one robot is needed")


@dataclass(frozen=True)
class Scenario:
    """A scenario with every name resolved and every body placed.

    robots, objects: name to type and start pose ``(3,)``.
    parameters: node name to a mapping of that node's settings.
    goals: poses ``(3,)`` one after another, of a scenario without teams; or trajectory.
    arrangement: goal ``(3,)`` of each object by name, for one robot that moves all of them.
    teams: by name; empty when all robots are one team. events: in the order of time.
    on: "sim" or "lab". lab: drivers of the lab, None where the file has none.
    """

    name: str
    environment: EnvironmentSpec | MapSpec
    robots: dict[str, tuple[RobotSpec, Array]]
    objects: dict[str, tuple[ObjectSpec, Array]]
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    goals: tuple[Array, ...] = ()
    trajectory: tuple[TimedPose, ...] = ()
    arrangement: dict[str, Array] = field(default_factory=dict)
    teams: dict[str, Team] = field(default_factory=dict)
    events: tuple[Event, ...] = ()
    on: str = "sim"
    lab: LabSettings | None = None

    @property
    def goal(self) -> Array | None:
        """The first goal ``(3,)`` of the first team."""
        return self.team().goal

    @property
    def text(self) -> str:
        """The scenario as YAML with every default written out; it needs no other file."""
        values: dict[str, Any] = {
            "environment": map_to_mapping(self.environment)
            if isinstance(self.environment, MapSpec)
            else asdict(self.environment),
            "robots": _bodies_to_mapping(self.robots),
            "objects": _bodies_to_mapping(self.objects),
        }
        if self.teams:
            values["teams"] = {
                team.name: {
                    "robots": list(team.robots),
                    "object": team.object,
                    **aims_to_mapping(team.goals, team.trajectory),
                }
                for team in self.teams.values()
            }
        else:
            values.update(aims_to_mapping(self.goals, self.trajectory))
        if self.arrangement:
            values["arrangement"] = {n: to_value(pose) for n, pose in self.arrangement.items()}
        values["events"] = [asdict(e) for e in self.events]
        values["parameters"] = self.parameters
        if self.lab is not None:
            values |= {"on": self.on, "lab": _plain(asdict(self.lab))}
        return dump_yaml(values)

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

    def team(self, name: str = "") -> Team:
        """A team; the first when no name is given.

        Without teams in the file there is one, unnamed: all robots, the first object, the
        scenario's goals.
        """
        if self.teams:
            name, _ = _pick(name, self.teams, "team")
            return self.teams[name]
        if name:
            raise SettingsError(f"unknown team '{name}'; the scenario has no teams")
        item = next(iter(self.objects), "")
        return Team("", tuple(self.robots), item, self.goals, self.trajectory)

    def settings(self, node: str, **changes: Any) -> "Scenario":
        """The scenario with some settings of a node replaced; a key may be dotted with ``__``.

        Raises
        ------
        SettingsError: a part of a key is not a section but a value.
        """
        values = _copied(self.parameters.get(node, {}))
        for key, value in changes.items():
            *path, last = key.split("__")
            inner = values
            for part in path:
                inner = inner.setdefault(part, {})
                if not isinstance(inner, dict):
                    dotted = ".".join((node, *path, last))
                    raise SettingsError(f"{dotted}: '{part}' has the value {inner!r}, no settings")
            inner[last] = value
        return replace(self, parameters={**self.parameters, node: values})

    def with_defaults(self, nodes: Mapping[str, Mapping[str, Any]]) -> "Scenario":
        """The scenario with the settings of nodes filled in where it is silent.

        Parameters
        ----------
        nodes: node name to all of its settings, e.g. ``asdict`` of its settings class. A bag that
            is recorded with these in its scenario does not change when a default does.
        """
        names = dict.fromkeys((*nodes, *self.parameters))
        parameters = {n: _filled(self.parameters.get(n, {}), nodes.get(n, {})) for n in names}
        return replace(self, parameters={n: v for n, v in parameters.items() if v})

    def check(self, where: str = "scenario") -> None:
        """Refuse a scenario that cannot begin.

        Raises
        ------
        SettingsError: a start pose in a wall, in another body or outside, or a goal in a wall or
            outside; with the names, a line each.
        """
        room = Room(self.environment)
        teams: Iterable[Team] = self.teams.values() or (self.team(),)
        found = start_troubles(self.robots, self.objects, room)
        found += aim_troubles(teams, self.objects, room)
        found += arrangement_troubles(self.arrangement, self.objects, room)
        if found:
            raise SettingsError("\n".join(f"{where}: {trouble}" for trouble in found))


def load_scenario(name: str) -> Scenario:
    """A scenario by name or path.

    Raises
    ------
    SettingsError: names file, key, value and what was expected.
    """
    path = find("scenarios", name)
    return scenario_from_mapping(read_yaml(path), path.stem, str(path), path.parent)


def scenario_from_text(text: str, name: str, where: str) -> Scenario:
    """A scenario from its ``text``, e.g. of a bag; ``where`` names that in errors."""
    return scenario_from_mapping(parse_yaml(text, where), name, where)


def scenario_from_mapping(
    values: Any, name: str, where: str, folder: Path | None = None
) -> Scenario:
    """A scenario from parsed YAML; paths in it start from ``folder``.

    Raises
    ------
    SettingsError: as ``load_scenario``; also what ``Scenario.check`` refuses.
    """
    if not isinstance(values, Mapping):
        raise SettingsError(f"{where}: expected a mapping, got {values!r}")
    needed = ("environment", "robots")
    # YAML 1.1 reads the key ``on`` as the truth value
    named = {"on" if k is True else k: v for k, v in values.items()}
    given = {k: v for k, v in named.items() if v is not None or k in needed}
    file = from_mapping(ScenarioFile, given, where)
    gathered = Gathered()
    with gathered.part():
        environment = _environment(file.environment, f"{where}.environment", folder)
    with gathered.part():
        robots = read_groups(RobotSpec, "robots", file.robots, f"{where}.robots", folder)
    with gathered.part():
        objects = read_groups(ObjectSpec, "objects", file.objects, f"{where}.objects", folder)
    gathered.refuse()
    _refuse_twice(
        [n for g in robots for n in g.names], [n for g in objects for n in g.names], where
    )
    starts = placed(robots, objects, Room(environment))
    groups = {g.key: g.names for g in robots} | {n: (n,) for g in robots for n in g.names}
    names = tuple(n for g in objects for n in g.names)
    unknown = [n for n in file.arrangement if n not in names]
    if unknown:
        raise SettingsError(f"{where}.arrangement: unknown objects {unknown}; known: {list(names)}")
    check_names(file.events, {n for g in robots for n in g.names}, set(names), f"{where}.events")
    scenario = Scenario(
        name=name,
        environment=environment,
        robots={n: (g.spec, starts[n]) for g in robots for n in g.names},
        objects={n: (g.spec, starts[n]) for g in objects for n in g.names},
        parameters=_copied(file.parameters),
        goals=goals_of(file.goal, file.goals),
        trajectory=file.trajectory,
        arrangement={n: to_array(pose) for n, pose in file.arrangement.items()},
        teams=made_teams(file.teams, groups, names, f"{where}.teams"),
        events=tuple(sorted(file.events, key=lambda e: e.at)),
        on=file.on,
        lab=file.lab,
    )
    if file.lab is not None:
        check_lab(file.lab, tuple(scenario.robots), tuple(scenario.objects), f"{where}.lab")
    scenario.check(where)
    return scenario


def _environment(value: Any, where: str, folder: Path | None) -> EnvironmentSpec | MapSpec:
    value, where, folder = read_named("environments", value, where, folder)
    if is_map(value):
        return load_map(value, where, folder)
    return from_mapping(EnvironmentSpec, value, where)


def _refuse_twice(robots: list[str], objects: list[str], where: str) -> None:
    twice = sorted(set(robots) & set(objects))
    if twice:
        raise SettingsError(f"{where}: {twice} name both a robot and an object")
    for names in (robots, objects):
        again = sorted(n for n, count in Counter(names).items() if count > 1)
        if again:
            raise SettingsError(f"{where}: {again} are named twice, by a group and on their own")


def _bodies_to_mapping(bodies: Mapping[str, tuple[Any, Array]]) -> dict[str, Any]:
    written: dict[Any, dict[str, Any]] = {}  # a type that many share is written once
    for spec, _ in bodies.values():
        if spec not in written:
            written[spec] = asdict(spec)
    return {n: {"type": written[s], "start": to_value(p)} for n, (s, p) in bodies.items()}


def _plain(value: Any) -> Any:
    """Lists instead of tuples, as YAML has them."""
    if isinstance(value, Mapping):
        return {k: _plain(v) for k, v in value.items()}
    return [_plain(v) for v in value] if isinstance(value, (list, tuple)) else value


def _pick(name: str, known: Mapping[str, Any], kind: str) -> tuple[str, Any]:
    name = name or next(iter(known), "")
    if name not in known:
        raise SettingsError(f"unknown {kind} '{name}'; the scenario has: {', '.join(known)}")
    return name, known[name]


def _copied(values: Mapping[str, Any]) -> dict[str, Any]:
    return {k: _copied(v) if isinstance(v, Mapping) else v for k, v in values.items()}


def _filled(values: Mapping[str, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
    result = _copied(values)
    for key, default in defaults.items():
        if isinstance(default, Mapping):
            result[key] = _filled(result.get(key) or {}, default)
        else:
            result.setdefault(key, default)
    return result
