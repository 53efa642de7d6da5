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
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Qp:
    """One quadratic programme; the arrays are reused from tick to tick.

    H ``(n, n)`` positive definite; f, low, high ``(n,)``. Outputs y_k = g_k + S_k u with S
    ``(K, o, nu)``, g ``(K, o)``; width ``(K,)``: only so many inputs move output k. Row j of step
    k: normal[k, :, j] . y_k - slack <= bound[k, j], with normal ``(K, o, r)`` and bound ``(K, r)``
    (inf: no row); its slack is z[nu + family[j]], none where family ``(r,)`` is negative. Where
    equal ``(r,)`` is set, the row holds with equality; such a row has no slack.

    Raises
    ------
    ValueError: an equality with a slack.
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
    equal: Flags

    def __post_init__(self) -> None:
        if (self.family[self.equal] >= 0).any():
            raise ValueError("an equality cannot be softened: its family must be -1")

    def rooms(self, z: Array) -> Array:
        """Room of each row ``(K r,)``; negative where violated (for equalities: nonzero)."""
        y, room = np.empty(self.g.shape), np.empty(self.bound.shape)
        kernels.outputs(self.S, self.g, self.width, z, y)
        slack = np.append(z[self.S.shape[2] :], 0.0)[self.family]
        kernels.rooms(self.normal, self.bound, y, slack, room)
        return room.ravel()

    def violation(self, z: Array) -> float:
        """Greatest violation of a row or a bound, in its own unit; 0.0 when there is none."""
        room = self.rooms(z).reshape(self.bound.shape)
        off = np.where(self.equal & ~np.isposinf(room), np.abs(room), -room)
        beyond = np.maximum(self.low - z, z - self.high)
        return float(max(off.max(initial=0.0), beyond.max(initial=0.0)))

    def rows(self, numbers: Index) -> tuple[Array, Array]:
        """Rows k r + j written out: G ``(m, n)`` and b ``(m,)`` of G z <= b, or = b."""
        G, b = np.empty((len(numbers), len(self.f))), np.empty(len(numbers))
        kernels.write_rows(
            self.S, self.g, self.width, self.normal, self.bound, self.family, numbers, G, b
        )
        return G, b

    def all_rows(self) -> Index:
        """Numbers of the rows that are switched on."""
        return np.flatnonzero(~np.isposinf(self.bound))

    def equalities(self, numbers: Index) -> Flags:
        """Which of these rows ``(m,)`` hold with equality."""
        chosen: Flags = self.equal[numbers % self.bound.shape[1]]
        return chosen

    @staticmethod
    def dense(
        H: Array,
        f: Array,
        G: Array,
        b: Array,
        low: Array,
        high: Array,
        E: Array | None = None,
        d: Array | None = None,
    ) -> "Qp":
        """A programme given by plain rows G z <= b and E z = d: one step whose outputs are z."""
        n = len(f)
        if E is None or d is None:
            E, d = np.zeros((0, n)), np.zeros(0)
        none = np.full(len(d) + len(b), -1, dtype=np.int64)
        equal = np.arange(len(none)) < len(d)
        width = np.array([n], dtype=np.int64)
        normal = np.ascontiguousarray(np.vstack([E, G]).T)[None]
        bound = np.concatenate([d, b])[None]
        return Qp(
            H, f, low, high, np.eye(n)[None], np.zeros((1, n)), width, normal, bound, none, equal
        )


@dataclass(frozen=True)
class QpSolution:
    """z ``(n,)``; solved: the solver succeeded and z is finite; status: the solver's own."""

    z: Array
    solved: bool
    status: str


class QpBackend(Protocol):
    """A solver. It may remember the last solution; ``reset`` forgets it."""

    def solve(self, qp: Qp) -> QpSolution:
        """Solve it."""
        ...

    def reset(self) -> None:
        """Forget the last solution."""
        ...
