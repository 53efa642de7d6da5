"""The robots and objects of a scenario file: their types, and where they start."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from push_model.arrays import Array
from push_model.settings import SettingsError, bounded, from_mapping, settings
from push_model.settings_errors import Gathered
from push_model.specs import ObjectSpec, RobotSpec
from push_scenario.files import find, read_named, read_yaml
from push_scenario.placements import Placement
from push_scenario.poses import PoseValue, to_array
from push_scenario.room import Room, object_footprint, robot_footprint

T = TypeVar("T", RobotSpec, ObjectSpec)
_ORIGIN = np.zeros(3)


@settings
class BodyEntry:
    """One body with a start, or a group of bodies with a count and a placement.

    Further keys replace those of the type. ``drive`` and ``bumper`` are merged key by key, unless
    their kind changes.
    """

    type: Any = bounded(doc="Name of a type in config/, a path, or the type itself")
    start: PoseValue | None = bounded(
        None, doc="Start pose [x, y, theta] [m, m, rad] in the world frame"
    )
    count: int | None = bounded(
        None,
        low=1,
        high=10000,
        doc="Number of bodies of a group; they are called name1, name2, ...",
    )
    placement: Placement | None = bounded(None, doc="Where the bodies of a group start")

    def __post_init__(self) -> None:
        if self.start is None and self.count is None and self.placement is None:
            raise SettingsError("missing key 'start' ([x, y, theta]), or 'count' and 'placement'")
        if self.start is None and (self.count is None or self.placement is None):
            raise SettingsError("a group needs both 'count' and 'placement'")
        if self.start is not None and (self.count is not None or self.placement is not None):
            raise SettingsError("either 'start' or 'count' and 'placement', not both")


@dataclass(frozen=True)
class Group(Generic[T]):
    """The bodies of one entry of a file: their names and their type."""

    key: str
    names: tuple[str, ...]
    spec: T
    entry: BodyEntry
    where: str


def read_groups(
    cls: type[T], kind: str, values: Mapping[str, Any], where: str, folder: Path | None
) -> list[Group[T]]:
    """The entries of ``robots`` or ``objects``.

    Parameters
    ----------
    cls: of their types. kind: folder of config/ that has them. values: names with entries.

    Raises
    ------
    SettingsError: names file, key, value and what was expected.
    """
    groups: list[Group[T]] = []
    gathered = Gathered()
    for name, entry in values.items():
        with gathered.part():
            groups.append(_group(cls, kind, name, entry, f"{where}.{name}", folder))
    gathered.refuse()
    return groups


def _group(
    cls: type[T], kind: str, name: str, values: Any, where: str, folder: Path | None
) -> Group[T]:
    if not (name.isascii() and name.isidentifier()):
        raise SettingsError(f"{where}: a name must be letters, digits and underscores")
    if not isinstance(values, Mapping):
        raise SettingsError(f"{where}: expected a mapping, got {values!r}")
    own = {f.name for f in fields(BodyEntry)}
    changes = {k: v for k, v in values.items() if k not in own}
    gathered = Gathered()
    with gathered.part():
        entry = from_mapping(BodyEntry, {k: v for k, v in values.items() if k in own}, where)
    with gathered.part():
        spec, source, _ = read_named(kind, values.get("type", {}), f"{where}.type", folder)
    gathered.refuse()
    if not isinstance(spec, Mapping):
        raise SettingsError(f"{source}: expected a name or a mapping, got {spec!r}")
    made = from_mapping(cls, _changed(spec, changes), where if changes else source)
    count = entry.count
    names = (name,) if count is None else tuple(f"{name}{i + 1}" for i in range(count))
    return Group(name, names, made, entry, where)


def load_object(name: str) -> ObjectSpec:
    """An object type by its name in config/objects or a path; raises SettingsError."""
    path = find("objects", name)
    return from_mapping(ObjectSpec, read_yaml(path), str(path))


def load_robot(name: str) -> RobotSpec:
    """A robot type by its name in config/robots or a path; raises SettingsError."""
    path = find("robots", name)
    return from_mapping(RobotSpec, read_yaml(path), str(path))


def placed(
    robots: list[Group[RobotSpec]], objects: list[Group[ObjectSpec]], room: Room
) -> dict[str, Array]:
    """Start pose ``(3,)`` of every body. Groups are placed in the order of the file."""
    starts: dict[str, Array] = {}
    circles: list[tuple[float, float, float]] = []
    waiting: list[tuple[Group[Any], float]] = []
    sized: list[tuple[Group[Any], float]] = []
    sized += [(g, robot_footprint("", g.spec, _ORIGIN).radius) for g in robots]
    sized += [(g, object_footprint("", g.spec, _ORIGIN).radius) for g in objects]
    for group, radius in sized:
        if group.entry.start is None:
            waiting.append((group, radius))
        else:
            starts[group.key] = to_array(group.entry.start)
            circles.append((*group.entry.start[:2], radius))
    for group, radius in waiting:
        assert group.entry.placement is not None
        taken = np.array(circles, dtype=np.float64).reshape(-1, 3)
        try:
            poses = group.entry.placement.poses(len(group.names), radius, room, taken)
        except SettingsError as error:
            raise SettingsError(f"{group.where}.placement: {error}") from None
        starts.update(zip(group.names, poses, strict=True))
        circles += [(float(x), float(y), radius) for x, y, _ in poses]
    return starts


def _changed(spec: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    result = dict(spec)
    for key, value in changes.items():
        before = spec.get(key)
        nested = isinstance(before, Mapping) and isinstance(value, Mapping) and key != "shape"
        if nested and value.get("kind", before.get("kind")) == before.get("kind"):  # type: ignore[union-attr]
            value = {**before, **value}  # type: ignore[dict-item]
        result[key] = value
    return result
