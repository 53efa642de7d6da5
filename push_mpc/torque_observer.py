"""Where a torque-driven robot is, how fast, and what it pushes: from poses and its own torques.

An extended Kalman filter on (2.13) with two further states, the drag [N] and the moment [Nm] of
what the robot meets. Poses correct it. Wheels that roll tell the speed far better than poses do;
wheels that slip say nothing of it, so they are listened to only while they agree with the poses.
A box that is pushed along a bend brakes the robot and turns it; with both in the prediction the
controller neither lags behind nor runs wide.

    B. Friedland, Treatment of bias in recursive filtering, IEEE Transactions on Automatic Control
    14(4), 359-367, 1969: constant disturbances as further states.
"""

import math
from collections.abc import Iterable

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.limit_surface import GRAVITY
from push_model.settings import bounded, settings
from push_model.torque_robot import Load, TorqueRobot

_UNKNOWN = (1e-3, 1e-3, 1e-2, 0.05, 0.15, 0.1, 0.1)
"""Standard deviations at the first pose: [m], [m], [rad], [m/s], [rad/s], [N], [Nm]."""
Torques = tuple[float, float]
"""Right and left [Nm]."""


@settings
class TorqueObserverSettings:
    """Noise of the poses, and how fast speeds and loads may change in ways that the model lacks.

    The process noise of a state is the standard deviation that it gathers in one second.
    """

    position_noise: float = bounded(
        5e-4,
        low=1e-6,
        high=0.1,
        doc="Standard deviation of a measured position that the speed estimate assumes (m).",
    )
    orientation_noise: float = bounded(
        2e-3,
        low=1e-6,
        high=1.0,
        doc="Standard deviation of a measured heading that the speed estimate assumes (rad).",
    )
    wheel_noise: float = bounded(
        0.02,
        low=1e-4,
        high=10.0,
        doc="Standard deviation of the measured speed of a wheel that rolls without slip (m/s).",
    )
    skid_drift: float = bounded(
        0.02,
        low=0.0,
        high=10.0,
        doc="Process noise of the estimated position, for wheels that skid sideways (m/sqrt(s)).",
    )
    speed_drift: float = bounded(
        0.1, low=1e-6, high=100.0, doc="Process noise of the estimated speed (m/s/sqrt(s))."
    )
    turn_drift: float = bounded(
        0.5, low=1e-6, high=1000.0, doc="Process noise of the estimated turn rate (rad/s/sqrt(s))."
    )
    drag_drift: float = bounded(
        5.0,
        low=0.0,
        high=1e4,
        doc="Process noise of the estimated drag of a load (N/sqrt(s)); 0: no drag is estimated.",
    )
    moment_drift: float = bounded(
        1.0,
        low=0.0,
        high=1e4,
        doc="Process noise of the estimated yaw moment of a load (Nm/sqrt(s)); 0: no moment is "
        "estimated.",
    )


