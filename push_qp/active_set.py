"""Our dual active-set method (push_qp.goldfarb_idnani) as a backend."""

from dataclasses import dataclass, field

import numpy as np

from push_model.arrays import Array
from push_qp import goldfarb_idnani
from push_qp.programme import Index, Qp, QpSolution


def iteration_limit(qp: Qp) -> int:
    """Limit of the iterations of a solve: ten per unknown and one per row.

    One to two iterations per active row are normal, and there are no more active rows than
    unknowns. A start from an unrelated working set may take two or three times as many. No proof
    keeps a solve below the limit (docs/single-robot.md); at the limit it fails.
    """
    return 10 * len(qp.f) + int(qp.bound.size)


@dataclass
class ActiveSetBackend:
    """Starts from the last working set."""

    tolerance: float = 1e-8
    iterations: int = 0
    """Of the last solve: each adds a row to the working set, or drops one from it."""
    _active: Index = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    _multiplier: Array = field(default_factory=lambda: np.zeros(0))
    _count: int = 0
    _shape: tuple[int, ...] = ()

    @property
    def working_set(self) -> Index:
        """Numbers of the constraints that the next solve tries first."""
        return self._active[: self._count]

    @property
    def multipliers(self) -> Array:
        """Of the constraints of the working set, at the last solution."""
        return self._multiplier[: self._count]

    def solve(self, qp: Qp) -> QpSolution:
        """See QpBackend."""
        n = len(qp.f)
        if self._shape != (n, *qp.bound.shape):  # the remembered working set belongs to other rows
            self._shape, self._count = (n, *qp.bound.shape), 0
            self._active, self._multiplier = np.zeros(n, np.int64), np.zeros(n)
        z = np.empty(n)
        status, self.iterations, self._count = goldfarb_idnani.solve(
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
            qp.equal,
            self.tolerance,
            iteration_limit(qp),
            z,
            self._active,
            self._multiplier,
            self._count,
        )
        solved = status == goldfarb_idnani.OPTIMAL and bool(np.isfinite(z).all())
        if not solved:
            self.reset()
        return QpSolution(
            z, solved, f"{goldfarb_idnani.WORDS[status]} after {self.iterations} iterations"
        )

    def reset(self) -> None:
        """See QpBackend."""
        self._count = 0
