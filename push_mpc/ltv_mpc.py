"""LTV-MPC of section 2.4: track a reference under curvature and obstacle constraints."""

import math
import time

import numpy as np

from push_model.arrays import Array
from push_model.kinematics import DifferentialDrive
from push_model.stable_push import CurvatureLimits
from push_mpc.controller import Contact, MpcResult, Reference
from push_mpc.line_contact import LineContact
from push_mpc.prediction import OUTPUTS, SLACKS, SOFTENED, condense, constant_rows, tick_rows
from push_mpc.settings import MpcSettings
from push_qp import Qp, QpBackend, backend


class LtvMpc:
    """One controller for one robot. Keeps the previous solution to linearise about."""

    def __init__(
        self, settings: MpcSettings, drive: DifferentialDrive, solver: QpBackend | None = None
    ) -> None:
        self.settings = settings
        self.drive = drive
        self._solver = solver or backend(settings.backend)
        self._Q = np.array(settings.state_weight)
        self._P = settings.terminal_factor * self._Q
        self._R, self._Rd = np.array(settings.input_weight), np.array(settings.input_rate_weight)
        self._max_slack = np.array(
            [settings.max_wheel_slack, settings.max_curvature_slack, settings.max_obstacle_slack]
        )
        self._rollout = np.zeros((settings.horizon + 1, 5))
        self._qp = self._programme()
        self.reset()

    @property
    def horizon(self) -> int:
        """See PredictiveController."""
        return self.settings.horizon

    @property
    def step(self) -> float:
        """See PredictiveController."""
        return self.settings.step

    @property
    def max_obstacles(self) -> int:
        """See PredictiveController."""
        return self.settings.max_obstacles

    def warm_up(self) -> None:
        """See PredictiveController."""
        p = self.settings.horizon
        still = Reference(np.zeros((p + 1, 3)), np.zeros((p + 1, 3)))
        circles = np.array([[1.0, 0.0, 0.5]])[: self.settings.max_obstacles]
        line = LineContact(0.05, -0.03, 0.03, np.array([0.1, 0.0]), 0.2, 0.03, 0.07)
        self.solve(np.full(5, 1e-3), still, Contact(CurvatureLimits(-1.0, 1.0), line), circles)
        self.solve(np.full(5, 1e-3), still, None, np.zeros((0, 3)))
        self.reset()

    def _programme(self) -> Qp:
        """The constant parts of the programme."""
        s = self.settings
        p, n = s.horizon, 2 * s.horizon + SLACKS
        H, f = np.zeros((n, n)), np.zeros(n)
        H[2 * p :, 2 * p :] = 2.0 * s.slack_quadratic * np.eye(SLACKS)
        f[2 * p :] = s.slack_linear
        limit = np.tile([s.max_acceleration, s.max_turn_acceleration], p)
        high = np.concatenate([limit, np.full(SLACKS, 1e6)])
        low = np.concatenate([-limit, np.zeros(SLACKS)])
        S = np.zeros((p, OUTPUTS, 2 * p))
        for k in range(p):  # u_k - u_{k-1}
            for i in range(2):
                S[k, 5 + i, 2 * k + i] = 1.0
                if k > 0:
                    S[k, 5 + i, 2 * k - 2 + i] = -1.0
        change = np.array([s.max_acceleration_change, s.max_turn_acceleration_change])
        normal, bound, family = constant_rows(p, s.max_obstacles, self.drive.half_track, change)
        width = 2 * np.arange(1, p + 1, dtype=np.int64)
        equal = np.zeros(len(family), dtype=np.bool_)
        return Qp(H, f, low, high, S, np.zeros((p, OUTPUTS)), width, normal, bound, family, equal)

    def reset(self) -> None:
        """Forget the previous solution."""
        self._nominal = np.zeros((self.settings.horizon, 2))
        self._previous, self._wanted = np.zeros(2), np.zeros(2)
        self._solver.reset()

    def solve(
        self, error: Array, reference: Reference, contact: Contact | None, circles: Array
    ) -> MpcResult:
        """See PredictiveController.

        Raises
        ------
        ValueError: more circles than max_obstacles.
        """
        started = time.thread_time()
        # a sum is finite only if every term is
        total = error.sum() + reference.pose.sum() + reference.twist.sum() + circles.sum()
        if not math.isfinite(total):
            return self._failed("input is not finite", started)
        forward = self._forward(contact)
        held = reference.held if forward else None
        if held is not None:
            error = error.copy()
            error[3] += reference.twist[0, 0] - held.last[0]
            error[4] += reference.twist[0, 2] - held.last[1]
        result = self._solver.solve(self.programme(error, reference, contact, circles))
        if not result.solved:
            return self._failed(result.status, started)
        p = self.settings.horizon
        u = result.z[: 2 * p].reshape(p, 2)
        slack = result.z[-SLACKS:]
        part = slack / self._max_slack
        worst = int(part.argmax())
        if part[worst] > 1.0:
            kind, unit = SOFTENED[worst]
            return self._failed(
                f"{kind} violated by {slack[worst]:.3g} {unit}, at most "
                f"{self._max_slack[worst]:g} {unit} is tolerated",
                started,
            )
        # The tick is far shorter than a step: linearise about the same inputs next time.
        self._nominal = u.copy()
        self._previous = u[0].copy()
        if forward:
            self._wanted = (reference.twist[1] - reference.twist[0])[[0, 2]] / self.settings.step
        a, eps = u[0]
        if held is not None:  # the next command is followed by another before the step ends
            a += held.acceleration[0] - self._wanted[0]
            eps += held.acceleration[1] - self._wanted[1]
        cpu = time.thread_time() - started
        return MpcResult((float(a), float(eps)), True, max(float(part[worst]), 0.0), cpu, "")

    def programme(
        self, error: Array, reference: Reference, contact: Contact | None, circles: Array
    ) -> Qp:
        """The quadratic programme of this step, linearised about the previous solution.

        Parameters as of ``solve``. Its arrays are overwritten by the next call.
        """
        s, qp = self.settings, self._qp
        if len(circles) > s.max_obstacles:
            raise ValueError(f"{len(circles)} obstacles, at most {s.max_obstacles} have a row")
        twist = np.ascontiguousarray(reference.twist)
        self._condense(error, twist, self._forward(contact))
        limits = None if contact is None else contact.limits
        low, high = (0.0, 0.0) if limits is None else (limits.minimum, limits.maximum)
        tick_rows(
            twist,
            self._rollout,
            reference.pose,
            self.drive.half_track,
            self.drive.max_speed,
            limits is not None,
            low,
            high,
            circles,
            qp.normal,
            qp.bound,
        )
        return qp

    def _forward(self, contact: Contact | None) -> bool:
        """Whether the accelerations of the reference are fed forward: not in a push.

        A push whose brakes lag ends slowly, which leaves time to make good that poses are late by
        more or less than is assumed.
        """
        return self.settings.feedforward and contact is None

    def _condense(self, error: Array, twist: Array, forward: bool) -> None:
        """Cost and outputs of this step, about the previous solution: into the programme."""
        s, qp = self.settings, self._qp
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
            forward,
            self._wanted,
            qp.H,
            qp.f,
            qp.S,
            qp.g,
            self._rollout,
        )

    def _failed(self, reason: str, started: float) -> MpcResult:
        self.reset()
        return MpcResult((0.0, 0.0), False, math.inf, time.thread_time() - started, reason)
