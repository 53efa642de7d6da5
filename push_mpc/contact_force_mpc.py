"""LTV-MPC of sections 2.4.5-2.4.6: contact forces are unknowns, and (2.53) ties them to the motion.

The unknowns are those of (2.51): accelerations and contact forces of each step.

In the robot frame the object that moves with the robot has the twist

    (v - omega y_or, omega x_or, omega) = H G f_c,    f_c >= 0,

which is linear in velocities and forces: nothing is lost by linearising it. Only directions matter
to a quasi-static push, so H is taken without its scale and f_c has no unit.

As printed, each equality becomes two inequalities; here with the slack that softens the stick
constraint of 2.4.7, in [rad/s]: the rows of forces are divided by the limit surface's radius.
"""

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from push_model.arrays import Array
from push_model.kinematics import DifferentialDrive
from push_mpc.controller import Contact, MpcResult, Reference
from push_mpc.ltv_mpc import LtvMpc
from push_mpc.prediction import CHANGES, CURVATURES, OUTPUTS, SLACKS, WHEELS, tick_rows
from push_mpc.settings import ContactForceSettings
from push_qp import Qp, QpBackend

PRINTED_GAINS: Mapping[str, Any] = {
    "state_weight": (15.0, 20.0, 5.0, 1.0, 1.0),
    "terminal_factor": 50.0,
    "input_weight": (0.1, 0.1),
    "force_weight": 0.001,
    "input_rate_weight": (0.1, 0.1),
    "feedforward": False,
}
"""Q, P = 50 Q, R_u and R_du of section 2.4.6, which are of a Pioneer, in the cost (2.52) as
printed; ours are the defaults."""

FORCES = 4
"""f_1R, f_1L, f_2R, f_2L of (2.39)."""
STICK = 6
"""Rows of (2.53) in a step: two for each component of the twist; before all others."""


class ContactForceMpc(LtvMpc):
    """One controller for one robot; alone, it has no forces."""

    settings: ContactForceSettings

    def __init__(
        self,
        settings: ContactForceSettings,
        drive: DifferentialDrive,
        solver: QpBackend | None = None,
    ) -> None:
        super().__init__(settings, drive, solver)

    def _programme(self) -> Qp:
        """Unknowns: the inputs of all steps, the forces of all steps, the slacks."""
        plain, s = super()._programme(), self.settings
        p, inputs = s.horizon, 2 * s.horizon
        nu = inputs + FORCES * p
        n, outputs = nu + SLACKS, OUTPUTS + FORCES
        H, f = np.zeros((n, n)), np.zeros(n)
        H[nu:, nu:], f[nu:] = plain.H[inputs:, inputs:], plain.f[inputs:]
        H[range(inputs, nu), range(inputs, nu)] = 2.0 * s.force_weight
        low, high = np.zeros(n), np.full(n, 1e6)
        low[:inputs], high[:inputs] = plain.low[:inputs], plain.high[:inputs]
        S = np.zeros((p, outputs, nu))
        S[:, :OUTPUTS, :inputs] = plain.S
        for k in range(p):
            first = inputs + FORCES * k
            S[k, OUTPUTS:, first : first + FORCES] = np.eye(FORCES)
        rows = plain.bound.shape[1]
        normal = np.zeros((p, outputs, STICK + rows))
        normal[:, :OUTPUTS, STICK:] = plain.normal
        bound = np.full((p, STICK + rows), np.inf)
        bound[:, STICK:] = plain.bound
        family = np.concatenate([np.full(STICK, 1, dtype=np.int64), plain.family])
        width = np.full(p, nu, dtype=np.int64)
        equal = np.zeros(len(family), dtype=np.bool_)
        return Qp(H, f, low, high, S, np.zeros((p, outputs)), width, normal, bound, family, equal)

    def solve(
        self, error: Array, reference: Reference, contact: Contact | None, circles: Array
    ) -> MpcResult:
        """See PredictiveController; a push whose line of contact is not known is not solved."""
        if contact is not None and contact.line is None:
            why = "contact forces need the line along which the bumper touches"
            return self._failed(why, time.thread_time())
        return super().solve(error, reference, contact, circles)

    def programme(
        self, error: Array, reference: Reference, contact: Contact | None, circles: Array
    ) -> Qp:
        """See LtvMpc."""
        s, qp = self.settings, self._qp
        if len(circles) > s.max_obstacles:
            raise ValueError(f"{len(circles)} obstacles, at most {s.max_obstacles} have a row")
        twist = np.ascontiguousarray(reference.twist)
        self._condense(error, twist, self._forward(contact))
        tick_rows(
            twist,
            self._rollout,
            reference.pose,
            self.drive.half_track,
            self.drive.max_speed,
            contact is not None,
            0.0,
            0.0,
            circles,
            qp.normal[:, :, STICK:],
            qp.bound[:, STICK:],
        )
        first = STICK + WHEELS + CHANGES
        qp.bound[:, first : first + CURVATURES] = np.inf
        self._stick_rows(qp, contact, twist)
        return qp

    def _stick_rows(self, qp: Qp, contact: Contact | None, twist: Array) -> None:
        """(2.53), at the end of each step."""
        if contact is None or contact.line is None or not self.settings.constraint:
            qp.bound[:, :STICK] = np.inf
            return
        line = contact.line
        x, y = line.centre
        moved = np.array([[1.0, -y], [0.0, x], [0.0, 1.0]])  # twist of the object by v and omega
        unit = np.array([1.0 / line.radius, 1.0 / line.radius, 1.0])[:, None]
        velocities, forces = unit * moved, unit * line.motion_of_forces
        known = twist[1:, [0, 2]] @ velocities.T
        for i in range(3):
            for j, sign in ((2 * i, 1.0), (2 * i + 1, -1.0)):
                qp.normal[:, 3:5, j] = sign * velocities[i]
                qp.normal[:, OUTPUTS:, j] = -sign * forces[i]
                qp.bound[:, j] = -sign * known[:, i]
