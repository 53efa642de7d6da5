"""The PyBullet world: floor, walls, obstacles, objects on soft feet, wheeled robots.

One world is one PyBullet connection and belongs to one thread.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pybullet as pb

from push_model import se2
from push_model.arrays import Array
from push_model.occupancy import MapSpec
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from sim_bridge.collision_groups import BODY_GROUP, FLOOR_GROUP
from sim_bridge.object_body import Feet, ObjectBody
from sim_bridge.robot_body import BODY, RobotBody
from sim_bridge.settings import PhysicsSettings


@dataclass(frozen=True)
class Contact:
    """A contact between two named bodies, averaged over physics steps.

    position ``(3,)`` [m], normal ``(3,)`` from b to a, force ``(3,)`` [N] on a; world frame.
    duty: fraction of the steps in which the two touched.
    """

    body_a: str
    body_b: str
    position: Array
    normal: Array
    force: Array
    duty: float


class World:
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
        self._starts = {name: start for name, (_, start) in {**robots, **objects}.items()}
        self._names: dict[int, str] = {}
        pb.setGravity(0.0, 0.0, -9.81, physicsClientId=self._client)
        pb.setPhysicsEngineParameter(
            fixedTimeStep=self.physics.time_step,
            numSolverIterations=self.physics.solver_iterations,
            contactBreakingThreshold=0.001,
            deterministicOverlappingPairs=1,
            physicsClientId=self._client,  # enableConeFriction=1 would switch the cone off
        )
        self._build_environment(environment)
        self.robots: dict[str, RobotBody] = {}
        self.objects: dict[str, ObjectBody] = {}
        for name, (robot, start) in robots.items():
            self.robots[name] = RobotBody(self._client, robot, start)
            self._names[self.robots[name].body] = name
        feet = Feet(self.physics.foot_stiffness, self.physics.foot_damping)
        for name, (item, start) in objects.items():
            self.objects[name] = ObjectBody(self._client, item, feet, start)
            self._names[self.objects[name].body] = name
        self._bodies: dict[str, RobotBody | ObjectBody] = {**self.robots, **self.objects}
        self._clear_contacts()

    def __enter__(self) -> "World":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the PyBullet connection; safe to call twice."""
        if self._client >= 0:
            pb.disconnect(physicsClientId=self._client)
            self._client = -1

    def _static(self, shape: int, x: float, y: float, z: float, yaw: float, mu: float) -> int:
        body: int = pb.createMultiBody(
            0.0,
            shape,
            basePosition=[x, y, z],
            baseOrientation=pb.getQuaternionFromEuler([0.0, 0.0, yaw]),
            physicsClientId=self._client,
        )
        pb.changeDynamics(
            body, -1, lateralFriction=mu, restitution=0.0, physicsClientId=self._client
        )
        return body

    def _build_environment(self, environment: EnvironmentSpec | MapSpec) -> None:
        plane = pb.createCollisionShape(pb.GEOM_PLANE, physicsClientId=self._client)
        self._floor = self._static(plane, 0.0, 0.0, 0.0, 0.0, 1.0)
        pb.setCollisionFilterGroupMask(
            self._floor, -1, FLOOR_GROUP, BODY_GROUP, physicsClientId=self._client
        )
        self._names[self._floor] = "floor"
        if isinstance(environment, MapSpec):
            x0, x1, y0, y1 = environment.grid.rectangles().T
            boxes = np.column_stack([x0 + x1, y0 + y1, 2 * (x1 - x0), 2 * (y1 - y0), 0 * x0]) / 2
            self._build_boxes([tuple(b) for b in boxes], environment)
        else:
            self._build_arena(environment)

    def _build_boxes(
        self,
        boxes: Sequence[tuple[float, ...]],
        environment: EnvironmentSpec | MapSpec,
    ) -> None:
        """Boxes of x, y, length, width, yaw, as high as walls are."""
        h, mu = environment.wall_height, environment.wall_friction
        for i, (x, y, length, width, yaw) in enumerate(boxes):
            shape = pb.createCollisionShape(
                pb.GEOM_BOX,
                halfExtents=[length / 2.0, width / 2.0, h / 2.0],
                physicsClientId=self._client,
            )
            self._names[self._static(shape, x, y, h / 2.0, yaw, mu)] = f"wall{i}"

    def _build_arena(self, environment: EnvironmentSpec) -> None:
        h, mu = environment.wall_height, environment.wall_friction
        sx, sy = environment.size
        thick = 0.1
        walls = [
            (0.0, (sy + thick) / 2.0, sx + 2 * thick, thick, 0.0),
            (0.0, -(sy + thick) / 2.0, sx + 2 * thick, thick, 0.0),
            ((sx + thick) / 2.0, 0.0, thick, sy, 0.0),
            (-(sx + thick) / 2.0, 0.0, thick, sy, 0.0),
        ]
        self._build_boxes(
            walls + [(*b.centre, *b.size, b.yaw) for b in environment.boxes], environment
        )
        for i, circle in enumerate(environment.circles):
            shape = pb.createCollisionShape(
                pb.GEOM_CYLINDER, radius=circle.radius, height=h, physicsClientId=self._client
            )
            body = self._static(shape, *circle.centre, h / 2.0, 0.0, mu)
            self._names[body] = f"circle{i}"
        for i, polygon in enumerate(environment.polygons):
            vertices = [[x, y, z] for x, y in polygon.vertices for z in (0.0, h)]
            shape = pb.createCollisionShape(
                pb.GEOM_MESH, vertices=vertices, physicsClientId=self._client
            )
            self._names[self._static(shape, 0.0, 0.0, 0.0, 0.0, mu)] = f"polygon{i}"

    def reset(self) -> None:
        """Put every body back to its start, at rest."""
        for name, body in self._bodies.items():
            body.place(self._starts[name])
        self._clear_contacts()

    def command(self, robot: str, v: float, omega: float) -> None:
        """Set a robot's twist [m/s, rad/s]; it holds until the next command.

        Raises
        ------
        ValueError: not finite; PyBullet cannot recover from a NaN.
        """
        if not (math.isfinite(v) and math.isfinite(omega)):
            raise ValueError(f"command to {robot} is not finite: v={v}, omega={omega}")
        self.robots[robot].command(v, omega)

    def step(self, count: int = 1, contacts: bool = True) -> None:
        """Advance by physics steps; contacts of every step are added up until they are read."""
        client = self._client
        if not contacts:
            for _ in range(count):
                pb.stepSimulation(physicsClientId=client)
            return
        tracked = [(b.body, link) for b in self.objects.values() for link in b.side_links]
        tracked += [(r.body, BODY) for r in self.robots.values()]
        bodies = {body for body, _ in tracked}
        for _ in range(count):
            pb.stepSimulation(physicsClientId=client)
            self._steps += 1
            for body, link in tracked:
                for point in pb.getContactPoints(
                    bodyA=body, linkIndexA=link, physicsClientId=client
                ):
                    # PyBullet lists a pair of tracked bodies twice, once from each side.
                    if point[9] > 0.0 and not (point[2] in bodies and body > point[2]):
                        self._add_contact(point)

    def _clear_contacts(self) -> None:
        self._steps = 0
        self._touching: dict[tuple[int, int], tuple[list[float], set[int]]] = {}

    def _add_contact(self, point: tuple) -> None:  # type: ignore[type-arg]
        a, b, normal, load = point[1], point[2], point[7], point[9]
        if b == self._floor:
            return
        sums, steps = self._touching.setdefault((a, b), ([0.0] * 9, set()))
        t1, d1, t2, d2 = point[10], point[11], point[12], point[13]
        for i in range(3):
            sums[i] += load * normal[i] + t1 * d1[i] + t2 * d2[i]
            sums[3 + i] += load * point[5][i]
            sums[6 + i] += load * normal[i]
        steps.add(self._steps)

    def read_contacts(self) -> list[Contact]:
        """Contacts since the last reading, averaged over its steps."""
        result = []
        for (a, b), (sums, steps) in self._touching.items():
            values = np.array(sums)
            load = float(np.linalg.norm(values[6:9]))
            total = max(load, 1e-12)
            result.append(
                Contact(
                    self._names[a],
                    self._names[b],
                    values[3:6] / total,
                    values[6:9] / total,
                    values[:3] / self._steps,
                    len(steps) / self._steps,
                )
            )
        self._clear_contacts()
        return result

    def poses(self) -> dict[str, Array]:
        """Ground truth: every robot's and object's pose ``(3,)``."""
        result = {}
        for name, body in self._bodies.items():
            (x, y, _), q = pb.getBasePositionAndOrientation(body.body, physicsClientId=self._client)
            result[name] = np.array([x, y, se2.yaw_from_quaternion(*q)])
        return result

    def velocity(self, name: str) -> Array:
        """Ground truth twist ``(3,)`` of a body's centre of mass."""
        body = self._bodies[name].body
        linear, angular = pb.getBaseVelocity(body, physicsClientId=self._client)
        return np.array([linear[0], linear[1], angular[2]])

    def set_velocity(self, name: str, twist: Array) -> None:
        """Overwrite a body's planar velocity ``(3,)``; for experiments on the physics itself."""
        body = self._bodies[name].body
        pb.resetBaseVelocity(
            body,
            [float(twist[0]), float(twist[1]), 0.0],
            [0.0, 0.0, float(twist[2])],
            physicsClientId=self._client,
        )
