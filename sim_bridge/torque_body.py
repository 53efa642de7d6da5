"""A robot whose wheels are driven by torques, as the Pioneer of section 2.3.

Wheels slip where the traction that a torque asks for is more than friction gives. Commanded by a
velocity it holds wheel speeds with the same motors, as the firmware of such robots does.
"""

import pybullet as pb

from push_model.arrays import Array
from push_model.drives import TorqueDrive
from push_model.specs import RobotSpec
from sim_bridge.robot_body import WHEELS, WheeledBody
from sim_bridge.wheeled_urdf import Wheels
from sim_bridge.world import WheelState


class TorqueBody(WheeledBody):
    """Wheels under torques, or under a speed servo: as the last command was."""

    def __init__(
        self,
        client: int,
        spec: RobotSpec,
        drive: TorqueDrive,
        start: Array,
        robot_surface: float = 1.0,
    ) -> None:
        """start ``(3,)`` pose; robot_surface: see ``robot_surface``."""
        self.drive = drive
        across = drive.wheel_mass * drive.wheel_radius**2 / 4.0
        wheels = Wheels(
            drive.wheel_radius, drive.half_track, drive.wheel_mass, (drive.wheel_inertia, across)
        )
        super().__init__(client, spec, wheels, drive.wheel_friction, robot_surface)
        self._set_inertia(spec, wheels)
        self._torques: tuple[float, float] | None = None
        self._applied = (0.0, 0.0)
        self.place(start)

    def _set_inertia(self, spec: RobotSpec, wheels: Wheels) -> None:
        """PyBullet takes inertias from the shapes; under torques it is those given that count."""
        along, across = wheels.inertia
        for wheel in WHEELS:
            self.set_inertia(wheel, [across, along, across])
        if spec.inertia is not None:
            ixx, iyy, _ = pb.getDynamicsInfo(self.body, -1, physicsClientId=self._client)[2]
            self.set_inertia(-1, [ixx, iyy, spec.inertia])

    def place(self, pose: Array) -> None:
        """Put the axle midpoint at a pose ``(3,)``, at rest."""
        self.put(pose)
        self.command(0.0, 0.0)

    def command(self, v: float, omega: float) -> None:
        """Hold the wheel speeds of a twist, scaled down to what the wheels can do."""
        self._torques = None
        v, omega = self.drive.saturate(v, omega)
        self.servo(self.drive.wheel_speeds(v, omega), self.drive.max_torque)

    def command_torques(self, left: float, right: float) -> None:
        """Set the torques [Nm] of the wheels, cut to what the motors can give."""
        if self._torques is None:
            self.servo((0.0, 0.0), 0.0)  # free wheels
        most = self.drive.max_torque
        self._torques = (max(-most, min(most, left)), max(-most, min(most, right)))

    def before_step(self) -> None:
        """PyBullet forgets torques after each step. A wheel at its greatest speed gets no more."""
        if self._torques is None:
            return
        states = pb.getJointStates(self.body, WHEELS, physicsClientId=self._client)
        most = self.drive.max_wheel_speed
        self._applied = tuple(  # type: ignore[assignment]
            0.0 if abs(state[1]) >= most and state[1] * torque > 0.0 else torque
            for state, torque in zip(states, self._torques, strict=True)
        )
        pb.setJointMotorControlArray(
            self.body,
            WHEELS,
            pb.TORQUE_CONTROL,
            forces=self._applied,
            physicsClientId=self._client,
        )

    def wheel_state(self) -> WheelState:
        """Angles, speeds, and the torques that act."""
        state = super().wheel_state()
        if self._torques is not None:
            state.torque[:] = self._applied  # PyBullet tells that of its own motors only
        return state
