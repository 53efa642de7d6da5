"""Clears an area of objects: the next sweep, as the first of a tour of sweeps.

The tour takes all objects that any sweep takes, and is planned anew before every sweep, from the
poses that are seen then. Its cost is the way that the robot drives, and a little for turns on the
spot. Between sweeps the robot drives over a lattice. Places near objects cost more, but are not
forbidden: where there is no way round, the robot moves objects aside.
"""

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from push_model.arrays import Array
from push_model.outlines import distance, inside, overlap
from push_planner.covering_tour import covering_tour
from push_planner.sweeps import Area, Front, Sweep, run_up, shifts, sweeps

_PITCH = 0.25  # [m] of the lattice
_STEPS = ((1, 0), (0, 1), (1, 1), (1, -1), (2, 1), (1, 2), (2, -1), (1, -2))
_NEAR = ((0.9, 6.0), (1.25, 2.0))  # [m] from an object, and what a metre costs there beyond one
_FIXED = ((1.35, 200.0), (1.6, 2.0))  # of what is fixed
_TURN = 0.35  # [m/rad] of way that a turn on the spot is worth
_MARGIN = 0.12  # [m]


class AreaClearing:
    """Of one room. The clearances are those of a robot 2.4 m wide among objects of 1 m."""

    def __init__(self, area: Area, front: Front) -> None:
        self._area, self._front = area, front
        counts = (2.0 * area.limits / _PITCH).astype(int) + 1
        x, y = (np.linspace(-h, h, n) for h, n in zip(area.limits, counts, strict=True))
        self._shape = counts
        self._points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        self._from, self._to, self._length = self._edges()
        walls = (area.limits - np.abs(self._points)).min(axis=1)
        self._fixed = 1.0 + _dear(np.minimum(walls, self._away(area.fixed)), _FIXED)

    def next_sweep(self, pose: Array, boxes: Sequence[Array]) -> tuple[Array, Sweep] | None:
        """
        Parameters
        ----------
        pose: ``(3,)`` [m, rad] of the robot in the room.
        boxes: outlines ``(k, 2)`` [m] of all objects. Those that have left the area are ignored: to
            drive round them too takes a tenth more of way (four rooms of benchnpin), and one that
            is pushed back is swept once more.

        Returns
        -------
        Points ``(k, 2)`` [m] on the way to the sweep's start, which is the last of them, and the
        sweep. The bits of ``takes`` count the given objects. Where no sweep takes any object, a
        shift is returned in its place. None if the area is clear, or no shift helps.
        """
        within = [k for k, box in enumerate(boxes) if overlap(self._area.outline, box)]
        inner = [boxes[k] for k in within]
        there = sweeps(self._area, self._front, inner, _MARGIN)
        shifted = not there
        if shifted:
            there = shifts(self._area, self._front, inner, _MARGIN)
        if not there:
            return None
        there = [run_up(self._area, self._front, s, inner, _MARGIN) for s in there]
        dear = self._fixed + _dear(self._away(inner), _NEAR)
        starts = self._nearest(np.array([s.start for s in there]))
        ends = self._nearest(np.array([s.end for s in there]))
        here = self._nearest(pose[None, :2])[0]
        origins, rows = np.unique(np.append(ends, here), return_inverse=True)
        weight = 0.5 * self._length * (dear[self._from] + dear[self._to])
        graph = csr_matrix((weight, (self._from, self._to)), shape=(len(dear), len(dear)))
        far, back = dijkstra(graph, directed=False, indices=origins, return_predecessors=True)
        headings = np.array([s.heading for s in there])
        own = np.array([np.linalg.norm(s.end - s.start) for s in there])
        before = np.append(headings, pose[2])
        turns = np.abs(np.angle(np.exp(1j * (headings[None] - before[:, None]))))
        costs = far[rows][:, starts] + own + _TURN * turns
        if shifted:
            order = [int(costs[-1].argmin())]
        else:
            order = covering_tour(costs[-1], costs[:-1], np.array([s.takes for s in there]))
        chosen, place = there[order[0]], starts[order[0]]
        places = [place]
        while places[-1] != here:
            places.append(back[rows[-1], places[-1]])
        way = [pose[:2], *self._points[places[-2:0:-1]], chosen.start]
        takes = sum(1 << within[k] for k in range(len(within)) if chosen.takes >> k & 1)
        sweep = Sweep(chosen.start, chosen.end, chosen.heading, takes)
        return self._straightened(np.array(way), dear), sweep

    def _edges(self) -> tuple[Array, Array, Array]:
        """Numbers of the ends, and lengths [m], of the lattice's edges."""
        rows, columns = self._shape
        numbers = np.arange(rows * columns).reshape(rows, columns)
        one, other, length = [], [], []
        for down, right in _STEPS:
            at, to = max(0, -right), max(0, right)
            one.append(numbers[: rows - down, at : columns - to].ravel())
            other.append(numbers[down:, to : columns - at].ravel())
            length.append(np.full(len(one[-1]), _PITCH * np.hypot(down, right)))
        return np.concatenate(one), np.concatenate(other), np.concatenate(length)

    def _away(self, outlines: Sequence[Array]) -> Array:
        """[m] of each point of the lattice from the nearest outline; 0 within."""
        least = np.full(len(self._points), np.inf)
        for outline in outlines:
            away = distance(outline, self._points)
            away[inside(outline, self._points)] = 0.0
            least = np.minimum(least, away)
        return least

    def _nearest(self, points: Array) -> Array:
        """Numbers ``(k,)`` of the places of the lattice nearest to points ``(k, 2)``."""
        half, last = self._area.limits, self._shape - 1
        cells = np.clip(np.rint((points + half) / (2.0 * half) * last), 0, last).astype(int)
        numbers: Array = cells[:, 0] * self._shape[1] + cells[:, 1]
        return numbers

    def _straightened(self, way: Array, dear: Array) -> Array:
        """The way without the points between which a straight line costs no more."""

        def cost(a: Array, b: Array) -> float:
            length = float(np.linalg.norm(b - a))
            parts = np.linspace(0.0, 1.0, max(2, int(length / 0.1) + 1))
            return length * float(dear[self._nearest(a + parts[:, None] * (b - a))].mean())

        kept, at = [], 0
        while at < len(way) - 1:
            spent, best = cost(way[at], way[at + 1]), at + 1
            for to in range(at + 2, len(way)):
                spent += cost(way[to - 1], way[to])
                if cost(way[at], way[to]) <= 1.001 * spent:
                    best = to
            kept.append(way[best])
            at = best
        return np.array(kept)


def _dear(away: Array, levels: Sequence[tuple[float, float]]) -> Array:
    """What a metre costs beyond one at distances [m] from obstacles."""
    cost = np.zeros(len(away))
    for within, more in reversed(levels):
        cost[away < within] = more
    return cost
