"""A lattice of poses in a room, and the arcs and turns on the spot that join them.

An arc begins at a pose of the lattice and ends near another one, which stands for its end. Ways
over the lattice are therefore only good for robots that see where they are, and steer along them.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from push_model.arrays import Array

_PITCH = 0.125  # [m] of places
_HEADINGS = 32
_TURN = math.pi / 8.0  # [rad] of the tightest arc: two headings on
_BENDS = (-1.0, -0.5, 0.0, 0.5, 1.0)  # of the tightest one

Numbers = NDArray[np.int64]
Mask = NDArray[np.bool_]
Edges = tuple[Numbers, Numbers, Array]
"""From, to, and cost [m]; each ``(k,)``."""


class PoseLattice:
    """poses ``(n, 3)`` [m, m, rad] over a rectangle about the origin; axes ``(n, 2)``: cosine and
    sine of their headings."""

    def __init__(self, limits: Array, radius: float) -> None:
        """limits: ``(2,)`` [m] half the sides of the rectangle. radius: [m] of the tightest arc."""
        self._limits, self._radius = limits, radius
        self._counts = np.maximum((2.0 * limits / _PITCH).astype(int), 1)
        x, y = (
            (np.arange(n) + 0.5) * 2.0 * h / n - h
            for h, n in zip(limits, self._counts, strict=True)
        )
        headings = np.arange(_HEADINGS) * 2.0 * math.pi / _HEADINGS
        grid = np.meshgrid(x, y, headings, indexing="ij")
        self.poses = np.stack(grid, axis=-1).reshape(-1, 3)
        self.axes = np.column_stack([np.cos(self.poses[:, 2]), np.sin(self.poses[:, 2])])

    def nearest(self, poses: Array) -> Numbers:
        """Numbers ``(k,)`` of the poses nearest to poses ``(k, 3)``; -1 outside the rectangle."""
        cells = np.floor((poses[:, :2] + self._limits) / (2.0 * self._limits) * self._counts)
        within = ((cells >= 0) & (cells < self._counts)).all(axis=1)
        i, j = np.clip(cells, 0, self._counts - 1).astype(np.int64).T
        heading = np.rint(poses[:, 2] / (2.0 * math.pi) * _HEADINGS).astype(np.int64) % _HEADINGS
        return np.where(within, (i * self._counts[1] + j) * _HEADINGS + heading, -1)

    def relative(self, point: Array) -> tuple[Array, Array]:
        """[m] how far ahead and to the left of each pose a point ``(2,)`` lies, ``(n,)`` each."""
        x, y = (point - self.poses[:, :2]).T
        c, s = self.axes.T
        return c * x + s * y, c * y - s * x

    def arcs(self, free: Mask, sign: float, tight: float) -> Edges:
        """Arcs between free poses: ahead (sign 1) or back (-1).

        free: ``(n,)``. tight: part by which a metre of the tightest arc costs more than a straight
        one; of the one half as tight, a tenth of that.
        """
        found = []
        for bend in _BENDS:
            turn, length = bend * _TURN, _TURN * self._radius
            ends = self._driven(sign * length, sign * turn)
            to = self.nearest(ends)
            begins = np.flatnonzero(free & (to >= 0))
            begins = begins[free[to[begins]]]
            more = tight * {0.0: 0.0, 0.5: 0.1, 1.0: 1.0}[abs(bend)]
            found.append((begins, to[begins], np.full(len(begins), length * (1.0 + more))))
        return joined(found)

    def _driven(self, length: float, turn: float) -> Array:
        """``(n, 3)`` ends of arcs of this length [m], which turn so far [rad], from all poses."""
        half = 0.5 * turn
        chord = length * (math.sin(half) / half if turn else 1.0)
        course = self.poses[:, 2] + half
        way = chord * np.column_stack([np.cos(course), np.sin(course)])
        ends: Array = self.poses + np.column_stack([way, np.full(len(way), turn)])
        return ends

    def turns(self, where: Mask, cost: float) -> Edges:
        """Turns on the spot from a heading to the next one, where there is room ``(n,)``; each
        costs so much [m]."""
        begins = np.flatnonzero(where)
        heading = begins % _HEADINGS
        found = []
        for step in (1, -1):
            to = begins - heading + (heading + step) % _HEADINGS
            found.append((begins, to, np.full(len(begins), cost)))
        return joined(found)


def joined(edges: Sequence[Edges]) -> Edges:
    """All of them in one."""
    begins, to, costs = zip(*edges, strict=True)
    return np.concatenate(begins), np.concatenate(to), np.concatenate(costs)


def least_costs(edges: Edges, count: int, start: int) -> tuple[Array, Numbers]:
    """Cost [m] of the cheapest way from a node to each one, ``(count,)``, infinite where there is
    none; and the node before each on that way, negative where there is none."""
    begins, to, costs = edges  # no edge twice: their costs would be added
    graph = csr_matrix((costs, (begins, to)), shape=(count, count))
    cost, before = dijkstra(graph, indices=start, return_predecessors=True)
    return cost, before.astype(np.int64)


def costs_to(edges: Edges, count: int, goals: Mask) -> tuple[Array, Numbers]:
    """Cost [m] of the cheapest way from each node to one of the goals ``(count,)``, infinite where
    there is none; and the next node on it, negative at goals and where there is no way."""
    begins, to, costs = edges
    there = np.flatnonzero(goals)
    if not len(there):
        return np.full(count, np.inf), np.full(count, -1, dtype=np.int64)
    tiny = np.full(len(there), 1e-9)  # an edge of cost 0 would be none
    back = joined([(to, begins, costs), (np.full(len(there), count), there, tiny)])
    cost, following = least_costs(back, count + 1, count)
    cost, following = cost[:-1], following[:-1]
    following[following == count] = -1
    return cost, following
