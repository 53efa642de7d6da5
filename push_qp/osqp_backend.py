"""OSQP (Stellato et al., 2020), operator splitting, as a backend."""

import numpy as np
import osqp
from scipy import sparse

from push_model.arrays import Array
from push_qp.programme import Flags, Qp
from push_qp.row_generation import DenseSolution, RowGeneration


class Osqp:
    """``tolerance`` is OSQP's eps_abs and eps_rel. Starts from the point and the multipliers.

    It is set up anew each time, because a solver that met a NaN never recovers.
    """

    def __init__(self, tolerance: float, polish: bool) -> None:
        self.tolerance = max(tolerance, 1e-6)
        self._options = {
            "eps_abs": tolerance,
            "eps_rel": tolerance,
            "polishing": polish,
            "verbose": False,
            "max_iter": 20000,
        }

    def solve(
        self, qp: Qp, G: Array, b: Array, equal: Flags, z: Array, multiplier: Array, known: bool
    ) -> DenseSolution:
        """See DenseSolver."""
        n, m = len(qp.f), len(b)
        none = np.zeros(n + m)
        if not (np.isfinite(qp.H).all() and np.isfinite(qp.f).all()):
            return DenseSolution(np.full(n, np.nan), none, False, "osqp: the cost is not finite")
        solver = osqp.OSQP()
        solver.setup(
            sparse.triu(sparse.csc_matrix(qp.H), format="csc"),
            qp.f,
            sparse.vstack([sparse.eye(n, format="csc"), sparse.csc_matrix(G)], format="csc"),
            np.concatenate([qp.low, np.where(equal, b, -np.inf)]),
            np.concatenate([qp.high, b]),
            **self._options,
        )
        if known:
            solver.warm_start(x=z, y=multiplier)
        result = solver.solve(raise_error=False)
        solved = result.x is not None and result.info.status in ("solved", "solved inaccurate")
        best = np.asarray(result.x) if solved else np.full(n, np.nan)
        prices = np.asarray(result.y) if solved else none
        return DenseSolution(best, prices, solved, f"osqp {result.info.status}")


class OsqpBackend(RowGeneration):
    """OSQP with row generation, or with every row."""

    def __init__(
        self, tolerance: float = 1e-5, polish: bool = True, every_row: bool = False
    ) -> None:
        super().__init__(Osqp(tolerance, polish), every_row)
