"""Arrays of a planar world from what robots, objects and walls are."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from push_model.arrays import Array
from push_model.bumpers import RingBumper
from push_model.drives import HolonomicDrive, SpeedDrive
from push_model.limit_surface import GRAVITY
from push_model.occupancy import MapSpec
from push_model.settings import SettingsError
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from sim_bridge.planar.collide import Neighbours, Parts
from sim_bridge.planar.constraints import HOLONOMIC, OBJECT, WHEELS, Bodies
from sim_bridge.planar.memory import Contacts, Sums, rehash
from sim_bridge.planar.shapes import Buckets, Part, PartTable, body_parts, fixed_parts

_ROBOT_FRICTION = 1.0  # as PyBullet's robots: that of a contact is what they touch
_LARGE = 2.5  # times the median radius: parts that all others are held against
_CONTACTS = 8  # a part, for which there is room at first
_LEVER = 2.0 / 3.0  # of its radius at which a disc's traction turns it

Table = TypeVar("Table", Contacts, Sums)
Row = tuple[
    int, float, float, tuple[float, float], tuple[float, float], tuple[float, float], object
]


def robot_parts(spec: RobotSpec) -> list[Part]:
    """A disc, or the outline of a flat bumper's robot; about its centre of mass."""
    centre = np.array([-spec.com_ahead, 0.0])
    if isinstance(spec.bumper, RingBumper):
        parts = [Part.disc(centre, spec.footprint_radius, _ROBOT_FRICTION)]
    else:
        parts = body_parts(spec.outline + centre, _ROBOT_FRICTION)
    return [replace(part, robot_friction=spec.robot_friction) for part in parts]


def robot_row(name: str, spec: RobotSpec) -> Row:
    """Kind, mass, inertia, floor, what its drive can do, wheels, centre of mass."""
    inertia = spec.inertia
    if inertia is None:
        inertia = 0.5 * spec.mass * spec.body_radius**2
    com = (spec.com_ahead, 0.0)
    drive = spec.drive
    if isinstance(drive, HolonomicDrive):
        spin = drive.max_force * _LEVER * spec.footprint_radius
        return HOLONOMIC, spec.mass, inertia, (0.0, 0.0), (drive.max_force, spin), (0.0, 0.0), com
    if isinstance(drive, SpeedDrive):
        load = 0.5 * spec.mass * GRAVITY
        most = (drive.wheel_friction * load, drive.wheel_torque / drive.wheel_radius)
        track = (drive.half_track, spec.com_ahead)
        return WHEELS, spec.mass, inertia, (0.0, 0.0), most, track, com
    raise SettingsError(
        f"{name}: the planar world has no wheels that are driven by torque; use bridge.world: "
        "pybullet"
    )


def make_bodies(rows: Sequence[Row]) -> Bodies:
    """All at rest in the origin."""
    n = len(rows)
    mass = np.array([row[1:3] for row in rows], dtype=np.float64).reshape(-1, 2)
    return Bodies(
        np.zeros((n, 3)),
        np.zeros((n, 3)),
        1.0 / mass,
        np.array([row[0] for row in rows], dtype=np.int64),
        np.ones(n, dtype=np.bool_),
        np.array([row[3] for row in rows], dtype=np.float64).reshape(-1, 2),
        np.zeros((n, 3)),
        np.ones(n, dtype=np.bool_),
        np.array([row[4] for row in rows], dtype=np.float64).reshape(-1, 2),
        np.array([row[5] for row in rows], dtype=np.float64).reshape(-1, 2),
        np.zeros((n, 4)),
    )


