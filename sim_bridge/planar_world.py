"""The planar world: the same bodies as PyBullet's, seen from above, compiled and many times faster.

Objects stand under their limit surface, contacts are Coulomb's, walls and obstacles stand. What it
leaves out is the third dimension: wheels carry their robot's weight in equal parts whatever presses
on it, and nothing tips. ``bench physics`` holds both worlds against the same laws.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.bumpers import RingBumper
from push_model.drives import HolonomicDrive, SpeedDrive
from push_model.limit_surface import GRAVITY
from push_model.occupancy import MapSpec
from push_model.settings import SettingsError, bounded, settings
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from sim_bridge.planar.collide import Neighbours, Parts
from sim_bridge.planar.shapes import Buckets, Part, PartTable, body_parts, fixed_parts
from sim_bridge.planar.solve import (
    HOLONOMIC,
    OBJECT,
    WHEELS,
    Bodies,
    Contacts,
    Sums,
    advance,
)
from sim_bridge.world import BodyPoses, Contact, WheelState
from sim_bridge.worlds import Objects, Robots, WorldKind, steps_of

_ROBOT_FRICTION = 1.0  # as PyBullet's robots: that of a contact is what they touch
_LARGE = 2.5  # times the median radius: parts that all others are held against
_CONTACTS = 8  # a part at most, on average
_LEVER = 2.0 / 3.0  # of its radius at which a disc's traction turns it


@settings
class PlanarSettings:
    """Step and solver of the planar world."""

    time_step: float = bounded(
        2e-3, low=1e-4, high=2e-2, doc="[s] longest physics step; a tick is a whole number of them"
    )
    solver_iterations: int = bounded(60, low=5, high=1000, doc="turns of every contact at most")
    tolerance: float = bounded(
        1e-3, low=0.0, high=1.0, doc="[N] change of a force below which turns end"
    )


class PlanarWorld:
    """A running simulation. Usable as a context manager, as the other worlds are."""

    def __init__(
        self,
        environment: EnvironmentSpec | MapSpec,
        robots: Mapping[str, tuple[RobotSpec, Array]],
        objects: Mapping[str, tuple[ObjectSpec, Array]],
        physics: PlanarSettings | None = None,
    ) -> None:
        """Build the world; robots and objects map a name to what it is and its start pose (3,).

        Raises
        ------
        SettingsError: a robot is driven by torques, which needs wheels that can spin.
        """
        self.physics = physics or PlanarSettings()
        self._all = (*robots, *objects)
        self._rows = {name: i for i, name in enumerate(self._all)}
        self._robots = tuple(robots)
        self._specs: dict[str, RobotSpec] = {n: spec for n, (spec, _) in robots.items()}
        self._starts = np.array(
            [start for _, start in [*robots.values(), *objects.values()]], dtype=np.float64
        ).reshape(-1, 3)
        parts: list[tuple[int, Part]] = []
        rows = []
        for i, (name, (robot, _)) in enumerate(robots.items()):
            parts += [(i, part) for part in _robot_parts(robot)]
            rows.append(_robot_row(name, robot))
        for i, (item, _) in enumerate(objects.values(), len(robots)):
            outline = item.geometry.outline
            parts += [(i, part) for part in body_parts(outline, item.contact_friction)]
            surface = item.limit_surface()
            floor = (surface.max_force, surface.max_torque)
            rows.append((OBJECT, item.mass, item.moment, floor, (0.0, 0.0), (0.0, 0.0), item.com))
        fixed = fixed_parts(environment)
        self._fixed_names = [name for name, _ in fixed]
        self._bodies = _bodies(rows)
        self._centres = np.array([row[6] for row in rows], dtype=np.float64).reshape(-1, 2)
        self._parts, self._near = _tables(parts, [part for _, part in fixed])
        most = _CONTACTS * (len(parts) + 8)
        self._contacts = _contacts(most)
        self._sums = _sums(most)
        self._limits = {n: r.drive for n, (r, _) in robots.items()}
        self._dead: set[str] = set()
        self.reset()

    def __enter__(self) -> "PlanarWorld":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def time_step(self) -> float:
        """[s] of a physics step."""
        return self.physics.time_step

    @property
    def names(self) -> tuple[str, ...]:
        """Bodies that are there: robots, then objects."""
        return self._names

    def _list_bodies(self) -> None:
        there = self._bodies.there
        self._names = tuple(n for n in self._all if there[self._rows[n]])
        self._listed = np.flatnonzero(there)

    def reset(self) -> None:
        """Put every body back to its start, at rest; also those killed and removed."""
        self._dead.clear()
        self._bodies.there[:] = True
        self._list_bodies()
        for name, start in zip(self._all, self._starts, strict=True):
            self._put(self._rows[name], start)
        self._forget()

    def close(self) -> None:
        """Nothing is held."""

    def _forget(self) -> None:
        """No contact has an impulse from before, and nothing has been added up."""
        self._contacts.number[0] = 0
        self._contacts.table[:] = -1
        self._clear_sums()

    def _clear_sums(self) -> None:
        self._sums.number[:] = 0
        self._sums.table[:] = -1

    def _put(self, row: int, pose: Array) -> None:
        b = self._bodies
        x, y = se2.transform(pose, self._centres[row][None])[0]
        b.pose[row] = x, y, pose[2]
        b.velocity[row] = b.target[row] = 0.0
        b.given[row] = 0.0

    def place(self, name: str, pose: Array) -> None:
        """Put a body somewhere else, at rest: a disturbance."""
        if not np.isfinite(pose).all():
            raise ValueError(f"{name} cannot be put at {pose}")
        row = self._rows[name]
        if not self._bodies.there[row]:
            raise ValueError(f"{name} has been removed from the world")
        self._put(row, pose)

    def command(self, robot: str, v: float, omega: float) -> None:
        """Set a robot's twist [m/s, rad/s] in its own frame; it holds until the next command.

        Raises
        ------
        ValueError: not finite.
        """
        self.command_all([robot], np.array([[v, 0.0, omega]]))

    def command_all(self, robots: Sequence[str], twists: Array, fixed_frame: bool = False) -> None:
        """Set the twists ``(n, 3)`` of several robots, in their own frames or in the world's.

        Only robots that move in any direction heed the second column, and the world's frame.
        """
        if not np.isfinite(twists).all():
            raise ValueError("commands are not finite")
        b = self._bodies
        for robot, (vx, vy, omega) in zip(robots, np.asarray(twists).tolist(), strict=True):
            if robot in self._dead:
                continue
            row, drive = self._rows[robot], self._limits[robot]
            if isinstance(drive, HolonomicDrive):
                b.target[row] = drive.saturate(vx, vy, omega)
                b.own_frame[row] = not fixed_frame
            else:
                v, turn = drive.saturate(vx, omega)
                b.target[row] = v, 0.0, turn

    def command_torques(self, robot: str, left: float, right: float) -> None:
        """No robot of this world takes torques."""
        raise ValueError(f"{robot}: wheels are not driven by torque in the planar world")

    def wheel_state(self, robot: str) -> WheelState | None:
        """Wheels that hold their speeds have no state of their own."""
        return None

    def step(self, count: int = 1, contacts: bool = True) -> None:
        """Advance by physics steps; contacts of every step are added up until they are read."""
        s = self.physics
        advance(
            count,
            s.time_step,
            s.solver_iterations,
            s.tolerance,
            self._bodies,
            self._parts,
            self._near,
            self._contacts,
            self._sums,
            contacts,
        )

    def read_contacts(self) -> list[Contact]:
        """Contacts since the last reading, averaged over its steps."""
        sums, bodies = self._sums, len(self._all)
        rows, steps = int(sums.number[0]), int(sums.number[1])
        found = []
        for key, v in zip(sums.keys[:rows].tolist(), sums.values[:rows], strict=True):
            a, other = key >> 32, key & 0xFFFFFFFF
            name = self._all[other] if other < bodies else self._fixed_names[other - bodies]
            push = math.hypot(v[4], v[5])
            found.append(
                Contact(
                    self._all[a],
                    name,
                    np.array([v[2] / v[6], v[3] / v[6], 0.0]),
                    np.array([v[4], v[5], 0.0]) / max(push, 1e-12),
                    np.array([v[0], v[1], 0.0]) / steps,
                    float(v[7]) / steps,
                )
            )
        self._clear_sums()
        return found

    def poses(self) -> BodyPoses:
        """Ground truth of every body that is there."""
        pose = self._bodies.pose[self._listed]
        c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
        dx, dy = self._centres[self._listed].T
        heading = np.array([se2.wrap(a) for a in pose[:, 2].tolist()])
        table = np.column_stack(
            [pose[:, 0] - (c * dx - s * dy), pose[:, 1] - (s * dx + c * dy), heading]
        )
        return BodyPoses(self._names, table)

    def velocity(self, name: str) -> Array:
        """Ground truth twist ``(3,)`` of a body's centre of mass."""
        twist: Array = self._bodies.velocity[self._rows[name]].copy()
        return twist

    def set_velocity(self, name: str, twist: Array) -> None:
        """Overwrite the twist ``(3,)`` of a body's centre of mass; to test the physics itself."""
        self._bodies.velocity[self._rows[name]] = twist

    def kill(self, robot: str) -> None:
        """From now on the robot obeys no command; it stands where it is."""
        self.command(robot, 0.0, 0.0)
        self._dead.add(robot)

    def remove(self, name: str) -> None:
        """Take a body out of the world."""
        self._bodies.there[self._rows[name]] = False
        self._dead |= {name} & set(self._robots)
        self._list_bodies()


