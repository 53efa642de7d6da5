"""A robot whose wheels hold the speeds that they are told, as an e-puck's.

A wheel without the inertia of its motor is so light against the body that PyBullet's friction is
not opposite to its slip: an axle whose wheels slip is squeezed, not driven (docs/physics.md).
"""

from push_model.arrays import Array
from push_model.drives import SpeedDrive
from push_model.specs import RobotSpec
from sim_bridge.robot_body import WHEELS, WheeledBody
from sim_bridge.wheeled_urdf import Wheels


class SpeedBody(WheeledBody):
    """Wheels with a speed servo of bounded torque."""

    def __init__(
        self,
        client: int,
        spec: RobotSpec,
        drive: SpeedDrive,
        start: Array,
        robot_surface: float = 1.0,
    ) -> None:
        """start ``(3,)`` pose; robot_surface: see ``robot_surface``."""
        self.drive = drive
        roll = drive.wheel_mass * drive.wheel_radius**2 / 2.0
        wheels = Wheels(drive.wheel_radius, drive.half_track, drive.wheel_mass, (roll, roll))
        super().__init__(client, spec, wheels, drive.wheel_friction, robot_surface)
        if drive.wheel_inertia > 0.0:
            for wheel in WHEELS:
                self.set_inertia(wheel, [roll, drive.wheel_inertia, roll])
        self.place(start)

    def place(self, pose: Array) -> None:
        """Put the axle midpoint at a pose ``(3,)``, at rest."""
        self.put(pose)
        self.command(0.0, 0.0)

    def command(self, v: float, omega: float) -> None:
        """Set the wheel motors to a twist, scaled down to what the wheels can do."""
        v, omega = self.drive.saturate(v, omega)
        self.servo(self.drive.wheel_speeds(v, omega), self.drive.wheel_torque)

    def command_torques(self, left: float, right: float) -> None:
        """Not supported: the wheels take speeds."""
        raise ValueError("wheels of a differential drive take no torques; command a velocity")

    def before_step(self) -> None:
        """Nothing to do: PyBullet's motors hold the speeds."""
