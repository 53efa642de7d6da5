"""OSQP (Stellato et al., 2020), operator splitting, as a backend."""

import numpy as np
import osqp
from scipy import sparse

from push_qp.programme import Qp, QpSolution


class OsqpBackend:
    """Operator splitting; ``tolerance`` is OSQP's eps_abs and eps_rel."""

    def __init__(self, tolerance: float = 1e-5, polish: bool = True) -> None:
        self._options = {
            "eps_abs": tolerance,
            "eps_rel": tolerance,
            "polishing": polish,
            "verbose": False,
            "max_iter": 20000,
        }

    def solve(self, qp: Qp) -> QpSolution:
        """See QpBackend. Set up anew each time: a warm solver that met a NaN stays poisoned."""
        G, b = qp.rows(qp.all_rows())
        n, m = len(qp.f), len(b)
        if not all(np.isfinite(a).all() for a in (G, b, qp.H, qp.f)):
            return QpSolution(np.full(n, np.nan), False, "osqp: the programme is not finite")
        solver = osqp.OSQP()
        rows = sparse.vstack([sparse.csc_matrix(G), sparse.eye(n, format="csc")], format="csc")
        solver.setup(
            sparse.triu(sparse.csc_matrix(qp.H), format="csc"),
            qp.f,
            rows,
            np.concatenate([np.full(m, -np.inf), qp.low]),
            np.concatenate([b, qp.high]),
            **self._options,
        )
        result = solver.solve()
        z = np.zeros(n) if result.x is None else np.asarray(result.x)
        solved = result.info.status in ("solved", "solved inaccurate")
        return QpSolution(z, solved and bool(np.isfinite(z).all()), f"osqp {result.info.status}")

    def reset(self) -> None:
        """See QpBackend."""
