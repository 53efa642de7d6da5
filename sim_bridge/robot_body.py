"""A robot with two driven wheels as a body of PyBullet, for all kinds of drives."""

import tempfile
from pathlib import Path
from typing import Protocol

import numpy as np
import pybullet as pb

from push_model.arrays import Array
from push_model.specs import RobotSpec
from sim_bridge.collision_groups import ROBOT, SUPPORT, set_group
from sim_bridge.wheeled_urdf import COM_HEIGHT, Wheels, wheeled_urdf
from sim_bridge.world import WheelState

WHEELS = (0, 1)
"""Link and joint indices of the left and the right wheel."""
_BASE = -1


class RobotBody(Protocol):
    """One robot in one PyBullet world."""

    body: int
    """PyBullet id."""
    centre: tuple[float, float]
    """[m] The centre of mass, where PyBullet has the base, in the robot's frame."""

    def place(self, pose: Array) -> None:
        """Put the robot's frame at a pose ``(3,)``, at rest, and command it to stand."""
        ...

    def command(self, v: float, omega: float) -> None:
        """Set the wheels to a twist, scaled down to what they can do."""
        ...

    def command_torques(self, left: float, right: float) -> None:
        """Set the torques [Nm] of the wheels, cut to what the motors can give."""
        ...

    def before_step(self) -> None:
        """What must be done in each physics step."""
        ...

    def wheel_state(self) -> WheelState:
        """Angles, speeds, torques."""
        ...


class WheeledBody:
    """Loading, placing and reading of a robot with two wheels."""

    def __init__(
        self,
        client: int,
        spec: RobotSpec,
        wheels: Wheels,
        friction: float,
        robot_surface: float = 1.0,
    ) -> None:
        """friction: of the wheels on the floor; robot_surface: see ``robot_surface``."""
        self._client, self._radius = client, wheels.radius
        self.centre = (spec.com_ahead, 0.0)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "robot.urdf"
            path.write_text(wheeled_urdf(spec, wheels))
            self.body: int = pb.loadURDF(
                str(path),
                [0.0, 0.0, wheels.radius],
                physicsClientId=client,
                flags=pb.URDF_USE_IMPLICIT_CYLINDER,
            )
        for link in range(-1, pb.getNumJoints(self.body, physicsClientId=client)):
            mu = robot_surface if link == _BASE else friction if link in WHEELS else 0.0
            pb.changeDynamics(self.body, link, lateralFriction=mu, physicsClientId=client)
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
            set_group(client, self.body, link, ROBOT if link == _BASE else SUPPORT)

    def set_inertia(self, link: int, diagonal: list[float]) -> None:
        """Set a link's inertia [kg m^2] (-1: the body) in place of that of its shape."""
        pb.changeDynamics(
            self.body, link, localInertiaDiagonal=diagonal, physicsClientId=self._client
        )

    def put(self, pose: Array) -> None:
        """Put the axle midpoint at a pose ``(3,)``, at rest."""
        height = self._radius + COM_HEIGHT + 1e-4
        x, y, theta = (float(v) for v in pose)
        ahead = self.centre[0]
        pb.resetBasePositionAndOrientation(
            self.body,
            [x + ahead * float(np.cos(theta)), y + ahead * float(np.sin(theta)), height],
            pb.getQuaternionFromEuler([0.0, 0.0, theta]),
            physicsClientId=self._client,
        )
        pb.resetBaseVelocity(self.body, [0, 0, 0], [0, 0, 0], physicsClientId=self._client)
        for wheel in WHEELS:
            pb.resetJointState(self.body, wheel, 0.0, 0.0, physicsClientId=self._client)

    def servo(self, speeds: tuple[float, float], torque: float) -> None:
        """Hold the wheels at speeds [rad/s] with motors of a greatest torque [Nm]."""
        pb.setJointMotorControlArray(
            self.body,
            WHEELS,
            pb.VELOCITY_CONTROL,
            targetVelocities=speeds,
            forces=[torque] * 2,
            physicsClientId=self._client,
        )

    def wheel_state(self) -> WheelState:
        """Angles, speeds and motor torques."""
        states = pb.getJointStates(self.body, WHEELS, physicsClientId=self._client)
        angle, speed, _, torque = zip(*states, strict=True)
        return WheelState(np.array(angle), np.array(speed), np.array(torque))
