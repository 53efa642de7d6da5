"""The command to the wheels, integrated from the controller's accelerations (Algorithm 3)."""

from push_model.kinematics import DifferentialDrive
from push_model.stable_push import CurvatureLimits
from push_mpc.controller import MpcResult
from push_mpc.settings import TrackerSettings


class Command:
    """v [m/s] and omega [rad/s], with counters of the solves.

    solves, failures: since construction; failed: in a row.
    """

    def __init__(self, settings: TrackerSettings, drive: DifferentialDrive) -> None:
        self._settings = settings
        self._drive = drive
        self.v = 0.0
        self.omega = 0.0
        self.solves = 0
        self.failures = 0
        self.failed = 0
        self._faded = 1.0

    @property
    def given_up(self) -> bool:
        """Whether too many solves in a row have failed."""
        return self.failed >= self._settings.solver_patience

    def start(self) -> None:
        """Begin a new task: reset the failures in a row."""
        self.failed, self._faded = 0, 1.0

    def stop(self) -> None:
        """Zero."""
        self.v = self.omega = 0.0

    def apply(self, solve: MpcResult, dt: float, limits: CurvatureLimits | None) -> None:
        """Integrate over dt [s]; stop without a solution, fade if it is only late."""
        self.solves += 1
        if not solve.solved:
            self.failures += 1
            self.failed += 1
            left = max(0.0, self._faded - dt / self._settings.fade_time) if solve.late else 0.0
            keep = left / self._faded if self._faded > 0.0 else 0.0
            self.v, self.omega, self._faded = self.v * keep, self.omega * keep, left
            return
        self.start()
        v = self.v + dt * solve.acceleration[0]
        omega = self.omega + dt * solve.acceleration[1]
        if limits is not None:
            v = max(v, 0.0)
        self.v, self.omega = self._drive.saturate(v, omega)
