"""Follow a trajectory with wheel torques: state estimate, NMPC, end and failure. No ROS, no clock.

Wheels that slip say nothing of the robot's speed, so it is estimated from poses: predicted with
the torques in force, (2.13), and corrected by what the poses have moved. That they slip says that
the friction is less than believed: less of it is trusted until they roll again.
"""

import math
from dataclasses import dataclass

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.settings import bounded, settings
from push_model.torque_robot import TorqueRobot
from push_model.trajectory import Trajectory
from push_mpc.task import TrackError
from push_mpc.wheel_slip_nmpc import NmpcResult, WheelSlipNmpc

_LEAST = 0.3  # of the trusted friction, however long a wheel slips
_LONGEST = 0.1  # [s] between poses; beyond, the estimate begins anew


@settings
class TorqueTrackerSettings:
    """When a trajectory is done, and when it has gone wrong."""

    speed_gain: float = bounded(0.4, low=0.01, high=1.0, doc="of the speed that poses show")
    adapt: bool = bounded(True, doc="whether less friction is trusted when a wheel is seen to slip")
    slip: float = bounded(0.05, low=1e-3, high=10.0, doc="[m/s] that is seen as slip")
    loss_time: float = bounded(0.1, low=1e-3, high=10.0, doc="[s] of slip that halve the trust")
    regain_time: float = bounded(8.0, low=0.1, high=1e4, doc="[s] of rolling that double it")
    settle_time: float = bounded(2.0, low=0.0, high=60.0, doc="[s] after the trajectory's end")
    position_tolerance: float = bounded(0.1, low=1e-3, high=5.0, doc="[m] at the end")
    orientation_tolerance: float = bounded(0.2, low=1e-3, high=3.2, doc="[rad] at the end")
    off_course: float = bounded(1.5, low=0.01, high=50.0, doc="[m] from the reference")
    solver_patience: int = bounded(10, low=1, high=10000, doc="failed solves in a row")
    give_up: float = bounded(5.0, low=0.1, high=600.0, doc="[s] without poses until given up")


class SpeedEstimate:
    """v, omega of a robot from poses and the torques in force."""

    def __init__(self, robot: TorqueRobot, gain: float) -> None:
        self._robot, self._gain = robot, gain
        self.forget()

    def forget(self) -> None:
        """Nothing is known: at rest."""
        self._pose: Array | None = None
        self.v = self.omega = 0.0

    def update(self, dt: float, pose: Array, right: float, left: float) -> None:
        """A pose ``(3,)``, dt [s] after the one before, with torques [Nm] in force since."""
        before, self._pose = self._pose, pose
        if before is None or not 0.0 < dt <= _LONGEST:
            self.v = self.omega = 0.0
            return
        a, eps = self._robot.accelerations(self.v, self.omega, right, left)
        v, omega = self.v + dt * float(a), self.omega + dt * float(eps)
        turn = se2.wrap(float(pose[2] - before[2]))
        middle = before[2] + 0.5 * turn
        moved = (pose[:2] - before[:2]) @ np.array([math.cos(middle), math.sin(middle)])
        # what poses show is the mean of the interval
        self.v = v + self._gain * (float(moved) / dt - 0.5 * (self.v + v))
        self.omega = omega + self._gain * (turn / dt - 0.5 * (self.omega + omega))


@dataclass(frozen=True)
class TorqueTick:
    """Outcome of a tick. torques (right, left) [Nm]; None: stand. error ``(3,)`` to the reference,
    in its frame."""

    torques: tuple[float, float] | None
    finished: bool
    code: TrackError
    message: str
    error: Array
    progress: float
    solve: NmpcResult | None


