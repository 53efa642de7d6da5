"""Other people's solvers of quadratic programmes, given the same rows as ours: see bench solvers.

Each is set to a tolerance of 1e-6. ProxQP starts from the point and multipliers that it is given;
quadprog, PIQP and Clarabel always start cold, for they take no start.
"""

from typing import Any

import numpy as np
from scipy import sparse

from push_qp.row_generation import DenseSolution, RowGeneration

_TOLERANCE = 1e-6


class Quadprog:
    """Goldfarb and Idnani's dual method in C."""

    tolerance = _TOLERANCE

    def solve(
        self, qp: Any, G: Any, b: Any, equal: Any, z: Any, multiplier: Any, known: bool
    ) -> DenseSolution:
        import quadprog

        A, d = _all_rows(qp, G, b, equal)
        try:
            best = quadprog.solve_qp(qp.H, -qp.f, -A.T, -d, int(equal.sum()))[0]
        except ValueError as error:
            return _failed(qp, b, f"quadprog: {error}")
        return DenseSolution(best, np.zeros(len(qp.f) + len(b)), True, "quadprog")


class Piqp:
    """A proximal interior-point method, dense."""

    tolerance = _TOLERANCE

    def solve(
        self, qp: Any, G: Any, b: Any, equal: Any, z: Any, multiplier: Any, known: bool
    ) -> DenseSolution:
        import piqp

        solver = piqp.DenseSolver()
        solver.settings.eps_abs = solver.settings.eps_rel = _TOLERANCE
        solver.settings.verbose = False
        free = ~equal
        solver.setup(
            qp.H,
            qp.f,
            G[equal],
            b[equal],
            G[free],
            np.full(int(free.sum()), -1e30),
            b[free],
            np.maximum(qp.low, -1e30),
            np.minimum(qp.high, 1e30),
        )
        status = solver.solve()
        if status != piqp.PIQP_SOLVED:
            return _failed(qp, b, f"piqp: {status}")
        return DenseSolution(np.array(solver.result.x), np.zeros(len(qp.f) + len(b)), True, "piqp")


class ProxQp:
    """A proximal augmented-Lagrangian method, dense."""

    tolerance = _TOLERANCE

    def solve(
        self, qp: Any, G: Any, b: Any, equal: Any, z: Any, multiplier: Any, known: bool
    ) -> DenseSolution:
        from proxsuite import proxqp

        n, free = len(qp.f), ~equal
        count = int(free.sum())
        solver = proxqp.dense.QP(n, int(equal.sum()), count + n)
        solver.settings.eps_abs, solver.settings.eps_rel = _TOLERANCE, 0.0
        solver.settings.max_iter = 10000
        start = proxqp.InitialGuess
        solver.settings.initial_guess = (
            start.WARM_START if known else start.EQUALITY_CONSTRAINED_INITIAL_GUESS
        )
        # Bounds are rows, for multipliers of its own bounds cannot be given to it.
        low = np.concatenate([np.full(count, -1e20), np.maximum(qp.low, -1e20)])
        high = np.concatenate([b[free], np.minimum(qp.high, 1e20)])
        rows = np.vstack([G[free], np.eye(n)])
        solver.init(qp.H, qp.f, G[equal], b[equal], rows, low, high)
        if known:
            box, price = multiplier[:n], multiplier[n:]
            solver.solve(z, price[equal], np.concatenate([price[free], box]))
        else:
            solver.solve()
        result = solver.results
        if result.info.status != proxqp.QPSolverOutput.PROXQP_SOLVED:
            return _failed(qp, b, f"proxqp: {result.info.status}")
        prices, found = np.zeros(n + len(b)), np.array(result.z)
        prices[n:][equal], prices[n:][free] = result.y, found[:count]
        prices[:n] = found[count:]
        return DenseSolution(np.array(result.x), prices, True, "proxqp")


class Clarabel:
    """A homogeneous interior-point method, sparse."""

    tolerance = _TOLERANCE

    def solve(
        self, qp: Any, G: Any, b: Any, equal: Any, z: Any, multiplier: Any, known: bool
    ) -> DenseSolution:
        import clarabel

        A, d = _all_rows(qp, G, b, equal)
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = _TOLERANCE
        count = int(equal.sum())
        cones = [clarabel.ZeroConeT(count)] if count else []
        cones.append(clarabel.NonnegativeConeT(len(d) - count))
        upper = sparse.triu(sparse.csc_matrix(qp.H), format="csc")
        solver = clarabel.DefaultSolver(upper, qp.f, sparse.csc_matrix(A), d, cones, settings)
        answer = solver.solve()
        if str(answer.status) not in ("Solved", "AlmostSolved"):
            return _failed(qp, b, f"clarabel: {answer.status}")
        return DenseSolution(np.array(answer.x), np.zeros(len(qp.f) + len(b)), True, "clarabel")


def _all_rows(qp: Any, G: Any, b: Any, equal: Any) -> tuple[Any, Any]:
    """Equalities, then inequalities, then finite bounds as rows A z <= d."""
    low, high, eye = np.isfinite(qp.low), np.isfinite(qp.high), np.eye(len(qp.f))
    A = np.vstack([G[equal], G[~equal], eye[high], -eye[low]])
    return A, np.concatenate([b[equal], b[~equal], qp.high[high], -qp.low[low]])


def _failed(qp: Any, b: Any, status: str) -> DenseSolution:
    n = len(qp.f)
    return DenseSolution(np.full(n, np.nan), np.zeros(n + len(b)), False, status)


RIVALS = {"quadprog": Quadprog, "piqp": Piqp, "proxqp": ProxQp, "clarabel": Clarabel}
"""By the names of their modules."""


def backend(name: str) -> RowGeneration:
    """One of them, with row generation.

    Raises
    ------
    ImportError: it is not installed.
    """
    __import__("proxsuite" if name == "proxqp" else name)
    return RowGeneration(RIVALS[name]())
