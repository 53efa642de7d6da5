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
from push_model.drives import Drive, HolonomicDrive, saturate_any_way
from push_model.kinematics import saturate_wheels
from push_model.occupancy import MapSpec
from push_model.settings import bounded, settings
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from sim_bridge.planar.constraints import HOLONOMIC
from sim_bridge.planar.solve import advance
from sim_bridge.planar.tables import grown, make_contacts, make_sums, make_tables
from sim_bridge.world import BodyContacts, BodyPoses, WheelState
from sim_bridge.worlds import Objects, Robots, WorldKind, steps_of

_FEW = 12  # robots that are commanded one by one


@settings
class PlanarSettings:
    """Step and solver of the planar world."""

    time_step: float = bounded(
        5e-3,
        low=1e-4,
        high=2e-2,
        doc="Longest physics step (s). A control tick is a whole number of steps.",
    )
    solver_iterations: int = bounded(
        20,
        low=5,
        high=1000,
        doc="Largest number of iterations over all contacts in one physics step.",
    )
    tolerance: float = bounded(
        1e-3,
        low=0.0,
        high=1.0,
        doc="Change of the contact forces below which the iterations of the planar world end (N).",
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
        self._starts = np.array(
            [start for _, start in [*robots.values(), *objects.values()]], dtype=np.float64
        ).reshape(-1, 3)
        tables = make_tables(environment, robots, objects)
        self._touchable = (*self._all, *tables.fixed)
        self._bodies, self._centres = tables.bodies, tables.centres
        self._off_centre = bool(self._centres.any())
        self._parts, self._near, self._largest = tables.parts, tables.near, tables.largest
        self._contacts, self._sums = make_contacts(tables.room), make_sums(tables.room)
        self._drives = [robot.drive for robot, _ in robots.values()]
        self._limits = np.array([_limits(d) for d in self._drives]).reshape(-1, 2)
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
        """Names of the bodies in the world: robots, then objects."""
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
        """Nothing to do: this world holds no resources."""

    def _forget(self) -> None:
        """Drop the impulses of the previous step and the sums of contacts."""
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
        twists = np.asarray(twists, dtype=np.float64)
        if not np.isfinite(twists).all():
            raise ValueError("commands are not finite")
        b = self._bodies
        if len(robots) <= _FEW:
            for robot, twist in zip(robots, twists.tolist(), strict=True):
                if robot not in self._dead:
                    self._command_one(self._rows[robot], twist, fixed_frame)
            return
        rows = np.array([self._rows[robot] for robot in robots], dtype=np.int64)
        if self._dead:
            alive = np.array([robot not in self._dead for robot in robots], dtype=np.bool_)
            rows, twists = rows[alive], twists[alive]
        any_way = b.kind[rows] == HOLONOMIC
        for mine, saturate in ((~any_way, saturate_wheels), (any_way, saturate_any_way)):
            if mine.any():
                some = rows[mine]
                b.target[some] = saturate(twists[mine], *self._limits[some].T)
        b.own_frame[rows[any_way]] = not fixed_frame

    def _command_one(self, row: int, twist: Sequence[float], fixed_frame: bool) -> None:
        target, drive = self._bodies.target[row], self._drives[row]
        if isinstance(drive, HolonomicDrive):
            target[0], target[1], target[2] = drive.saturate(*twist)
            self._bodies.own_frame[row] = not fixed_frame
        else:
            target[0], target[2] = drive.saturate(twist[0], twist[2])

    def command_torques(self, robot: str, left: float, right: float) -> None:
        """No robot of this world takes torques."""
        raise ValueError(f"{robot}: wheels are not driven by torque in the planar world")

    def wheel_state(self, robot: str) -> WheelState | None:
        """Wheels that hold their speeds have no state of their own."""
        return None

    def step(self, count: int = 1, contacts: bool = True) -> None:
        """Advance by physics steps; contacts of every step are added up until they are read."""
        s, left = self.physics, count
        while left > 0:
            left -= advance(
                left,
                s.time_step,
                s.solver_iterations,
                s.tolerance,
                self._bodies,
                self._parts,
                self._near,
                self._contacts,
                self._sums,
                contacts,
                self._largest,
            )
            if left > 0:  # there was no room for all contacts
                self._contacts = grown(self._contacts)
                self._sums = grown(self._sums)

    def read_contacts(self) -> BodyContacts:
        """Contacts since the last reading, averaged over its steps."""
        sums = self._sums
        rows, steps = int(sums.number[0]), max(1, int(sums.number[1]))
        v = sums.values[:rows]
        places, normals, forces = np.zeros((3, rows, 3))
        places[:, :2] = v[:, 2:4] / v[:, 6:7]
        normals[:, :2] = v[:, 4:6] / np.maximum(np.hypot(v[:, 4], v[:, 5]), 1e-12)[:, None]
        forces[:, :2] = v[:, :2] / steps
        duties, keys = v[:, 7] / steps, sums.keys[:rows].tolist()
        names = self._touchable
        self._clear_sums()
        return BodyContacts(
            [names[key >> 32] for key in keys],
            [names[key & 0xFFFFFFFF] for key in keys],
            *(places, normals, forces, duties),
        )

    def poses(self) -> BodyPoses:
        """Ground truth of every body that is there."""
        table = self._bodies.pose[self._listed]
        if self._off_centre:
            c, s = np.cos(table[:, 2]), np.sin(table[:, 2])
            dx, dy = self._centres[self._listed].T
            table[:, 0] -= c * dx - s * dy
            table[:, 1] -= s * dx + c * dy
        turns = np.round(table[:, 2] / (2.0 * math.pi))
        table[:, 2] -= 2.0 * math.pi * turns
        return BodyPoses(self._names, table)

    def velocity(self, name: str) -> Array:
        """Ground truth twist ``(3,)`` of a body's centre of mass."""
        twist: Array = self._bodies.velocity[self._rows[name]].copy()
        return twist

    def set_velocity(self, name: str, twist: Array) -> None:
        """Overwrite the twist ``(3,)`` of a body's centre of mass; to test the physics itself."""
        self._bodies.velocity[self._rows[name]] = twist

    def kill(self, robot: str) -> None:
        """Stop a robot. From now on it ignores all commands."""
        self.command(robot, 0.0, 0.0)
        self._dead.add(robot)

    def remove(self, name: str) -> None:
        """Take a body out of the world."""
        self._bodies.there[self._rows[name]] = False
        self._dead |= {name} & set(self._robots)
        self._list_bodies()


def _limits(drive: Drive) -> tuple[float, float]:
    """Two limits of a drive, as its saturation takes them: see drives.py and kinematics.py."""
    if isinstance(drive, HolonomicDrive):
        return drive.max_speed, drive.max_turn_rate
    return drive.half_track, drive.max_speed


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
