"""A differential-drive robot as a PyBullet body."""

import tempfile
from pathlib import Path

import pybullet as pb

from push_model.arrays import Array
from push_model.drives import SpeedDrive
from push_model.settings import SettingsError
from push_model.specs import RobotSpec
from sim_bridge.collision_groups import BODY_GROUP, FLOOR_GROUP

WHEELS = (0, 1)
"""Link and joint indices of the left and the right wheel."""
BODY = -1


def robot_urdf(spec: RobotSpec) -> str:
    """URDF text: body with bumper, two spherical wheels, two frictionless casters.

    Wheels are spheres because PyBullet's cylinders are polygons by default and cost 4 % in
    distance; they touch nothing but the floor.
    """
    drive = _speed_drive(spec)
    body_mass = spec.mass - 2.0 * drive.wheel_mass
    h, r, wr = spec.body_height, spec.body_radius, drive.wheel_radius
    ixx = body_mass * (3.0 * r**2 + h**2) / 12.0
    izz = body_mass * r**2 / 2.0
    b = spec.flat_bumper
    thickness = min(0.005, b.distance / 4.0)
    body_z = h / 2.0 - wr + 0.005  # the body's underside clears the floor by 5 mm
    bumper_z = spec.bumper_z - wr
    collisions = (
        _collision(f'<cylinder radius="{r}" length="{h - 0.005}"/>', 0.0, body_z)
        + _collision(
            f'<box size="{thickness} {b.width} {b.height}"/>',
            b.distance - thickness / 2.0,
            bumper_z,
        )
        + _collision(  # the arm that carries the bumper
            f'<box size="{b.distance - thickness} {min(b.width, 2 * r) * 0.5} {b.height * 0.5}"/>',
            (b.distance - thickness) / 2.0,
            bumper_z,
        )
    )
    text = '<robot name="robot">' + _link("body", body_mass, ixx, ixx, izz, collisions, -0.005)
    roll = drive.wheel_mass * wr**2 / 2.0
    for name, side in (("left", 1.0), ("right", -1.0)):
        text += _link(
            name, drive.wheel_mass, roll, roll, roll, _collision(f'<sphere radius="{wr}"/>', 0, 0)
        )
        text += (
            f'<joint name="{name}_axle" type="continuous"><parent link="body"/>'
            f'<child link="{name}"/><origin xyz="0 {side * drive.half_track} 0"/>'
            '<axis xyz="0 1 0"/></joint>'
        )
    caster = 0.2 * wr
    for name, x in zip(("front", "rear"), spec.casters or (), strict=True):
        text += _link(
            name, 1e-4, 1e-8, 1e-8, 1e-8, _collision(f'<sphere radius="{caster}"/>', 0, 0)
        )
        z = -wr + caster + spec.caster_clearance
        text += (
            f'<joint name="{name}_caster" type="fixed"><parent link="body"/>'
            f'<child link="{name}"/><origin xyz="{x} 0 {z}"/></joint>'
        )
    return text + "</robot>"


def _speed_drive(spec: RobotSpec) -> SpeedDrive:
    if not isinstance(spec.drive, SpeedDrive):
        raise SettingsError(f"no body in simulation yet for a drive '{spec.drive.kind}'")
    return spec.drive


def _collision(geometry: str, x: float, z: float) -> str:
    return f'<collision><origin xyz="{x} 0 {z}"/><geometry>{geometry}</geometry></collision>'


def _link(
    name: str, mass: float, ixx: float, iyy: float, izz: float, collisions: str, com_z: float = 0.0
) -> str:
    return (
        f'<link name="{name}"><inertial><origin xyz="0 0 {com_z}"/><mass value="{mass}"/>'
        f'<inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" ixz="0" iyz="0"/></inertial>'
        f"{collisions}</link>"
    )


class RobotBody:
    """One robot in one PyBullet world."""

    def __init__(self, client: int, spec: RobotSpec, start: Array) -> None:
        self.spec = spec
        self.drive = _speed_drive(spec)
        self._client = client
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "robot.urdf"
            path.write_text(robot_urdf(spec))
            self.body = pb.loadURDF(
                str(path),
                [0.0, 0.0, self.drive.wheel_radius],
                physicsClientId=client,
                flags=pb.URDF_USE_IMPLICIT_CYLINDER,
            )
        for link in range(-1, 4):
            friction = 1.0 if link == BODY else self.drive.wheel_friction if link in WHEELS else 0.0
            pb.changeDynamics(self.body, link, lateralFriction=friction, physicsClientId=client)
            pb.changeDynamics(
                self.body,
                link,
                rollingFriction=0.0,
                spinningFriction=0.0,
                restitution=0.0,
                linearDamping=0.0,
                angularDamping=0.0,
                jointDamping=0.0,
                physicsClientId=client,
            )
            if link != BODY:
                pb.setCollisionFilterGroupMask(
                    self.body, link, BODY_GROUP, FLOOR_GROUP, physicsClientId=client
                )
        self.place(start)

    def place(self, pose: Array) -> None:
        """Put the axle midpoint at a pose ``(3,)``, at rest."""
        # The base frame of PyBullet is the body's centre of mass, 5 mm below the axle.
        height = self.drive.wheel_radius - 0.005 + 1e-4
        quaternion = pb.getQuaternionFromEuler([0.0, 0.0, float(pose[2])])
        pb.resetBasePositionAndOrientation(
            self.body,
            [float(pose[0]), float(pose[1]), height],
            quaternion,
            physicsClientId=self._client,
        )
        pb.resetBaseVelocity(self.body, [0, 0, 0], [0, 0, 0], physicsClientId=self._client)
        for wheel in WHEELS:
            pb.resetJointState(self.body, wheel, 0.0, 0.0, physicsClientId=self._client)
        self.command(0.0, 0.0)

    def command(self, v: float, omega: float) -> None:
        """Set the wheel motors to a twist, scaled down to what the wheels can do."""
        v, omega = self.drive.saturate(v, omega)
        pb.setJointMotorControlArray(
            self.body,
            WHEELS,
            pb.VELOCITY_CONTROL,
            targetVelocities=self.drive.wheel_speeds(v, omega),
            forces=[self.drive.wheel_torque] * 2,
            physicsClientId=self._client,
        )
