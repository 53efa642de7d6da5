"""The robots of a lab: commands are limited, turned into each robot's frame, and handed to its
driver. A robot whose connection is lost is told nothing but a stop when it is back."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from lab_bridge.robot_drivers import RobotDriver
from lab_bridge.settings import LabBridgeSettings
from push_model.arrays import Array
from push_model.drives import HolonomicDrive
from push_model.specs import RobotSpec

_LAST_TURNS, _TURN = 16, 0.02  # polls, and [s] between two, before the links end


class Fleet:
    """Obeys a CommandIntake. Times are monotonic [s] and come from ``clock``."""

    def __init__(
        self,
        specs: Mapping[str, RobotSpec],
        drivers: Mapping[str, RobotDriver],
        settings: LabBridgeSettings,
        clock: Callable[[], float],
        heading: Callable[[str], float | None],
    ) -> None:
        """heading: [rad] of a robot in the map; None where it is not known."""
        self.names = tuple(specs)
        self._specs, self._drivers, self._settings = specs, drivers, settings
        self._clock, self._heading = clock, heading
        self.held = True
        """Whether all robots stand, whatever they are commanded."""
        self.troubles: dict[str, str] = {n: d.trouble for n, d in drivers.items() if d.trouble}
        """Why robots cannot be commanded, by name."""

    def poll(self) -> tuple[dict[str, str], list[str]]:
        """Let the drivers work; robots that are lost since the last call with the reason, and
        those that are back."""
        now = self._clock()
        for driver in self._drivers.values():
            driver.poll(now)
        before = self.troubles
        self.troubles = {n: d.trouble for n, d in self._drivers.items() if d.trouble}
        lost = {n: why for n, why in self.troubles.items() if n not in before}
        return lost, [n for n in before if n not in self.troubles]

    def command(self, robot: str, v: float, omega: float) -> None:
        """See Commanded."""
        self.command_all([robot], np.array([[v, 0.0, omega]]))

    def command_all(self, robots: Sequence[str], twists: Array, fixed_frame: bool = False) -> None:
        """See Commanded. In the map's frame a robot whose heading is not known stands."""
        now = self._clock()
        for robot, twist in zip(robots, np.asarray(twists, dtype=np.float64), strict=True):
            wanted = np.zeros(3) if self.held else twist
            if fixed_frame and wanted.any():
                wanted = self._in_own_frame(robot, wanted)
            self._drivers[robot].command(self.limited(robot, wanted), now)

    def command_torques(self, robot: str, left: float, right: float) -> None:
        """See Commanded; no robot of a lab takes torques."""
        raise ValueError(f"{robot}: wheels are not driven by torque in a lab")

    def stop_all(self) -> None:
        """Every robot stands from now on, until it is commanded again."""
        self.command_all(self.names, np.zeros((len(self.names), 3)))

    def close(self, pause: Callable[[float], None]) -> None:
        """Stop all robots, several times because a command may be lost, and end the links.

        pause: waits some time [s].
        """
        self.stop_all()
        for _ in range(_LAST_TURNS):
            pause(_TURN)
            for driver in self._drivers.values():
                driver.poll(self._clock())
        for driver in self._drivers.values():
            driver.close(self._clock())

    def limited(self, robot: str, twist: Array) -> Array:
        """``(3,)`` the twist that the robot can follow, within the limits of the lab: scaled by one
        factor, so that the rotation centre is kept."""
        drive = self._specs[robot].drive
        vx, vy, omega = (float(v) for v in twist)
        if isinstance(drive, HolonomicDrive):
            vx, vy, omega = drive.saturate(vx, vy, omega)
        else:
            vx, omega = drive.saturate(vx, omega)
            vy = 0.0
        need = max(
            float(np.hypot(vx, vy)) / self._settings.max_speed,
            abs(omega) / self._settings.max_turn_rate,
            1.0,
        )
        return np.array([vx, vy, omega]) / need

    def _in_own_frame(self, robot: str, twist: Array) -> Array:
        heading = self._heading(robot)
        if heading is None:
            return np.zeros(3)
        c, s = np.cos(heading), np.sin(heading)
        return np.array([c * twist[0] + s * twist[1], c * twist[1] - s * twist[0], twist[2]])
