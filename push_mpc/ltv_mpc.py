"""LTV-MPC of section 2.4: track a reference under the stick and the obstacle constraints."""

import math
import time
from dataclasses import dataclass

import numpy as np

from push_model.arrays import Array
from push_model.kinematics import DifferentialDrive
from push_model.stable_push import CurvatureLimits
from push_mpc.prediction import SLACKS, condense, constraint_rows, violated
from push_mpc.qp import QpBackend, backend
from push_mpc.settings import MpcSettings

_ROUNDS = 12  # of row generation
_TOLERANCE = 1e-6  # of a row, in its own unit
_NEAR = 0.005  # room of a row that is kept for the next solve, in its own unit


@dataclass(frozen=True)
class Reference:
    """What to track over the horizon.

    pose: ``(p + 1, 3)`` world frame; twist: ``(p + 1, 3)`` v_d, w_d, omega_d of that frame, in it.
    """

    pose: Array
    twist: Array


@dataclass(frozen=True)
class MpcResult:
    """acceleration: (a, epsilon) to apply now; slack: greatest violation; solve_time [s] CPU.

    solved is False when the acceleration must not be used; reason says why.
    """

    acceleration: tuple[float, float]
    solved: bool
    slack: float
    solve_time: float
    reason: str


class LtvMpc:
    """One controller for one robot. Keeps the previous solution to linearise about."""

    def __init__(
        self, settings: MpcSettings, drive: DifferentialDrive, solver: QpBackend | None = None
    ) -> None:
        self.settings = settings
        self.drive = drive
        self._solver = solver or backend(settings.backend)
        p, n = settings.horizon, 2 * settings.horizon + SLACKS
        rows = p * (4 + 4 + 2 + settings.max_obstacles)
        self._H, self._f = np.zeros((n, n)), np.zeros(n)
        self._S, self._g = np.zeros((p, 5, 2 * p)), np.zeros((p, 5))
        self._rollout = np.zeros((p + 1, 5))
        self._G, self._b = np.zeros((rows, n)), np.zeros(rows)
        self._chosen = np.zeros(rows, dtype=np.bool_)
        self._guess = np.zeros(rows, dtype=np.bool_)
        self._Q = np.array(settings.state_weight)
        self._P = settings.terminal_factor * self._Q
        self._R, self._Rd = np.array(settings.input_weight), np.array(settings.input_rate_weight)
        limit = [settings.max_acceleration, settings.max_turn_acceleration]
        self._high = np.concatenate([np.tile(limit, p), np.full(SLACKS, 1e6)])
        self._low = np.concatenate([np.tile([-x for x in limit], p), np.zeros(SLACKS)])
        self._change = np.array(
            [settings.max_acceleration_change, settings.max_turn_acceleration_change]
        )
        self.reset()

    def reset(self) -> None:
        """Forget the previous solution."""
        self._nominal = np.zeros((self.settings.horizon, 2))
        self._previous = np.zeros(2)
        # rows that bound the previous solution, and rows that nearly did
        self._active = np.zeros(0, dtype=np.int64)
        self._near = np.zeros(0, dtype=np.int64)

    def solve(
        self, error: Array, reference: Reference, limits: CurvatureLimits | None, circles: Array
    ) -> MpcResult:
        """One step.

        Parameters
        ----------
        error: ``(5,)`` of (2.37).
        reference: over the horizon, first sample now.
        limits: stable curvatures now, in a push; None when the robot moves alone.
        circles: ``(m, 3)`` x, y, least distance of the axle midpoint; m <= max_obstacles.
        """
        started = time.thread_time()
        # a sum is finite only if every term is
        if not math.isfinite(error.sum() + reference.pose.sum() + reference.twist.sum()):
            return self._failed("input is not finite", started)
        rows = self._assemble(error, reference, limits, circles)
        z, status = self._optimise(rows)
        if z is None:
            return self._failed(status, started)
        p = self.settings.horizon
        u = z[: 2 * p].reshape(p, 2)
        slack = float(z[2 * p :].max())
        if slack > self.settings.max_slack:
            return self._failed(f"constraints violated by {slack:.3g}", started)
        # The tick is far shorter than a step: linearise about the same inputs next time.
        self._nominal = u.copy()
        self._previous = u[0].copy()
        cpu = time.thread_time() - started
        return MpcResult((float(u[0, 0]), float(u[0, 1])), True, slack, cpu, "")

    def _assemble(
        self, error: Array, reference: Reference, limits: CurvatureLimits | None, circles: Array
    ) -> int:
        s = self.settings
        twist = np.ascontiguousarray(reference.twist)
        condense(
            error,
            self._nominal,
            self._previous,
            twist,
            s.step,
            self._Q,
            self._P,
            self._R,
            self._Rd,
            s.slack_linear,
            s.slack_quadratic,
            self._H,
            self._f,
            self._S,
            self._g,
            self._rollout,
        )
        low, high = (0.0, 0.0) if limits is None else (limits.minimum, limits.maximum)
        return int(
            constraint_rows(
                self._S,
                self._g,
                twist,
                self._rollout,
                reference.pose,
                self._previous,
                self._change,
                self.drive.half_track,
                self.drive.max_speed,
                limits is not None,
                low,
                high,
                circles,
                self._G,
                self._b,
            )
        )

    def _optimise(self, rows: int) -> tuple[Array | None, str]:
        if not self._solver.row_generation:
            result = self._solver.solve(
                self._H, self._f, self._G[:rows], self._b[:rows], self._low, self._high
            )
            return (result.z if result.solved else None), result.status
        # Row generation: start from the rows near the previous solution, add what is violated.
        self._chosen[:] = False
        self._chosen[self._near[self._near < rows]] = True
        self._guess[:] = False
        self._guess[self._active[self._active < rows]] = True
        for _ in range(_ROUNDS):
            index = np.flatnonzero(self._chosen[:rows])
            G, b = self._G[index], self._b[index]
            result = self._solver.solve(
                self._H, self._f, G, b, self._low, self._high, self._guess[index]
            )
            if not result.solved:
                return None, result.status
            room = b - G @ result.z
            tight = index[room <= _TOLERANCE]
            self._guess[:] = False
            self._guess[tight] = True
            if violated(self._G, self._b, rows, result.z, _TOLERANCE, self._chosen) == 0:
                self._active, self._near = tight, index[room <= _NEAR]
                return result.z, result.status
        result = self._solver.solve(
            self._H, self._f, self._G[:rows], self._b[:rows], self._low, self._high
        )
        return (result.z if result.solved else None), result.status

    def _failed(self, reason: str, started: float) -> MpcResult:
        self.reset()
        return MpcResult((0.0, 0.0), False, math.inf, time.thread_time() - started, reason)