class TorqueTracker:
    """Follows one trajectory at a time."""

    def __init__(self, settings: TorqueTrackerSettings, controller: WheelSlipNmpc) -> None:
        self.settings, self.controller = settings, controller
        self.speed = SpeedEstimate(controller.robot, settings.speed_gain)
        self._trajectory: Trajectory | None = None
        self._torques = (0.0, 0.0)
        self._full = controller.trusted
        self.solves = self.failures = 0

    @property
    def active(self) -> bool:
        """Whether there is a trajectory."""
        return self._trajectory is not None

    def start(self, trajectory: Trajectory) -> None:
        """Begin; the reference starts with the next tick."""
        self._trajectory, self._time, self._failed = trajectory, 0.0, 0
        self.controller.trusted = self._full
        self.controller.reset()

    def stop(self) -> None:
        """Drop the trajectory."""
        self._trajectory, self._torques = None, (0.0, 0.0)

    def rest(self, dt: float, pose: Array | None) -> None:
        """A frame, dt [s] after the one before, in which the robot is told to stand."""
        self._torques = (0.0, 0.0)
        if pose is None:
            self.speed.forget()
        else:
            self.speed.update(dt, pose, 0.0, 0.0)

    def reference(self) -> Array:
        """``(N + 1, 5)`` over the horizon from now: its pose, v, omega."""
        assert self._trajectory is not None
        s = self.controller.settings
        pose, twist = self._trajectory.sample(self._time + s.step * np.arange(s.horizon + 1))
        return np.column_stack([pose, twist[:, 0], twist[:, -1]])

    def slip(self, wheels: Array) -> Array:
        """``(2,)`` [m/s] of the left and the right wheel, whose speeds [rad/s] are given."""
        robot, speed = self.controller.robot, self.speed
        axle = speed.v + speed.omega * robot.half_track * np.array([-1.0, 1.0])
        result: Array = wheels * robot.radius - axle
        return result

    def _adapt(self, dt: float, wheels: Array | None) -> None:
        """Trust less friction while a wheel slips, and slowly more while both roll."""
        s, nmpc = self.settings, self.controller
        if wheels is None or not s.adapt:
            return
        slipping = float(np.abs(self.slip(wheels)).max()) > s.slip
        change = -dt / s.loss_time if slipping else dt / s.regain_time
        low, high = _LEAST * self._full, self._full
        nmpc.trusted = min(max(nmpc.trusted * 2.0**change, low), high)

    def tick(self, dt: float, pose: Array, wheels: Array | None = None) -> TorqueTick:
        """One frame, dt [s] after the one before.

        Parameters
        ----------
        pose: ``(3,)`` of the robot. wheels: ``(2,)`` [rad/s] of the left and the right one, where
            they are known.
        """
        trajectory, s = self._trajectory, self.settings
        if trajectory is None:
            raise RuntimeError("tick without a trajectory")
        self.speed.update(dt, pose, *self._torques)
        self._adapt(dt, wheels)
        reference = self.reference()
        self._time += min(dt, _LONGEST)  # after a gap in the poses the reference has waited
        error = se2.between(np.append(reference[0, :2], se2.wrap(float(reference[0, 2]))), pose)
        off = float(np.hypot(error[0], error[1]))
        progress = min(1.0, self._time / trajectory.duration)
        code, message = TrackError.NONE, ""
        if off > s.off_course:
            code, message = TrackError.OFF_COURSE, f"{1e3 * off:.0f} mm from the reference"
        elif self._time > trajectory.duration + s.settle_time:
            if off > s.position_tolerance or abs(float(error[2])) > s.orientation_tolerance:
                turned = abs(float(error[2]))
                message = f"ended {1e3 * off:.0f} mm and {turned:.2f} rad off"
                code = TrackError.TIMEOUT
            self.stop()
            return TorqueTick(None, True, code, message, error, progress, None)
        if code is not TrackError.NONE:
            self.stop()
            return TorqueTick(None, True, code, message, error, progress, None)
        state = np.array([*pose, self.speed.v, self.speed.omega])
        solve = self.controller.solve(state, reference)
        self.solves += 1
        if not solve.solved:
            self.failures += 1
            self._failed += 1
            self._torques = (0.0, 0.0)
            if self._failed >= s.solver_patience:
                self.stop()
                why = solve.reason
                return TorqueTick(None, True, TrackError.SOLVER_FAILED, why, error, progress, solve)
            return TorqueTick(None, False, code, "", error, progress, solve)
        self._failed = 0
        self._torques = solve.torques
        return TorqueTick(solve.torques, False, code, "", error, progress, solve)
