"""A pushed object as a PyBullet body that stands on soft feet.

A flat bottom in PyBullet has a friction that depends on its orientation. Soft spherical feet on a
circle whose radius equals the torque-to-force ratio of uniform pressure carry equal loads and give
the friction of Coulomb's law in every direction.
"""

import math
from dataclasses import dataclass

import numpy as np
import pybullet as pb

from push_model.arrays import Array
from push_model.limit_surface import uniform_pressure_radius
from push_model.shapes import Shape
from push_model.specs import ObjectSpec
from sim_bridge.collision_groups import BODY_GROUP, FLOOR_GROUP

_CLEARANCE = 0.003  # [m] of the body above the floor
_FOOT_RADIUS = 0.005  # [m]
_HULL_MARGIN = 0.001  # [m] by which PyBullet lets a convex hull stick out


@dataclass(frozen=True)
class Feet:
    """stiffness [N/m] and damping [Ns/m] of each foot."""

    stiffness: float
    damping: float


class ObjectBody:
    """One object in one PyBullet world."""

    def __init__(self, client: int, spec: ObjectSpec, feet: Feet, start: Array) -> None:
        self.spec = spec
        self._client = client
        shape = spec.geometry
        height = spec.height - _CLEARANCE
        hulls = _hulls(client, shape, height)
        n, radius = spec.feet, uniform_pressure_radius(shape)
        angle = (np.arange(n) + 0.5) * 2.0 * math.pi / n
        foot = pb.createCollisionShape(pb.GEOM_SPHERE, radius=_FOOT_RADIUS, physicsClientId=client)
        base = hulls[0] if len(hulls) == 1 else -1
        rest = [] if len(hulls) == 1 else hulls
        links = n + len(rest)
        link_mass = 1e-3 * spec.mass
        z = -height / 2.0 - _CLEARANCE + _FOOT_RADIUS
        positions = [[radius * math.cos(a), radius * math.sin(a), z] for a in angle]
        self._rest_height = height / 2.0 + _CLEARANCE
        self.body = pb.createMultiBody(
            spec.mass - links * link_mass,
            base,
            basePosition=[0.0, 0.0, self._rest_height],
            linkMasses=[link_mass] * links,
            linkCollisionShapeIndices=[foot] * n + rest,
            linkVisualShapeIndices=[-1] * links,
            linkPositions=positions + [[0.0, 0.0, 0.0]] * len(rest),
            linkOrientations=[[0, 0, 0, 1]] * links,
            linkInertialFramePositions=[[0, 0, 0]] * links,
            linkInertialFrameOrientations=[[0, 0, 0, 1]] * links,
            linkParentIndices=[0] * links,
            linkJointTypes=[pb.JOINT_FIXED] * links,
            linkJointAxis=[[0, 0, 1]] * links,
            physicsClientId=client,
        )
        self.side_links = [-1] if len(hulls) == 1 else list(range(n, links))
        self.foot_links = list(range(n))
        inertia = self._base_inertia(shape, links, n, link_mass, radius)
        for link in range(-1, links):
            is_foot = link in self.foot_links
            friction = spec.floor_friction if is_foot else spec.contact_friction
            # Friction and damping in one call leave the friction of a link unset.
            pb.changeDynamics(self.body, link, lateralFriction=friction, physicsClientId=client)
            pb.changeDynamics(
                self.body,
                link,
                linearDamping=0.0,
                angularDamping=0.0,
                restitution=0.0,
                rollingFriction=0.0,
                spinningFriction=0.0,
                physicsClientId=client,
            )
            if is_foot:
                pb.changeDynamics(
                    self.body,
                    link,
                    contactStiffness=feet.stiffness,
                    contactDamping=feet.damping,
                    physicsClientId=client,
                )
                pb.setCollisionFilterGroupMask(
                    self.body, link, BODY_GROUP, FLOOR_GROUP, physicsClientId=client
                )
            applied = pb.getDynamicsInfo(self.body, link, physicsClientId=client)[1]
            if abs(applied - friction) > 1e-9:
                raise RuntimeError(f"friction {friction} was not applied to link {link}: {applied}")
        pb.changeDynamics(self.body, -1, localInertiaDiagonal=inertia, physicsClientId=client)
        self.place(start)

    def _base_inertia(
        self, shape: Shape, links: int, feet: int, link_mass: float, radius: float
    ) -> list[float]:
        m, h = self.spec.mass, self.spec.height
        total = m * shape.inertia_per_mass
        izz = total - feet * link_mass * radius**2
        ixx = max(total / 2.0, 1e-9) + m * h**2 / 12.0
        return [ixx, ixx, max(izz, 0.1 * total)]

    def place(self, pose: Array) -> None:
        """Put the centre of mass at a pose ``(3,)``, at rest."""
        pb.resetBasePositionAndOrientation(
            self.body,
            [float(pose[0]), float(pose[1]), self._rest_height],
            pb.getQuaternionFromEuler([0.0, 0.0, float(pose[2])]),
            physicsClientId=self._client,
        )
        pb.resetBaseVelocity(self.body, [0, 0, 0], [0, 0, 0], physicsClientId=self._client)


def _hulls(client: int, shape: Shape, height: float) -> list[int]:
    """Collision shapes whose union is the extruded outline."""
    if shape.kind == "rectangle":
        size = np.ptp(shape.outline, axis=0) / 2.0
        return [
            pb.createCollisionShape(
                pb.GEOM_BOX, halfExtents=[size[0], size[1], height / 2.0], physicsClientId=client
            )
        ]
    outlines = [shape.outline] if shape.convex else _wedges(shape.outline)
    shapes = []
    for outline in outlines:
        inner = _inset(outline, _HULL_MARGIN)
        half = height / 2.0 - _HULL_MARGIN
        vertices = [[x, y, z] for x, y in inner for z in (-half, half)]
        shapes.append(
            pb.createCollisionShape(pb.GEOM_MESH, vertices=vertices, physicsClientId=client)
        )
    return shapes


def _wedges(outline: Array) -> list[Array]:
    """Convex wedges of a star-shaped outline, merged as long as they stay convex."""
    wedges: list[list[Array]] = []
    n = len(outline)
    current = [np.zeros(2), outline[0]]
    for i in range(1, n + 1):
        trial = [*current, outline[i % n]]
        if len(trial) > 3 and not _convex(np.array(trial)):
            wedges.append(current)
            current = [np.zeros(2), current[-1], outline[i % n]]
        else:
            current = trial
    return [np.array(w) for w in [*wedges, current]]


def _convex(points: Array) -> bool:
    edge = np.roll(points, -1, axis=0) - points
    after = np.roll(edge, -1, axis=0)
    return bool((edge[:, 0] * after[:, 1] - edge[:, 1] * after[:, 0] >= -1e-12).all())


def _inset(outline: Array, distance: float) -> Array:
    """The outline with every edge moved inward."""
    edge = np.roll(outline, -1, axis=0) - outline
    normal = np.column_stack([-edge[:, 1], edge[:, 0]]) / np.hypot(*edge.T)[:, None]
    before = np.roll(normal, 1, axis=0)
    bisector = normal + before
    scale = distance / np.maximum(0.5 * (bisector**2).sum(1), 0.2)
    moved: Array = outline + bisector * scale[:, None]
    return moved