class TorqueObserver:
    """The estimate at the time of the last pose. ``state``: x, y, theta, v, omega, drag, moment."""

    def __init__(
        self, robot: TorqueRobot, settings: TorqueObserverSettings, friction: float
    ) -> None:
        """friction: of the wheels, as it is believed."""
        self._robot, self._friction, s = robot, friction, settings
        self._heaviest = friction * robot.mass * GRAVITY  # [N] no robot moves against more
        drift = [s.speed_drift, s.turn_drift, s.drag_drift, s.moment_drift]
        self._Q = np.diag(np.square([0.0, 0.0, 0.0, *drift]))
        self._skid, self._wheel_noise = s.skid_drift, s.wheel_noise
        self._R = np.diag(np.square([s.position_noise, s.position_noise, s.orientation_noise]))
        self.forget()

    def forget(self) -> None:
        """Nothing is known: no pose, at rest, no load."""
        self.state, self._P, self.known = np.zeros(7), np.zeros((7, 7)), False
        self._spun = False  # more torque was asked for than the floor takes

    def rest(self) -> None:
        """The robot stands; whatever it pushed, it pushes no more."""
        self.state[3:] = 0.0

    @property
    def v(self) -> float:
        """[m/s] along the heading."""
        return float(self.state[3])

    @property
    def omega(self) -> float:
        """[rad/s]."""
        return float(self.state[4])

    @property
    def load(self) -> Load:
        """Drag [N] and moment [Nm] of what is pushed."""
        return float(self.state[5]), float(self.state[6])

    @property
    def wheel_noise(self) -> float:
        """[m/s] standard deviation of a wheel's speed over the floor."""
        lever = np.array([1.0, self._robot.half_track])
        return math.sqrt(max(0.0, float(lever @ self._P[3:5, 3:5] @ lever)))

    def predict(self, dt: float, torques: Torques, slipping: bool = False) -> None:
        """Go on by dt [s] with torques in force, of which friction transmits only so much."""
        if not self.known:
            return
        F = self._slopes(dt)
        sent = self._transmitted(self.v, self.omega, torques, self.load)
        self._spun = slipping or sent != torques
        self.state = self._moved(self.state, dt, torques)
        Q = self._Q.copy()
        aside = self._skid * np.array([-math.sin(self.state[2]), math.cos(self.state[2])])
        Q[:2, :2] = np.outer(aside, aside)
        if self._spun:
            Q[5:] = 0.0
        self._P = F @ self._P @ F.T + dt * Q

    def correct(self, pose: Array) -> None:
        """Take in a pose ``(3,)``; the first one is believed.

        The load is left as it is where wheels have slipped: what the model lacks then is friction.
        """
        if not self.known:
            self.state[:3], self.known = pose, True
            self._P = np.diag(np.square(_UNKNOWN))
            self._P[5:, 5:] *= np.sign(np.diag(self._Q)[5:])
            return
        innovation = pose - self.state[:3]
        innovation[2] = se2.wrap(float(innovation[2]))
        self._take(innovation, np.eye(3, 7), self._R)

    def correct_by_wheels(self, slips: Array) -> None:
        """Take in that wheels roll which seem to slip by ``(2,)`` [m/s], left and right."""
        lever, H = self._robot.half_track, np.zeros((2, 7))
        H[:, 3], H[:, 4] = 1.0, (-lever, lever)
        self._take(slips, H, self._wheel_noise**2 * np.eye(2))

    def _take(self, innovation: Array, H: Array, R: Array) -> None:
        gain = np.linalg.solve(H @ self._P @ H.T + R, H @ self._P).T
        if self._spun:
            gain[5:] = 0.0
        self.state = self.state + gain @ innovation
        most, lever = self._heaviest, self._robot.half_track
        self.state[5] = min(max(float(self.state[5]), -most), most)
        self.state[6] = min(max(float(self.state[6]), -lever * most), lever * most)
        left = np.eye(7) - gain @ H  # Joseph's form holds for any gain
        self._P = left @ self._P @ left.T + gain @ R @ gain.T

    def ahead(self, steps: Iterable[tuple[float, Torques]]) -> Array:
        """``(5,)`` x, y, theta, v, omega after further times [s] with torques; see ``predict``."""
        state = self.state
        for dt, torques in steps:
            state = self._moved(state, dt, torques)
        result: Array = state[:5].copy()
        return result

    def _moved(self, state: Array, dt: float, torques: Torques) -> Array:
        x, y, theta, v, omega, drag, moment = map(float, state)
        right, left = self._transmitted(v, omega, torques, (drag, moment))
        a, eps = self._robot.accelerations(v, omega, right, left, (drag, moment))
        way, turn = dt * (v + 0.5 * dt * float(a)), dt * (omega + 0.5 * dt * float(eps))
        middle = theta + 0.5 * turn
        place = [x + way * math.cos(middle), y + way * math.sin(middle), theta + turn]
        return np.array([*place, v + dt * float(a), omega + dt * float(eps), drag, moment])

    def _transmitted(self, v: float, omega: float, torques: Torques, load: Load) -> Torques:
        """Of torques [Nm], what the floor takes: a wheel that is asked for more spins."""
        robot = self._robot
        carried = np.maximum(0.0, robot.loads(v, omega, 0.0, 0.0, load)[:2])
        most = self._friction * robot.radius * carried
        right, left = np.clip(torques, -most, most)
        return float(right), float(left)

    def _slopes(self, dt: float) -> Array:
        r = self._robot
        _, _, theta, v, omega, _, _ = map(float, self.state)
        lag = r.body_mass * r.ahead
        F = np.eye(7)
        F[0, 2], F[0, 3] = -dt * v * math.sin(theta), dt * math.cos(theta)
        F[1, 2], F[1, 3] = dt * v * math.cos(theta), dt * math.sin(theta)
        F[2, 4] = dt
        F[3, 4], F[3, 5] = 2.0 * dt * lag * omega / r.along, -dt / r.along
        F[4, 3], F[4, 4] = -dt * lag * omega / r.about, 1.0 - dt * lag * v / r.about
        F[4, 6] = dt / r.about
        return F
