"""A pushed object as a PyBullet body that stands on soft feet.

A flat bottom in PyBullet has a friction that depends on its orientation. Soft spherical feet on a
circle about the centre of mass, whose radius equals the torque-to-force ratio of uniform pressure,
carry equal loads and give the friction of Coulomb's law in every direction.
"""

import math
from dataclasses import dataclass

import numpy as np
import pybullet as pb

from push_model.arrays import Array
from push_model.convex_parts import convex_parts
from push_model.limit_surface import GRAVITY
from push_model.outlines import inset
from push_model.specs import ObjectSpec
from sim_bridge.collision_groups import OBJECT, SUPPORT, set_group

_CLEARANCE = 0.003  # [m] of the body above the floor
_FOOT_RADIUS = 0.005  # [m]
_SINKING = 5e-4  # [m] that feet give way under the object's weight, at most
_HULL_MARGIN = 0.001  # [m] by which PyBullet lets a convex hull stick out


@dataclass(frozen=True)
class Feet:
    """stiffness [N/m] and damping [Ns/m] of each foot."""

    stiffness: float
    damping: float

    def under(self, spec: ObjectSpec) -> "Feet":
        """Stiffer ones where the object is so heavy that it would sink by more than half a
        millimetre."""
        sinking = spec.mass * GRAVITY / (spec.feet * self.stiffness)
        factor = max(1.0, sinking / _SINKING)
        return Feet(factor * self.stiffness, factor * self.damping)


class ObjectBody:
    """One object in one PyBullet world. The frame of its base is at the centre of mass."""

    def __init__(
        self, client: int, spec: ObjectSpec, feet: Feet, start: Array, robot_surface: float = 1.0
    ) -> None:
        """start ``(3,)`` pose; robot_surface: see ``robot_surface``."""
        self.spec = spec
        self._client = client
        self.centre = spec.com
        """[m] The centre of mass in the frame that poses are of, the geometric one."""
        height = spec.height - _CLEARANCE
        hulls = _hulls(client, spec, height)
        n, radius = spec.feet, spec.pressure_radius
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
        feet = feet.under(spec)
        inertia = self._base_inertia(n, link_mass, radius)
        for link in range(-1, links):
            is_foot = 0 <= link < n
            friction = spec.floor_friction if is_foot else spec.contact_friction / robot_surface
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
            set_group(client, self.body, link, SUPPORT if is_foot else OBJECT)
            applied = pb.getDynamicsInfo(self.body, link, physicsClientId=client)[1]
            if abs(applied - friction) > 1e-9:
                raise RuntimeError(f"friction {friction} was not applied to link {link}: {applied}")
        pb.changeDynamics(self.body, -1, localInertiaDiagonal=inertia, physicsClientId=client)
        self.place(start)

    def _base_inertia(self, feet: int, link_mass: float, radius: float) -> list[float]:
        m, h, total = self.spec.mass, self.spec.height, self.spec.moment
        izz = total - feet * link_mass * radius**2
        ixx = max(total / 2.0, 1e-9) + m * h**2 / 12.0
        return [ixx, ixx, max(izz, 0.1 * total)]

    def place(self, pose: Array) -> None:
        """Put the geometric frame at a pose ``(3,)``, at rest."""
        x, y, theta = (float(v) for v in self.spec.mass_pose(pose))
        pb.resetBasePositionAndOrientation(
            self.body,
            [x, y, self._rest_height],
            pb.getQuaternionFromEuler([0.0, 0.0, theta]),
            physicsClientId=self._client,
        )
        pb.resetBaseVelocity(self.body, [0, 0, 0], [0, 0, 0], physicsClientId=self._client)


def _hulls(client: int, spec: ObjectSpec, height: float) -> list[int]:
    """Collision shapes whose union is the extruded outline, about the centre of mass."""
    shape = spec.geometry
    if shape.kind == "rectangle":
        size = np.ptp(shape.outline, axis=0) / 2.0
        return [
            pb.createCollisionShape(
                pb.GEOM_BOX,
                halfExtents=[size[0], size[1], height / 2.0],
                collisionFramePosition=[-spec.com[0], -spec.com[1], 0.0],
                physicsClientId=client,
            )
        ]
    inner = inset(shape.outline, _HULL_MARGIN)
    half = height / 2.0 - _HULL_MARGIN
    return [
        pb.createCollisionShape(
            pb.GEOM_MESH,
            vertices=[[x, y, z] for x, y in part for z in (-half, half)],
            physicsClientId=client,
        )
        for part in ([inner] if shape.convex else convex_parts(inner))
    ]
