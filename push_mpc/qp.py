"""The condensed quadratic programme of a tick, and one interface for every solver of it.

minimise 1/2 z'Hz + f'z with z = (u, slacks), low <= z <= high, and rows on each step's outputs.
"""

from dataclasses import dataclass, field
from typing import Protocol

import daqp
import numpy as np
import osqp
from numpy.typing import NDArray
from scipy import sparse

from push_model.arrays import Array
from push_mpc import active_set

Index = NDArray[np.int64]


@dataclass(frozen=True)
class Qp:
    """One quadratic programme; the arrays are reused from tick to tick.

    H ``(n, n)`` positive definite; f, low, high ``(n,)``. Outputs y_k = g_k + S_k u with S
    ``(K, o, nu)``, g ``(K, o)``; width ``(K,)``: only so many inputs move output k. Row j of step
    k: normal[k, :, j] . y_k - slack <= bound[k, j], with normal ``(K, o, r)`` and bound ``(K, r)``
    (inf: no row); its slack is z[nu + family[j]], none where family ``(r,)`` is negative.
    """

    H: Array
    f: Array
    low: Array
    high: Array
    S: Array
    g: Array
    width: Index
    normal: Array
    bound: Array
    family: Index

    def rooms(self, z: Array) -> Array:
        """What each row has left ``(K r,)``; negative: violated."""
        y, room = np.empty(self.g.shape), np.empty(self.bound.shape)
        active_set.outputs(self.S, self.g, self.width, z, y)
        slack = np.append(z[self.S.shape[2] :], 0.0)[self.family]
        active_set.rooms(self.normal, self.bound, y, slack, room)
        return room.ravel()

    def rows(self, numbers: Index) -> tuple[Array, Array]:
        """Rows k r + j written out: G ``(m, n)`` and b ``(m,)`` of G z <= b."""
        G, b = np.empty((len(numbers), len(self.f))), np.empty(len(numbers))
        for i, number in enumerate(numbers):
            k, j = divmod(int(number), self.bound.shape[1])
            b[i] = active_set.write_row(
                self.S, self.g, self.width, self.normal, self.bound, self.family, k, j, G[i]
            )
        return G, b

    def all_rows(self) -> Index:
        """Numbers of the rows that there are."""
        return np.flatnonzero(~np.isposinf(self.bound))

    @staticmethod
    def dense(H: Array, f: Array, G: Array, b: Array, low: Array, high: Array) -> "Qp":
        """A programme given by plain rows G z <= b: one step whose outputs are z."""
        n = len(f)
        none = np.full(len(b), -1, dtype=np.int64)
        width = np.array([n], dtype=np.int64)
        normal = np.ascontiguousarray(G.T)[None]
        return Qp(H, f, low, high, np.eye(n)[None], np.zeros((1, n)), width, normal, b[None], none)


@dataclass(frozen=True)
class QpSolution:
    """z ``(n,)``; solved: the solver says so and z is finite; status: its own word."""

    z: Array
    solved: bool
    status: str


class QpBackend(Protocol):
    """A solver. May remember the last solution; ``reset`` forgets it."""

    def solve(self, qp: Qp) -> QpSolution:
        """Solve it."""
        ...

    def reset(self) -> None:
        """Forget what was remembered."""
        ...


@dataclass
class ActiveSetBackend:
    """Our dual active-set method (push_mpc.active_set). Starts from the last working set."""

    tolerance: float = 1e-8
    max_iterations: int = 500
    _active: Index = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    _multiplier: Array = field(default_factory=lambda: np.zeros(0))
    _count: int = 0
    _shape: tuple[int, ...] = ()

    def solve(self, qp: Qp) -> QpSolution:
        """See QpBackend."""
        n = len(qp.f)
        if self._shape != (n, *qp.bound.shape):  # what was remembered is of other rows
            self._shape, self._count = (n, *qp.bound.shape), 0
            self._active, self._multiplier = np.zeros(n, np.int64), np.zeros(n)
        z = np.empty(n)
        status, iterations, self._count = active_set.solve(
            qp.H,
            qp.f,
            qp.low,
            qp.high,
            qp.S,
            qp.g,
            qp.width,
            qp.normal,
            qp.bound,
            qp.family,
            self.tolerance,
            self.max_iterations,
            z,
            self._active,
            self._multiplier,
            self._count,
        )
        solved = status == active_set.OPTIMAL and bool(np.isfinite(z).all())
        if not solved:
            self.reset()
        return QpSolution(z, solved, f"{active_set.WORDS[status]} after {iterations} iterations")

    def reset(self) -> None:
        """See QpBackend."""
        self._count = 0


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


def backend(name: str) -> QpBackend:
    """The backend called ``active_set``, ``daqp`` or ``osqp``."""
    if name == "active_set":
        return ActiveSetBackend()
    if name == "daqp":
        return DaqpBackend()
    if name == "osqp":
        return OsqpBackend()
    raise ValueError(f"unknown QP backend '{name}', expected 'active_set', 'daqp' or 'osqp'")