_Row = tuple[
    int, float, float, tuple[float, float], tuple[float, float], tuple[float, float], object
]


def _robot_parts(spec: RobotSpec) -> list[Part]:
    """A disc, or the outline of a flat bumper's robot; about its centre of mass."""
    centre = np.array([-spec.com_ahead, 0.0])
    if isinstance(spec.bumper, RingBumper):
        return [Part.disc(centre, spec.footprint_radius, _ROBOT_FRICTION)]
    return body_parts(spec.outline + centre, _ROBOT_FRICTION)


def _robot_row(name: str, spec: RobotSpec) -> _Row:
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


def _bodies(rows: Sequence[_Row]) -> Bodies:
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


def _tables(parts: Sequence[tuple[int, Part]], fixed: Sequence[Part]) -> tuple[Parts, Neighbours]:
    moving = len(parts)
    table = PartTable.of([*parts, *((-1, part) for part in fixed)])
    buckets = Buckets.of(PartTable.of([(-1, part) for part in fixed]))
    radius = table.radius[:moving]
    limit = _LARGE * float(np.median(radius)) if moving else 0.0
    small = np.flatnonzero(radius <= limit)
    size = float(radius[small].max()) if len(small) else 1.0
    bits = max(4, math.ceil(math.log2(max(1, 2 * moving))))
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


def _contacts(most: int) -> Contacts:
    return Contacts(
        np.zeros((most, 5), dtype=np.int64),
        np.zeros((most, 6)),
        np.zeros((most, 2)),
        np.zeros((most, 6)),
        np.zeros(most, dtype=np.int64),
        np.zeros(most, dtype=np.int64),
        np.zeros((most, 2)),
        np.zeros(1, dtype=np.int64),
        _table(most),
    )


def _sums(most: int) -> Sums:
    return Sums(
        np.zeros(most, dtype=np.int64),
        np.zeros((most, 8)),
        np.zeros(most, dtype=np.int64),
        np.zeros(2, dtype=np.int64),
        _table(most),
    )


def _make(
    environment: EnvironmentSpec | MapSpec,
    robots: Robots,
    objects: Objects,
    physics: PlanarSettings,
    tick: float,
) -> PlanarWorld:
    step = tick / steps_of(tick, physics.time_step)
    return PlanarWorld(environment, robots, objects, replace(physics, time_step=step))


KIND = WorldKind(PlanarSettings, _make)
