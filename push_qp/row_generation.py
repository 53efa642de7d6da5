"""Row generation around a solver of programmes with plain rows.

The first programme has the rows near the last solution. Violated rows are added and the programme
is solved again until no row is violated. Compiled code checks and writes out the rows. Each solve
starts from the previous multipliers, also those of the previous tick.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from push_model.arrays import Array
from push_qp import rows as kernels
from push_qp.programme import Flags, Qp, QpSolution

_NEAR = 0.005  # room of a row that is kept for the next solve, in its own unit


@dataclass(frozen=True)
class DenseSolution:
    """z ``(n,)`` and multipliers ``(n + m,)``: of the bounds, then of the rows, > 0 at the upper.

    solved: the solver succeeded; status: the solver's own.
    """

    z: Array
    multiplier: Array
    solved: bool
    status: str


class DenseSolver(Protocol):
    """A solver that is given every row written out."""

    tolerance: float
    """Violation of a row that a solution may have, in the row's own unit."""

    def solve(
        self,
        qp: Qp,
        G: Array,
        b: Array,
        equal: Flags,
        z: Array,
        multiplier: Array,
        known: bool,
    ) -> DenseSolution:
        """Minimise over low <= z <= high, G z <= b (= b where equal).

        z and multiplier: where to start, if ``known``.
        """
        ...


class RowGeneration:
    """A backend made of a solver for plain rows; ``every_row`` gives it all rows at once."""

    def __init__(self, solver: DenseSolver, every_row: bool = False) -> None:
        self._solver = solver
        self._every_row = every_row
        self._shape: tuple[int, ...] = ()
        self.rounds = 0  # of the last solve: how often the solver was called
        self.reset()

    def reset(self) -> None:
        """See QpBackend."""
        self._known = False

    def _fit(self, qp: Qp) -> None:
        """Room for every row, and memory of those of this shape only."""
        n, rows = len(qp.f), int(qp.bound.size)
        if self._shape == (n, *qp.bound.shape):
            return
        self._shape, self._known = (n, *qp.bound.shape), False
        self._G, self._b = np.empty((rows, n)), np.empty(rows)
        self._room = np.empty(qp.bound.shape)
        self._numbers = np.empty(rows, dtype=np.int64)
        self._z, self._box, self._row = np.zeros(n), np.zeros(n), np.zeros(rows)
        self._near = np.zeros(rows, dtype=np.bool_)

    def solve(self, qp: Qp) -> QpSolution:
        """See QpBackend."""
        self._fit(qp)
        n = len(qp.f)
        shape = (qp.S, qp.g, qp.width, qp.normal, qp.bound, qp.family)
        there = ~np.isposinf(qp.bound)
        chosen = (there if self._every_row else there & qp.equal).ravel()
        if self._known and not self._every_row:
            chosen = chosen | (self._near & there.ravel())
        numbers = np.flatnonzero(chosen)
        count = len(numbers)
        self._numbers[:count] = numbers
        kernels.write_rows(*shape, numbers, self._G, self._b)
        z, known = self._z, self._known
        box, row = (self._box, self._row) if known else (np.zeros(n), np.zeros(len(self._row)))
        self.rounds = 0
        while True:  # terminates: each round adds rows, and their number is finite
            index = self._numbers[:count]
            G, b = self._G[:count], self._b[:count]
            if not (np.isfinite(G).all() and np.isfinite(b).all()):
                return self._failed(np.full(n, np.nan), "a row is not finite")
            guess = np.concatenate([box, row[index]])
            self.rounds += 1
            result = self._solver.solve(qp, G, b, qp.equalities(index), z, guess, known)
            if not (result.solved and bool(np.isfinite(result.z).all())):
                return self._failed(result.z, result.status)
            z, known = result.z, True
            box, row = result.multiplier[:n], np.zeros(len(row))
            row[index] = result.multiplier[n:]
            more = kernels.violated(
                *shape, z, self._solver.tolerance, chosen, self._room, self._numbers[count:]
            )
            if more < 0:
                return self._failed(z, "a row is not finite")
            if more == 0:
                break
            kernels.write_rows(
                *shape, self._numbers[count : count + more], self._G[count:], self._b[count:]
            )
            count += more
        self._z, self._box, self._row, self._known = z, box, row, True
        self._near = (self._room <= _NEAR).ravel()
        return QpSolution(z, True, result.status)

    def _failed(self, z: Array, status: str) -> QpSolution:
        self.reset()
        return QpSolution(z, False, status)
