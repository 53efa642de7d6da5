"""The condensed quadratic programme of a tick, and one interface for every solver of it.

minimise 1/2 z'Hz + f'z with z = (u, slacks), low <= z <= high, and rows on each step's outputs.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from push_model.arrays import Array
from push_qp import rows as kernels

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
        kernels.outputs(self.S, self.g, self.width, z, y)
        slack = np.append(z[self.S.shape[2] :], 0.0)[self.family]
        kernels.rooms(self.normal, self.bound, y, slack, room)
        return room.ravel()

    def rows(self, numbers: Index) -> tuple[Array, Array]:
        """Rows k r + j written out: G ``(m, n)`` and b ``(m,)`` of G z <= b."""
        G, b = np.empty((len(numbers), len(self.f))), np.empty(len(numbers))
        for i, number in enumerate(numbers):
            k, j = divmod(int(number), self.bound.shape[1])
            b[i] = kernels.write_row(
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
