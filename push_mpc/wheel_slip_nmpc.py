"""NMPC of section 2.3 for a robot driven by wheel torques: it tracks, and its wheels do not slip.

The programme (2.14) is solved by sequential quadratic programming with the Gauss-Newton Hessian,
from the last solution. A violation of a constraint costs ``rho s + rho_2 s^2``, s being the
greatest one: exact as long as a feasible point exists, and the best there is where none does.
"""

import math
import time
from dataclasses import astuple, dataclass

import numpy as np

from push_model.arrays import Array
from push_model.drives import TorqueDrive
from push_model.limit_surface import GRAVITY
from push_model.settings import SettingsError, bounded, settings
from push_model.specs import RobotSpec
from push_model.torque_robot import NO_LOAD, Load, TorqueRobot
from push_mpc.torque_prediction import CUTS, ROWS, predict
from push_mpc.torque_sqp import SOLVED, WORDS, minimise, worst


@settings
class WheelSlipSettings:
    """Names and values of section 2.3.4."""

    step: float = bounded(0.1, low=0.01, high=1.0, doc="Length T_s of a predicted step (s).")
    horizon: int = bounded(15, low=2, high=100, doc="Number N of predicted steps.")
    control_horizon: int = bounded(
        6,
        low=1,
        high=100,
        doc="Number M of predicted steps, from the first one on, that have torques of their own; "
        "later steps repeat the last torques.",
    )
    state_weight: tuple[float, float, float, float, float] = (2.5, 5.0, 0.25, 0.05, 0.05)
    terminal_factor: float = bounded(
        4.0,
        low=0.0,
        high=1000.0,
        doc="Factor of the terminal weight, P = factor * Q (dimensionless).",
    )
    friction: float = bounded(
        0.5,
        low=0.01,
        high=3.0,
        doc="Assumed friction coefficient mu of wheels and floor (dimensionless).",
    )
    friction_trust: float = bounded(
        0.9,
        low=0.1,
        high=1.0,
        doc="Fraction of the assumed wheel friction that the controller may use (dimensionless).",
    )
    sideways_share: float = bounded(
        0.5,
        low=0.5,
        high=1.0,
        doc="Fraction of the sideways force of the robot that each wheel is assumed to bear; "
        "1: as printed in the thesis (dimensionless).",
    )
    constraint: bool = bounded(
        True, doc="Whether the wheel-slip constraint (2.31)-(2.33) of the thesis is active."
    )
    position_limit: float = bounded(
        10.0,
        low=0.1,
        high=1e4,
        doc="Largest absolute x and y that the constraint (2.19) of the thesis allows (m).",
    )
    penalty: float = bounded(
        100.0,
        low=0.1,
        high=1e6,
        doc="Linear penalty rho of the largest constraint violation in the cost of the NMPC "
        "(violations in N, rad/s, m).",
    )
    penalty_square: float = bounded(
        1000.0,
        low=1e-3,
        high=1e8,
        doc="Quadratic penalty rho_2 of the largest constraint violation in the cost of the NMPC "
        "(violations in N, rad/s, m).",
    )
    iterations: int = bounded(
        100,
        low=1,
        high=1000,
        doc="Maximum number of quadratic programmes that one solve of the NMPC takes.",
    )
    tolerance: float = bounded(
        1e-3,
        low=1e-8,
        high=1.0,
        doc="Change of the torques below which the iterations of a solve end (Nm).",
    )

    def __post_init__(self) -> None:
        if self.control_horizon > self.horizon:
            raise SettingsError("control_horizon must not be greater than horizon")
        if min(self.state_weight) < 0.0 or max(self.state_weight) == 0.0:
            raise SettingsError("state_weight: none may be negative, and not all zero")


@dataclass(frozen=True)
class NmpcResult:
    """torques: (right, left) [Nm] to apply now. cost: (2.15) with the penalty. violation: greatest
    one, in tens of newtons, rad/s or m. iterations: quadratic programmes. solve_time [s] CPU.

    solved is False when the torques must not be used; reason says why.
    """

    torques: tuple[float, float]
    solved: bool
    cost: float
    violation: float
    iterations: int
    solve_time: float
    reason: str


def beside(state: Array, reference: Array) -> Array:
    """The reference with headings that are continuous, and nearest to the state's at the start.

    An error of heading that is wrapped within the horizon makes a further valley of every turn.
    """
    near = reference.copy()
    near[:, 2] = np.unwrap(near[:, 2])
    near[:, 2] += 2.0 * np.pi * np.round((state[2] - near[0, 2]) / (2.0 * np.pi))
    return near


