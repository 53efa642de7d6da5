"""The PyBullet world: floor, walls, obstacles, objects on soft feet, robots.

One world is one PyBullet connection and belongs to one thread.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pybullet as pb

from push_model.arrays import Array
from push_model.drives import HolonomicDrive, SpeedDrive, TorqueDrive
from push_model.occupancy import MapSpec
from push_model.settings import SettingsError
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from sim_bridge.contact_sums import ContactSums
from sim_bridge.disc_fleet import DiscFleet
from sim_bridge.object_body import Feet, ObjectBody
from sim_bridge.robot_body import RobotBody
from sim_bridge.robot_surface import robot_surface
from sim_bridge.settings import PhysicsSettings
from sim_bridge.speed_body import SpeedBody
from sim_bridge.torque_body import TorqueBody
from sim_bridge.walls import Walls
from sim_bridge.world import BodyContacts, BodyPoses, WheelState
from sim_bridge.worlds import Objects, Robots, WorldKind, steps_of

_AWAY = 1000.0  # [m] where removed bodies are kept
_AWAY_GAP = 5.0  # [m] between them


def _wheeled(client: int, spec: RobotSpec, start: Array, surface: float) -> RobotBody:
    """The body of a robot with wheels, by its drive. surface: see ``robot_surface``."""
    if isinstance(spec.drive, SpeedDrive):
        return SpeedBody(client, spec, spec.drive, start, surface)
    if isinstance(spec.drive, TorqueDrive):
        return TorqueBody(client, spec, spec.drive, start, surface)
    raise SettingsError(f"PyBullet has no body for the drive '{spec.drive.kind}'")


class PyBulletWorld:
    """A running simulation. Close it, or use it as a context manager."""

    def __init__(
        self,
        environment: EnvironmentSpec | MapSpec,
        robots: Mapping[str, tuple[RobotSpec, Array]],
        objects: Mapping[str, tuple[ObjectSpec, Array]],
        physics: PhysicsSettings | None = None,
    ) -> None:
        """Build the world; robots and objects map a name to what it is and its start pose (3,)."""
        self.physics = physics or PhysicsSettings()
        self._client = pb.connect(pb.DIRECT)
        if self._client < 0:
            raise RuntimeError("PyBullet gave no connection; too many worlds are open")
        client = self._client
        self._starts = {name: start for name, (_, start) in {**robots, **objects}.items()}
        pb.setGravity(0.0, 0.0, -9.81, physicsClientId=client)
        pb.setPhysicsEngineParameter(
            fixedTimeStep=self.physics.time_step,
            numSolverIterations=self.physics.solver_iterations,
            contactBreakingThreshold=0.001,
            deterministicOverlappingPairs=1,
            physicsClientId=client,  # enableConeFriction=1 would switch the cone off
        )
        surface = robot_surface([robot for robot, _ in robots.values()])
        walls = Walls(client, environment, surface)
        self._wheeled: dict[str, RobotBody] = {}
        discs: dict[str, tuple[RobotSpec, HolonomicDrive, Array]] = {}
        for name, (robot, start) in robots.items():
            if isinstance(robot.drive, HolonomicDrive):
                discs[name] = (robot, robot.drive, start)
            else:
                self._wheeled[name] = _wheeled(client, robot, start, surface)
        self._discs = DiscFleet(client, discs, self.physics.time_step, surface)
        self._disc_rows = {name: row for row, name in enumerate(self._discs.names)}
        feet = Feet(self.physics.foot_stiffness, self.physics.foot_damping)
        self._objects = {
            name: ObjectBody(client, item, feet, start, surface)
            for name, (item, start) in objects.items()
        }
        self._robots = tuple(robots)
        self._ids = {
            **{n: b.body for n, b in self._wheeled.items()},
            **dict(zip(self._discs.names, self._discs.bodies, strict=True)),
            **{n: b.body for n, b in self._objects.items()},
        }
        self._contact_names = {**walls.names, **{body: n for n, body in self._ids.items()}}
        self._contacts = ContactSums(client, walls.floor, frozenset(self._ids.values()))
        self._dead: set[str] = set()
        self._removed: set[str] = set()
        self._list_bodies()

    def _list_bodies(self) -> None:
        """List the bodies: names, PyBullet ids, centres of mass in the frames of their poses."""
        everybody = (*self._robots, *self._objects)
        self._names = tuple(n for n in everybody if n not in self._removed)
        self._listed = [self._ids[n] for n in self._names]
        bodies: dict[str, RobotBody | ObjectBody] = {**self._wheeled, **self._objects}
        self._centres = np.array(
            [bodies[n].centre if n in bodies else (0.0, 0.0) for n in self._names]
        ).reshape(-1, 2)

    def __enter__(self) -> "PyBulletWorld":
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

    def close(self) -> None:
        """End the PyBullet connection; safe to call twice."""
        if self._client >= 0:
            pb.disconnect(physicsClientId=self._client)
            self._client = -1

    def reset(self) -> None:
        """Put every body back to its start, at rest; also those killed and removed."""
        self._dead.clear()
        self._removed.clear()
        self._list_bodies()
        for name, start in self._starts.items():
            self._put(name, start)
        self._contacts.clear()

    def command(self, robot: str, v: float, omega: float) -> None:
        """Set a robot's twist [m/s, rad/s] in its own frame; it holds until the next command.

        Raises
        ------
        ValueError: not finite; PyBullet cannot recover from a NaN.
        """
        if not (math.isfinite(v) and math.isfinite(omega)):
            raise ValueError(f"command to {robot} is not finite: v={v}, omega={omega}")
        if robot in self._wheeled and robot not in self._dead:
            self._wheeled[robot].command(v, omega)
        elif robot not in self._dead:
            self.command_all([robot], np.array([[v, 0.0, omega]]))

    def command_all(self, robots: Sequence[str], twists: Array, fixed_frame: bool = False) -> None:
        """Set the twists ``(n, 3)`` of several robots, in their own frames or in the world's.

        Only robots that move in any direction heed the second column, and the world's frame.
        """
        if not np.isfinite(twists).all():
            raise ValueError("commands are not finite")
        rows, places = [], []
        for i, robot in enumerate(robots):
            row = self._disc_rows.get(robot)
            if row is None:
                self.command(robot, float(twists[i, 0]), float(twists[i, 2]))
            elif robot not in self._dead:
                rows.append(row)
                places.append(i)
        if rows:
            self._discs.command(np.array(rows), twists[places], fixed_frame)

    def command_torques(self, robot: str, left: float, right: float) -> None:
        """Set the torques [Nm] of a robot's wheels; they hold until the next command."""
        if not (math.isfinite(left) and math.isfinite(right)):
            raise ValueError(f"torques to {robot} are not finite: {left}, {right}")
        if robot not in self._wheeled:
            raise ValueError(f"{robot} has no wheels to be driven by torques")
        if robot not in self._dead:
            self._wheeled[robot].command_torques(left, right)

    def wheel_state(self, robot: str) -> WheelState | None:
        """State of a robot's wheels; None if it has none."""
        return self._wheeled[robot].wheel_state() if robot in self._wheeled else None

    def step(self, count: int = 1, contacts: bool = True) -> None:
        """Advance by physics steps; contacts of every step are added up until they are read."""
        client = self._client
        driven = [body for body in self._wheeled.values() if isinstance(body, TorqueBody)]
        discs = self._discs if self._discs.names else None
        if discs is not None:
            positions, headings = self._frames(discs.bodies)
            discs.begin(positions, headings)
        for _ in range(count):
            for body in driven:
                body.before_step()
            if discs is not None:
                discs.before_step()
            pb.stepSimulation(physicsClientId=client)
            if contacts:
                self._contacts.add()

    def read_contacts(self) -> BodyContacts:
        """Contacts since the last reading, averaged over its steps."""
        return BodyContacts.of(self._contacts.read(self._contact_names))

    def _frames(self, bodies: Sequence[int]) -> tuple[Array, Array]:
        """Positions ``(n, 3)`` of centres of mass and headings ``(n,)``."""
        if not bodies:
            return np.zeros((0, 3)), np.zeros(0)
        client = self._client
        raw = [pb.getBasePositionAndOrientation(b, physicsClientId=client) for b in bodies]
        x, y, z, w = np.array([q for _, q in raw]).T
        sines, cosines = 2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)
        # math's arc tangent: numpy's depends on the processor in its last bit
        headings = np.array(list(map(math.atan2, sines.tolist(), cosines.tolist())))
        return np.array([p for p, _ in raw]), headings

    def poses(self) -> BodyPoses:
        """Ground truth of every body that is there."""
        positions, headings = self._frames(self._listed)
        c, s = np.cos(headings), np.sin(headings)
        dx, dy = self._centres.T
        table = np.column_stack(
            [
                positions[:, 0] - (c * dx - s * dy),
                positions[:, 1] - (s * dx + c * dy),
                headings,
            ]
        )
        return BodyPoses(self._names, table)

    def velocity(self, name: str) -> Array:
        """Ground truth twist ``(3,)`` of a body's centre of mass."""
        linear, angular = pb.getBaseVelocity(self._ids[name], physicsClientId=self._client)
        return np.array([linear[0], linear[1], angular[2]])

    def set_velocity(self, name: str, twist: Array) -> None:
        """Overwrite the twist ``(3,)`` of a body's centre of mass; to test the physics itself."""
        pb.resetBaseVelocity(
            self._ids[name],
            [float(twist[0]), float(twist[1]), 0.0],
            [0.0, 0.0, float(twist[2])],
            physicsClientId=self._client,
        )

    def place(self, name: str, pose: Array) -> None:
        """Put a body somewhere else, at rest: a disturbance."""
        if not np.isfinite(pose).all():
            raise ValueError(f"{name} cannot be put at {pose}")
        if name in self._removed:
            raise ValueError(f"{name} has been removed from the world")
        self._put(name, pose)

    def _put(self, name: str, pose: Array) -> None:
        row = self._disc_rows.get(name)
        if row is not None:
            self._discs.place(row, pose)
        elif name in self._wheeled:
            self._wheeled[name].place(pose)
        else:
            self._objects[name].place(pose)

    def kill(self, robot: str) -> None:
        """Stop a robot. From now on it ignores all commands."""
        self.command(robot, 0.0, 0.0)
        self._dead.add(robot)

    def remove(self, name: str) -> None:
        """Remove a body: it is put far outside and no longer reported."""
        if name in self._removed:
            return
        self._removed.add(name)
        self._put(name, np.array([_AWAY + _AWAY_GAP * len(self._removed), _AWAY, 0.0]))
        self._dead |= {name} & set(self._robots)
        self._list_bodies()


def _make(
    environment: EnvironmentSpec | MapSpec,
    robots: Robots,
    objects: Objects,
    physics: PhysicsSettings,
    tick: float,
) -> PyBulletWorld:
    step = tick / steps_of(tick, physics.time_step)
    return PyBulletWorld(environment, robots, objects, replace(physics, time_step=step))


KIND = WorldKind(PhysicsSettings, _make)
