"""DAQP (Arnstrom, Bemporad and Axehill, 2022), a dual active-set solver, as a backend."""

import daqp
import numpy as np
from numpy.typing import NDArray

from push_qp.programme import Index, Qp, QpSolution

_ROUNDS = 12  # of row generation
_TOLERANCE = 1e-6  # of a row, in its own unit
_NEAR = 0.005  # room of a row that is kept for the next solve, in its own unit


class DaqpBackend:
    """DAQP, a dual active-set solver. Sees only rows that matter: it gains from it."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """See QpBackend."""
        self._active = np.zeros(0, dtype=np.int64)  # rows that bound the previous solution
        self._near = np.zeros(0, dtype=np.int64)  # and rows that nearly did

    def solve(self, qp: Qp) -> QpSolution:
        """See QpBackend. From the rows near the last solution on, adds those that are violated."""
        there = ~np.isposinf(qp.bound).ravel()
        chosen = np.zeros(len(there), dtype=np.bool_)
        chosen[self._near[self._near < len(there)]] = True
        guess = np.zeros(len(there), dtype=np.bool_)
        guess[self._active[self._active < len(there)]] = True
        for _ in range(_ROUNDS):
            index = np.flatnonzero(chosen & there)
            result = self._solve_rows(qp, index, guess[index])
            if not result.solved:
                return result
            room = qp.rooms(result.z)
            if np.isnan(room[there]).any():
                return QpSolution(result.z, False, "daqp: a row is not finite")
            tight = there & (room <= _TOLERANCE)
            missing = (room < -_TOLERANCE) & ~chosen
            if not missing.any():
                self._active = np.flatnonzero(tight)
                self._near = np.flatnonzero(there & (room <= _NEAR))
                return result
            guess = tight & chosen
            chosen |= missing
        return self._solve_rows(qp, np.flatnonzero(there), guess[there])

    def _solve_rows(self, qp: Qp, index: Index, active: NDArray[np.bool_]) -> QpSolution:
        G, b = qp.rows(index)
        if not (np.isfinite(G).all() and np.isfinite(b).all()):
            return QpSolution(np.full(len(qp.f), np.nan), False, "daqp: a row is not finite")
        upper = np.concatenate([qp.high, b])
        lower = np.concatenate([qp.low, np.full(len(b), -1e30)])
        sense = np.zeros(len(upper), dtype=np.int32)
        sense[len(qp.f) :] = active  # 1 marks a member of the first working set
        z, _, flag, _ = daqp.solve(qp.H, qp.f, G, upper, lower, sense)
        z = np.asarray(z)
        return QpSolution(z, flag >= 1 and bool(np.isfinite(z).all()), f"daqp {flag}")