class WheelSlipNmpc:
    """One controller for one robot. Keeps the previous torques to begin with.

    trusted: the friction that wheels may ask for; may be changed between solves.
    """

    def __init__(self, settings: WheelSlipSettings, spec: RobotSpec) -> None:
        """Raises SettingsError where the robot is not one with torque-driven wheels."""
        if not isinstance(spec.drive, TorqueDrive):
            raise SettingsError("the wheel-slip NMPC needs a drive of kind 'torque'")
        try:
            self.robot = TorqueRobot.of(spec)
        except ValueError as error:
            raise SettingsError(f"the wheel-slip NMPC: {error}") from None
        self.settings, self.drive = settings, spec.drive
        s, n = settings, 2 * settings.control_horizon
        self._fields = (*astuple(self.robot), GRAVITY)
        self._Q = np.array(s.state_weight)
        self._P = s.terminal_factor * self._Q
        self._limits = np.array([s.position_limit, s.position_limit, spec.drive.max_wheel_speed])
        rows = (ROWS + CUTS) * s.horizon
        self._H, self._g = np.zeros((n, n)), np.zeros(n)
        self._c, self._G = np.zeros(rows), np.zeros((rows, n))
        self.trusted = s.friction_trust * s.friction
        self._price = np.zeros((s.horizon, 2))
        self._active, self._multiplier = np.zeros(n + 1, dtype=np.int64), np.zeros(n + 1)
        self.reset()

    def reset(self) -> None:
        """Forget the previous solution."""
        self.set_start(np.zeros(2 * self.settings.control_horizon))

    @property
    def start(self) -> Array:
        """Torques ``(2 M,)`` that the next solve begins with."""
        return self._z

    def set_start(self, z: Array) -> None:
        """Begin the next solve with torques ``(2 M,)``."""
        self._z = z.copy()
        self._price[:] = 0.0
        self._guessed = 0

    def warm_up(self) -> None:
        """Compile and solve once, so that the first command does not wait."""
        ahead = np.zeros((self.settings.horizon + 1, 5))
        ahead[:, 0] = 0.1
        self.solve(np.zeros(5), ahead)
        self.reset()

    def evaluate(
        self, z: Array, state: Array, reference: Array, load: Load = NO_LOAD
    ) -> tuple[float, float]:
        """Cost (2.15) and greatest violation at torques ``(2 M,)``; fills in slopes."""
        s = self.settings
        cost = predict(
            z,
            state,
            reference,
            s.step,
            self._fields,
            load,
            self._Q,
            self._P,
            self.trusted if s.constraint else -1.0,
            s.sideways_share,
            self._limits,
            self._price,
            self._H,
            self._g,
            self._c,
            self._G,
        )
        return float(cost), float(worst(self._c, ROWS * s.horizon))

    def merit(self, cost: float, violation: float) -> float:
        """What is minimised: the cost and the price of the greatest violation."""
        s = self.settings
        return cost + s.penalty * violation + s.penalty_square * violation**2

    def solve(self, state: Array, reference: Array, load: Load = NO_LOAD) -> NmpcResult:
        """One step.

        Parameters
        ----------
        state: ``(5,)`` x, y, theta, v, omega. reference: ``(N + 1, 5)`` of the same, first now.
        load: drag [N] and moment [Nm] of what the robot pushes, see ``push_model.torque_robot``.
        """
        started = time.thread_time()
        s = self.settings
        if not math.isfinite(float(state.sum() + reference.sum() + sum(load))):
            return self._failed("input is not finite", started)
        z = self._z.copy()
        status, count, self._guessed, value, violation = minimise(
            z,
            state,
            beside(state, reference),
            s.step,
            self._fields,
            load,
            self._Q,
            self._P,
            self.trusted if s.constraint else -1.0,
            s.sideways_share,
            self._limits,
            self.drive.max_torque,
            s.penalty,
            s.penalty_square,
            s.tolerance,
            s.iterations,
            self._price,
            self._active,
            self._multiplier,
            self._guessed,
            self._H,
            self._g,
            self._c,
            self._G,
        )
        if status != SOLVED or not (math.isfinite(value) and np.isfinite(z).all()):
            return self._failed(WORDS[status] if status != SOLVED else "not finite", started)
        self._z = z
        cpu = time.thread_time() - started
        return NmpcResult((float(z[0]), float(z[1])), True, value, violation, count, cpu, "")

    def _failed(self, reason: str, started: float) -> NmpcResult:
        self.reset()
        cpu = time.thread_time() - started
        return NmpcResult((0.0, 0.0), False, math.inf, math.inf, 0, cpu, reason)
