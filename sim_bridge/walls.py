"""Floor, walls and obstacles of an environment as PyBullet bodies."""

from collections.abc import Sequence

import numpy as np
import pybullet as pb

from push_model.occupancy import MapSpec
from push_model.specs import EnvironmentSpec
from sim_bridge.collision_groups import FLOOR, OBJECT_WALL, ROBOT_WALL, WALL, set_group

_THICKNESS = 0.1  # [m] of the walls about an arena


class Walls:
    """The bodies that never move.

    floor: PyBullet id of the floor.
    names: PyBullet id to name, of the floor too.
    """

    def __init__(
        self, client: int, environment: EnvironmentSpec | MapSpec, robot_surface: float = 1.0
    ) -> None:
        """robot_surface: see ``robot_surface``."""
        self._client, self._surface = client, robot_surface
        self._height, self._friction = environment.wall_height, environment.wall_friction
        self.names: dict[int, str] = {}
        plane = pb.createCollisionShape(pb.GEOM_PLANE, physicsClientId=client)
        self.floor = self._static("floor", plane, 0.0, 0.0, 0.0, 0.0, 1.0)
        set_group(client, self.floor, -1, FLOOR)
        if isinstance(environment, MapSpec):
            x0, x1, y0, y1 = environment.grid.rectangles().T
            boxes = np.column_stack([x0 + x1, y0 + y1, 2 * (x1 - x0), 2 * (y1 - y0), 0 * x0]) / 2
            self._build_boxes([tuple(b) for b in boxes])
        else:
            self._build_arena(environment)

    def _static(
        self, name: str, shape: int, x: float, y: float, z: float, yaw: float, mu: float
    ) -> int:
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
        self.names[body] = name
        return body

    def _wall(self, name: str, shape: int, x: float, y: float, z: float, yaw: float) -> None:
        copies = {WALL: 1.0}
        if self._surface != 1.0:
            copies = {ROBOT_WALL: 1.0 / self._surface, OBJECT_WALL: self._surface}
        for group, factor in copies.items():
            body = self._static(name, shape, x, y, z, yaw, factor * self._friction)
            set_group(self._client, body, -1, group)

    def _build_boxes(self, boxes: Sequence[tuple[float, ...]]) -> None:
        """Boxes of x, y, length, width, yaw, as high as walls are."""
        h = self._height
        for i, (x, y, length, width, yaw) in enumerate(boxes):
            shape = pb.createCollisionShape(
                pb.GEOM_BOX,
                halfExtents=[length / 2.0, width / 2.0, h / 2.0],
                physicsClientId=self._client,
            )
            self._wall(f"wall{i}", shape, x, y, h / 2.0, yaw)

    def _build_arena(self, environment: EnvironmentSpec) -> None:
        h, thick = self._height, _THICKNESS
        sx, sy = environment.size
        walls = [
            (0.0, (sy + thick) / 2.0, sx + 2 * thick, thick, 0.0),
            (0.0, -(sy + thick) / 2.0, sx + 2 * thick, thick, 0.0),
            ((sx + thick) / 2.0, 0.0, thick, sy, 0.0),
            (-(sx + thick) / 2.0, 0.0, thick, sy, 0.0),
        ]
        self._build_boxes(walls + [(*b.centre, *b.size, b.yaw) for b in environment.boxes])
        for i, circle in enumerate(environment.circles):
            shape = pb.createCollisionShape(
                pb.GEOM_CYLINDER, radius=circle.radius, height=h, physicsClientId=self._client
            )
            self._wall(f"circle{i}", shape, *circle.centre, h / 2.0, 0.0)
        for i, polygon in enumerate(environment.polygons):
            vertices = [[x, y, z] for x, y in polygon.vertices for z in (0.0, h)]
            shape = pb.createCollisionShape(
                pb.GEOM_MESH, vertices=vertices, physicsClientId=self._client
            )
            self._wall(f"polygon{i}", shape, 0.0, 0.0, 0.0, 0.0)
