"""Shortest paths of a disc from one point to all others: Dijkstra on a lattice.

The work can be split: ``step`` settles a given number of places. Lengths and points are in lattice
spacings of the ``DistanceField``, see ``room.py``.
"""

import math

import numpy as np

from push_model.arrays import Array, Mask
from push_model.bucket_queue import new_pool, push
from push_model.disc_way import relief
from push_model.grid_search import DONE, SEEN, STRAIGHT, back, block, expand, nearest_place, seeds
from push_model.room import room_at

_REACH = 2  # places in each direction that the start joins
_NO_TARGET = np.full((4, 2), -1, dtype=np.int64)
_NO_GOAL = np.zeros(2, dtype=np.int64)
_NO_ENDS = np.zeros((0, 4))


def lattice_loss(need: float, stride: int) -> float:
    """Room beyond ``need`` at both ends of a diagonal that ensures ``need`` all along it."""
    return math.sqrt(need**2 + 0.5 * stride**2) - need


class Flood:
    """Paths to every ``stride``-th point of a field's lattice, as far as they are known.

    state ``(rows, columns)``: how each place was reached, see ``grid_search.py``. cost ``(rows,
    columns)``: of the path to it; a step to a side costs ``STRAIGHT``.
    """

    def __init__(
        self, field: Array, capsules: Array, need: float, stride: int, ends: Array = _NO_ENDS
    ) -> None:
        """need: room at places. Nothing is reached before ``begin_at`` or ``begin``."""
        rows, columns = (field.shape[0] - 1) // stride + 1, (field.shape[1] - 1) // stride + 1
        self.stride, self.need = stride, need
        self._field, self._ends = field, ends
        self.state = np.zeros((rows, columns), dtype=np.uint8)
        self.cost = np.empty((rows, columns), dtype=np.int32)
        block(self.state, capsules, ends, need, stride)
        self._front = np.zeros(4, dtype=np.int64)
        self._heads = np.zeros(1, dtype=np.int32)
        self._pool = new_pool()

    @classmethod
    def of_disc(
        cls, field: Array, capsules: Array, start: Array, need: float, stride: int
    ) -> "Flood":
        """A flood from a point, for a disc whose centre keeps ``need`` on all its paths.

        If it starts closer to an obstacle than that, it may not come closer on its way out.
        """
        room = room_at(field, capsules, 0.0, start[0], start[1])
        ends = np.array([[*start, *relief(field, capsules, 0.0, start, room, need, 0.0)]])
        loss = lattice_loss(need, stride)
        widened = ends + [0.0, 0.0, 0.0, loss] * (ends[:, 3:] > 0.0)
        flood = cls(field, capsules, need + loss, stride, widened)
        flood.begin(seeds(field, capsules, ends, need, start, stride, _REACH))
        return flood

    def begin(self, places: Array) -> None:
        """Start at places ``(n, 3)``: row, column, and the cost of reaching them."""
        most = int(places[:, 2].max(initial=0))
        self._heads = np.zeros(most + 64, dtype=np.int32)
        for i, j, cost in places.tolist():
            if self.state[i, j] != SEEN or cost < self.cost[i, j]:
                self.state[i, j], self.cost[i, j] = SEEN, cost
                self._pool = push(self._heads, self._pool, cost, i * self.state.shape[1] + j)
                self._front[1] += 1

    @property
    def done(self) -> bool:
        """Whether all places that can be reached have been reached."""
        return bool(self._front[1] == 0)

    @property
    def frontier(self) -> int:
        """Cost of the last place reached; every place not yet reached costs at least as much."""
        return int(self._front[2])

    def step(self, budget: int) -> bool:
        """Reach up to ``budget`` more places; returns ``done``."""
        self._pool, _ = expand(
            self._field,
            self._ends,
            0.0,
            self.need,
            self.stride,
            self.state,
            self.cost,
            self._heads,
            self._pool,
            self._front,
            _NO_GOAL,
            _NO_TARGET,
            0.0,
            budget,
        )
        return self.done

    @property
    def reached(self) -> Mask:
        """``(rows, columns)`` of bool."""
        found: Mask = (self.state & DONE > 0) & (self.state < 2 * DONE)
        return found

    @property
    def lengths(self) -> Array:
        """Path lengths ``(rows, columns)``; infinite where none is known yet."""
        found: Array = np.where(self.reached, self.cost * (self.stride / STRAIGHT), np.inf)
        return found

    def nearest(self, point: Array) -> tuple[int, int]:
        """Row and column of the reached place nearest to a point; -1, -1 if none is reached."""
        i, j = nearest_place(
            self.state, DONE, 2 * DONE - 1, 1, float(self.stride), point[0], point[1]
        )
        return int(i), int(j)

    def back(self, index: int) -> Array:
        """Corners ``(n, 2)`` of the path from a reached place, by its number, back to the start."""
        found: Array = back(self.state, index, self.stride)
        return found