def make_parts(
    parts: Sequence[tuple[int, Part]], fixed: Sequence[Part]
) -> tuple[Parts, Neighbours]:
    """Moving parts with their bodies, and those that stand."""
    moving = len(parts)
    table = PartTable.of([*parts, *((-1, part) for part in fixed)])
    buckets = Buckets.of(PartTable.of([(-1, part) for part in fixed]))
    radius = table.radius[:moving]
    limit = _LARGE * float(np.median(radius)) if moving else 0.0
    small = np.flatnonzero(radius <= limit)
    size = float(radius[small].max()) if len(small) else 1.0
    bits = max(4, math.ceil(math.log2(max(1, 8 * moving))))
    return (
        Parts(
            moving,
            table.body,
            table.first,
            table.count,
            table.local,
            table.radius,
            table.friction,
            table.vertices,
            table.local.copy(),
            table.vertices.copy(),
            np.flatnonzero(radius > limit),
            small,
        ),
        Neighbours(
            np.full(1 << bits, -1, dtype=np.int64),
            np.full(max(1, moving), -1, dtype=np.int64),
            np.zeros((max(1, moving), 2), dtype=np.int64),
            2.0 * size + 2e-3,
            buckets.low,
            buckets.size,
            buckets.start,
            buckets.items,
            buckets.box,
            buckets.spacing,
            np.full(max(1, len(fixed)), -1, dtype=np.int64),
        ),
    )


def _table(rows: int) -> Array:
    """Empty, hashed, for so many rows."""
    return np.full(1 << math.ceil(math.log2(4 * rows)), -1, dtype=np.int64)


def make_contacts(most: int) -> Contacts:
    """None yet, room for so many."""
    return Contacts(
        np.zeros((most, 5), dtype=np.int64),
        np.zeros((most, 6)),
        np.zeros((most, 2)),
        np.zeros((most, 10)),
        np.zeros(most, dtype=np.int64),
        np.zeros(most, dtype=np.int64),
        np.zeros((most, 2)),
        np.zeros(1, dtype=np.int64),
        _table(most),
    )


def make_sums(most: int) -> Sums:
    """None yet, room for so many pairs."""
    return Sums(
        np.zeros(most, dtype=np.int64),
        np.zeros((most, 8)),
        np.zeros(most, dtype=np.int64),
        np.zeros(2, dtype=np.int64),
        _table(most),
    )


def grown(table: Table) -> Table:
    """Contacts or sums with twice the room, and all that is in them."""
    if isinstance(table, Contacts):
        larger: Table = make_contacts(2 * len(table.keys))
    else:
        larger = make_sums(2 * len(table.keys))
    for name, old, new in zip(table._fields, table, larger, strict=True):
        if name != "table":
            new[: len(old)] = old
    rehash(larger.old if isinstance(larger, Contacts) else larger.keys, larger.number, larger.table)
    return larger


def object_row(item: ObjectSpec) -> Row:
    """Kind, mass, inertia, floor, no drive, no wheels, centre of mass."""
    surface = item.limit_surface()
    floor = (surface.max_force, surface.max_torque)
    return OBJECT, item.mass, item.moment, floor, (0.0, 0.0), (0.0, 0.0), item.com


@dataclass(frozen=True)
class Tables:
    """A planar world at rest in the origin.

    bodies: robots, then objects; centres ``(n, 2)`` [m]: of mass, in their frames. fixed: names of
    walls and obstacles. largest: [m] radius of the largest moving part. room: rows of contacts that
    are enough at first.
    """

    bodies: Bodies
    parts: Parts
    near: Neighbours
    centres: Array
    fixed: tuple[str, ...]
    largest: float
    room: int


def make_tables(
    environment: EnvironmentSpec | MapSpec,
    robots: Mapping[str, tuple[RobotSpec, Array]],
    objects: Mapping[str, tuple[ObjectSpec, Array]],
) -> Tables:
    """The tables of what robots, objects and walls are; robots and objects as ``PlanarWorld`` has
    them.

    Raises
    ------
    SettingsError: a robot is driven by torques, which needs wheels that can spin.
    """
    parts: list[tuple[int, Part]] = []
    rows = []
    for i, (name, (robot, _)) in enumerate(robots.items()):
        parts += [(i, part) for part in robot_parts(robot)]
        rows.append(robot_row(name, robot))
    for i, (item, _) in enumerate(objects.values(), len(robots)):
        parts += [(i, part) for part in body_parts(item.geometry.outline, item.contact_friction)]
        rows.append(object_row(item))
    fixed = fixed_parts(environment)
    table, near = make_parts(parts, [part for _, part in fixed])
    return Tables(
        make_bodies(rows),
        table,
        near,
        np.array([row[6] for row in rows], dtype=np.float64).reshape(-1, 2),
        tuple(name for name, _ in fixed),
        float(table.radius[: len(parts)].max(initial=0.0)),
        _CONTACTS * (len(parts) + 8),
    )
