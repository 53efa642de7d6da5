"""Follow a trajectory with wheel torques: estimate, NMPC, end and failure. No ROS, no clock.

A frame shows the robot as it was when it was seen. The estimate is of that time; the controller
gets it carried on to now, with the torques that were sent meanwhile.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.settings import bounded, settings
from push_model.trajectory import Trajectory
from push_mpc.task import TrackError
from push_mpc.torque_brake import at_rest, braking_torques
from push_mpc.torque_friction import FrictionTrust, FrictionTrustSettings, wheel_slip
from push_mpc.torque_observer import TorqueObserver, TorqueObserverSettings, Torques
from push_mpc.wheel_slip_nmpc import NmpcResult, WheelSlipNmpc

_LONGEST = 0.1  # [s] between poses; beyond, the estimate begins anew
_NONE: Torques = (0.0, 0.0)


@settings
class TorqueTrackerSettings:
    """When a trajectory is done, and when it has gone wrong."""

    pose_delay: float = bounded(
        0.0,
        low=0.0,
        high=1.0,
        doc="Latency of the pose stream that the torque controller compensates (s).",
    )
    settle_time: float = bounded(
        2.0,
        low=0.0,
        high=60.0,
        doc="Time after the end of the trajectory in which the robot must reach the tolerances "
        "(s).",
    )
    position_tolerance: float = bounded(
        0.1,
        low=1e-3,
        high=5.0,
        doc="Position error that is allowed at the end of the trajectory (m).",
    )
    orientation_tolerance: float = bounded(
        0.2,
        low=1e-3,
        high=3.2,
        doc="Heading error that is allowed at the end of the trajectory (rad).",
    )
    off_course: float = bounded(
        1.5, low=0.01, high=50.0, doc="Distance from the reference at which the task fails (m)."
    )
    solver_patience: int = bounded(
        10, low=1, high=10000, doc="Number of failed solves in a row after which the task fails."
    )
    give_up: float = bounded(
        5.0, low=0.1, high=600.0, doc="Time without poses after which the task fails (s)."
    )


@dataclass(frozen=True)
class TorqueTick:
    """Outcome of a tick. torques (right, left) [Nm]; None: stand. error ``(3,)`` to the reference,
    in its frame."""

    torques: Torques | None
    finished: bool
    code: TrackError
    message: str
    error: Array
    progress: float
    solve: NmpcResult | None


class TorqueTracker:
    """Follows one trajectory at a time, and brings the robot to rest where there is none."""

    def __init__(
        self,
        settings: TorqueTrackerSettings,
        controller: WheelSlipNmpc,
        observer: TorqueObserverSettings | None = None,
        friction: FrictionTrustSettings | None = None,
    ) -> None:
        self.settings, self.controller = settings, controller
        robot = controller.robot
        self.observer = TorqueObserver(
            robot, observer or TorqueObserverSettings(), controller.settings.friction
        )
        self.trust = FrictionTrust(friction or FrictionTrustSettings())
        self._trajectory: Trajectory | None = None
        self._sent: deque[tuple[float, Torques]] = deque()  # torques, and how long they act
        self._torques = _NONE
        self._standing = True  # the wheels are locked
        self._full = controller.trusted
        self.solves = self.failures = 0

    @property
    def active(self) -> bool:
        """Whether there is a trajectory."""
        return self._trajectory is not None

    @property
    def _friction(self) -> float:
        """That wheels may ask for now."""
        return self._full * self.trust.part

    def start(
        self,
        trajectory: Trajectory,
        position_tolerance: float = 0.0,
        orientation_tolerance: float = 0.0,
    ) -> None:
        """Begin; the reference starts with the next tick.

        position_tolerance, orientation_tolerance: [m], [rad] of the end; 0: that of the settings.
        """
        s = self.settings
        self._tolerances = (
            position_tolerance or s.position_tolerance,
            orientation_tolerance or s.orientation_tolerance,
        )
        self._trajectory, self._time, self._failed = trajectory, 0.0, 0
        self.trust.start()
        self.controller.trusted = self._full
        self.controller.reset()

    def stop(self) -> None:
        """Drop the trajectory."""
        self._trajectory = None

    def rest(self, dt: float, pose: Array | None) -> Torques | None:
        """A frame, dt [s] after the one before, in which no trajectory is followed.

        Returns torques that bring the robot to rest; None once it may be told to stand.
        """
        self._see(dt, pose, None)
        return self.brake()

    def reference(self) -> Array:
        """``(N + 1, 5)`` of the horizon from now: its pose, v, omega."""
        assert self._trajectory is not None
        s = self.controller.settings
        pose, twist = self._trajectory.sample(self._time + s.step * np.arange(s.horizon + 1))
        return np.column_stack([pose, twist[:, 0], twist[:, -1]])

    def tick(self, dt: float, pose: Array, wheels: Array | None = None) -> TorqueTick:
        """One frame, dt [s] after the one before.

        Parameters
        ----------
        pose: ``(3,)`` of the robot. wheels: ``(2,)`` [rad/s] of the left and the right one at the
            time of the frame, where they are known.
        """
        trajectory, s = self._trajectory, self.settings
        if trajectory is None:
            raise RuntimeError("tick without a trajectory")
        self._see(dt, pose, wheels)
        state = self.observer.ahead(self._sent)
        reference = self.reference()
        self._time += min(dt, _LONGEST)  # after a gap in the poses the reference has waited
        goal = np.append(reference[0, :2], se2.wrap(float(reference[0, 2])))
        error = se2.between(goal, np.append(state[:2], se2.wrap(float(state[2]))))
        off, turned = float(np.hypot(error[0], error[1])), abs(float(error[2]))
        progress = min(1.0, self._time / trajectory.duration)
        if off > s.off_course:
            return self._ended(TrackError.OFF_COURSE, _away(off), error, progress)
        if self._time > trajectory.duration + s.settle_time:
            if off > self._tolerances[0] or turned > self._tolerances[1]:
                why = (
                    f"the trajectory ended with an error of {1e3 * off:.0f} mm and {turned:.2f} rad"
                )
                return self._ended(TrackError.TIMEOUT, why, error, progress)
            return self._ended(TrackError.NONE, "", error, progress)
        self.controller.trusted = self._friction
        solve = self.controller.solve(state, reference, self.observer.load)
        self.solves += 1
        if solve.solved:
            self._failed = 0
            self._torques, self._standing = solve.torques, False
            return TorqueTick(solve.torques, False, TrackError.NONE, "", error, progress, solve)
        self.failures += 1
        self._failed += 1
        if self._failed >= s.solver_patience:
            return self._ended(TrackError.SOLVER_FAILED, solve.reason, error, progress, solve)
        return TorqueTick(self.brake(), False, TrackError.NONE, "", error, progress, solve)

    def _see(self, dt: float, pose: Array | None, wheels: Array | None) -> None:
        """Carry the estimate to the time of a frame, and take in what it shows."""
        observer, slipping = self.observer, self.trust.slipping
        self._sent.append((dt, self._torques))
        if self._standing:
            observer.rest()
        if not 0.0 < dt <= _LONGEST:
            observer.forget()
            self._sent.clear()
        for step, torques in self._due():
            observer.predict(step, torques, slipping)
        if pose is None:
            return
        observer.correct(pose)
        slips = None
        if wheels is not None:
            slips = wheel_slip(self.controller.robot, wheels, observer.v, observer.omega)
        self.trust.update(dt, slips, observer.wheel_noise)
        if slips is not None and not self.trust.slipping:
            observer.correct_by_wheels(slips)

    def _due(self) -> list[tuple[float, Torques]]:
        """Torques that acted before the frame; those that act later stay in the queue."""
        due = []
        late = sum(step for step, _ in self._sent) - self.settings.pose_delay
        while late > 1e-9:
            step, torques = self._sent.popleft()
            part = min(step, late)
            due.append((part, torques))
            if part < step:
                self._sent.appendleft((step - part, torques))
            late -= part
        return due

    def brake(self) -> Torques | None:
        """Torques towards rest; None, for ever, once the robot is there or nothing is known."""
        nmpc, observer = self.controller, self.observer
        v, omega = map(float, observer.ahead(self._sent)[3:])
        if self._standing or not observer.known or at_rest(v, omega):
            self._torques, self._standing = _NONE, True
            return None
        self._torques = braking_torques(
            nmpc.robot,
            v,
            omega,
            self._friction,
            nmpc.drive.max_torque,
            observer.load,
            nmpc.settings.sideways_share,
        )
        return self._torques

    def _ended(
        self,
        code: TrackError,
        message: str,
        error: Array,
        progress: float,
        solve: NmpcResult | None = None,
    ) -> TorqueTick:
        self.stop()
        return TorqueTick(self.brake(), True, code, message, error, progress, solve)


def _away(off: float) -> str:
    return f"the robot is {1e3 * off:.0f} mm from its reference"
