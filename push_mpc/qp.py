"""Convex quadratic programmes, one interface for every solver.

minimise 1/2 z'Hz + f'z subject to G z <= b and low <= z <= high.
"""

from dataclasses import dataclass
from typing import Protocol

import daqp
import numpy as np
import osqp
from numpy.typing import NDArray
from scipy import sparse

from push_model.arrays import Array


@dataclass(frozen=True)
class QpSolution:
    """z ``(n,)``; solved: the solver says so and z is finite; status: its own word."""

    z: Array
    solved: bool
    status: str


class QpBackend(Protocol):
    """A solver. ``row_generation``: whether it gains from seeing only rows that matter."""

    row_generation: bool

    def solve(
        self,
        H: Array,
        f: Array,
        G: Array,
        b: Array,
        low: Array,
        high: Array,
        active: NDArray[np.bool_] | None = None,
    ) -> QpSolution:
        """Solve it.

        H ``(n, n)`` positive definite, f, low, high ``(n,)``, G ``(m, n)``, b ``(m,)``;
        active ``(m,)``: rows that are expected to hold with equality, to start from.
        """
        ...


class DaqpBackend:
    """Dual active set; exact, fast for small dense problems."""

    row_generation = True

    def solve(
        self,
        H: Array,
        f: Array,
        G: Array,
        b: Array,
        low: Array,
        high: Array,
        active: NDArray[np.bool_] | None = None,
    ) -> QpSolution:
        """See QpBackend."""
        m = len(b)
        upper = np.concatenate([high, b])
        lower = np.concatenate([low, np.full(m, -1e30)])
        sense = np.zeros(len(upper), dtype=np.int32)
        if active is not None:
            sense[len(f) :] = active  # 1 marks a member of the first working set
        z, _, flag, _ = daqp.solve(H, f, G, upper, lower, sense)
        z = np.asarray(z)
        return QpSolution(z, flag >= 1 and bool(np.isfinite(z).all()), f"daqp {flag}")


class OsqpBackend:
    """Operator splitting; ``tolerance`` is OSQP's eps_abs and eps_rel."""

    row_generation = False

    def __init__(self, tolerance: float = 1e-5, polish: bool = True) -> None:
        self._options = {
            "eps_abs": tolerance,
            "eps_rel": tolerance,
            "polishing": polish,
            "verbose": False,
            "max_iter": 20000,
        }

    def solve(
        self,
        H: Array,
        f: Array,
        G: Array,
        b: Array,
        low: Array,
        high: Array,
        active: NDArray[np.bool_] | None = None,
    ) -> QpSolution:
        """See QpBackend. Set up anew each time: a warm solver that met a NaN stays poisoned."""
        n, m = len(f), len(b)
        solver = osqp.OSQP()
        rows = sparse.vstack([sparse.csc_matrix(G), sparse.eye(n, format="csc")], format="csc")
        solver.setup(
            sparse.triu(sparse.csc_matrix(H), format="csc"),
            f,
            rows,
            np.concatenate([np.full(m, -np.inf), low]),
            np.concatenate([b, high]),
            **self._options,
        )
        result = solver.solve()
        z = np.zeros(n) if result.x is None else np.asarray(result.x)
        solved = result.info.status in ("solved", "solved inaccurate")
        return QpSolution(z, solved and bool(np.isfinite(z).all()), f"osqp {result.info.status}")


def backend(name: str) -> QpBackend:
    """The backend called ``daqp`` or ``osqp``."""
    if name == "daqp":
        return DaqpBackend()
    if name == "osqp":
        return OsqpBackend()
    raise ValueError(f"unknown QP backend '{name}', expected 'daqp' or 'osqp'")
