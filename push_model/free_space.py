"""Room for round robots on a map, and their ways through it.

The library's shortest paths on a lattice (scipy.sparse.csgraph), then straight lines where there is
room for them. Fine enough for robots that go one after the other round an object; for narrow
passages there is the planner of one robot (push_planner).
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, map_coordinates
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from push_model.arrays import Array, Mask
from push_model.occupancy import OccupancyGrid
from push_model.outlines import distance, inside

_NEAR = 0.12  # [m] from an end of a way within which it joins the lattice
_INEXACT = math.sqrt(0.5) + 0.125  # [cells]
_SAMPLE = 0.01  # [m] between points of a line that are looked at


@dataclass(frozen=True)
class Obstacles:
    """What stands on a map beside its walls.

    outlines: ``(m, 2)`` each, world frame. discs ``(k, 3)`` x, y, radius [m].
    """

    outlines: tuple[Array, ...] = ()
    discs: Array = field(default_factory=lambda: np.zeros((0, 3)))


class FreeSpace:
    """Distances on a map, and a lattice of places on it."""

    def __init__(self, grid: OccupancyGrid, spacing: float = 0.03) -> None:
        """spacing: [m] of the lattice."""
        padded = np.pad(grid.occupied, 1, constant_values=True)
        self._field = distance_transform_edt(~padded) * grid.resolution
        self._origin, self._cell = grid.origin - 0.5 * grid.resolution, grid.resolution
        x0, x1, y0, y1 = grid.extent
        xs, ys = (np.arange(a + 0.5 * spacing, b, spacing) for a, b in ((x0, x1), (y0, y1)))
        gx, gy = np.meshgrid(xs, ys)
        self.places = np.column_stack([gx.ravel(), gy.ravel()])
        """``(k, 2)`` [m] of the lattice."""
        self.shape = gx.shape
        self._room = self.clearance(self.places)
        number = np.arange(len(self.places)).reshape(self.shape)
        pairs = [
            (number[:, :-1], number[:, 1:]),
            (number[:-1], number[1:]),
            (number[:-1, :-1], number[1:, 1:]),
            (number[1:, :-1], number[:-1, 1:]),
        ]
        self._first = np.concatenate([a.ravel() for a, _ in pairs])
        self._second = np.concatenate([b.ravel() for _, b in pairs])
        self._length = np.hypot(*(self.places[self._first] - self.places[self._second]).T)

    def clearance(self, points: Array) -> Array:
        """``(n,)`` [m] from points ``(n, 2)`` to the map's obstacles and edges; 0 in them.

        Distances between the cells' centres are more than those to their squares by at most half a
        diagonal, and between the centres they are interpolated: both are taken off.
        """
        where = (np.asarray(points) - self._origin).T / self._cell
        found = map_coordinates(self._field, where[::-1], order=1, mode="constant", cval=0.0)
        room: Array = np.maximum(0.0, found - _INEXACT * self._cell)
        return room

    def room(self, points: Array, among: Obstacles) -> Array:
        """``(n,)`` [m] from points to anything; 0 in it."""
        points = np.asarray(points, dtype=np.float64)
        return self._least(points, self.clearance(points), among)

    @staticmethod
    def _least(points: Array, room: Array, among: Obstacles) -> Array:
        for outline in among.outlines:
            away = np.where(inside(outline, points), 0.0, distance(outline, points))
            room = np.minimum(room, away)
        for x, y, radius in among.discs:
            gap = np.hypot(points[:, 0] - x, points[:, 1] - y) - radius
            room = np.minimum(room, np.maximum(0.0, gap))
        return room

    def from_here(self, start: Array, radius: float, among: Obstacles) -> "Reach":
        """Everywhere that the centre of a disc can go from a place ``(2,)``, ``radius`` [m] away
        from everything; where it starts with less room it only has to come away."""
        room = self._least(self.places, self._room, among)
        return Reach(self, np.asarray(start, dtype=np.float64), radius, among, room >= radius)

    def edges(self, free: Mask) -> csr_matrix:
        """Lengths [m] between neighbours of the lattice that are both free."""
        keep = free[self._first] & free[self._second]
        count = len(self.places)
        return csr_matrix(
            (self._length[keep], (self._first[keep], self._second[keep])), shape=(count, count)
        )

    def line_keeps(self, a: Array, b: Array, radius: float, among: Obstacles) -> bool:
        """Whether a disc keeps so far [m] from everything on a straight line, or as far as at the
        end that has less room."""
        steps = max(2, math.ceil(float(np.hypot(*(b - a))) / _SAMPLE) + 1)
        room = self.room(a + np.linspace(0.0, 1.0, steps)[:, None] * (b - a), among)
        least = min(radius, float(room[0]), float(room[-1]))
        return bool((room >= least - 1e-9).all())


class Reach:
    """Where a disc can go from one place, and how."""

    def __init__(
        self, space: FreeSpace, start: Array, radius: float, among: Obstacles, free: Mask
    ) -> None:
        """free: places of the lattice where it has room."""
        self._space, self._start, self._radius, self._among = space, start, radius, among
        self.free = free
        count = len(space.places)
        near = self._joined(start)
        graph = space.edges(free)
        away = np.hypot(*(space.places[near] - start).T)
        # One more node, the start, with a way to each of its neighbours.
        data = np.concatenate([graph.data, away])
        lattice = graph.tocoo()
        rows = np.concatenate([lattice.row, np.full(len(near), count)])
        columns = np.concatenate([lattice.col, near])
        whole = csr_matrix((data, (rows, columns)), shape=(count + 1, count + 1))
        lengths, before = dijkstra(whole, directed=False, indices=count, return_predecessors=True)
        self.lengths: Array = lengths[:-1]
        """``(k,)`` [m] of the ways to the places of the lattice; inf where there is none."""
        self.before: NDArray[np.int64] = before
        """``(k + 1,)`` the place before each on its way; no place's number at the start."""

    def _joined(self, point: Array) -> NDArray[np.int64]:
        """Places of the lattice that a point has a straight line to."""
        space = self._space
        away = np.hypot(*(space.places - point).T)
        near = np.flatnonzero(self.free & (away < _NEAR))
        near = near[np.argsort(away[near], kind="stable")][:12]
        keeps = [space.line_keeps(point, space.places[k], self._radius, self._among) for k in near]
        joined: NDArray[np.int64] = near[np.array(keeps, dtype=bool)]
        return joined

    def way_to(self, goal: Array) -> Array | None:
        """Corners ``(n, 2)`` [m] of a short way to a place; None where there is none."""
        space, goal = self._space, np.asarray(goal, dtype=np.float64)
        if space.line_keeps(self._start, goal, self._radius, self._among):
            return np.vstack([self._start, goal])
        ends = self._joined(goal)
        if not len(ends):
            return None
        total = self.lengths[ends] + np.hypot(*(space.places[ends] - goal).T)
        best = int(np.argmin(total))
        if not np.isfinite(total[best]):
            return None
        return self._straight(np.vstack([self._lattice_way(int(ends[best])), goal]))

    def way_to_place(self, place: int) -> Array:
        """The same to a place of the lattice, by its number; it can be reached."""
        return self._straight(self._lattice_way(place))

    def _lattice_way(self, place: int) -> Array:
        points = []
        while 0 <= place < len(self._space.places):
            points.append(self._space.places[place])
            place = int(self.before[place])
        return np.vstack([self._start, *points[::-1]])

    def _straight(self, points: Array) -> Array:
        """Fewer corners: from each as far as a straight line goes."""
        kept, k = [points[0]], 0
        while k < len(points) - 1:
            ahead = len(points) - 1
            while ahead > k + 1 and not self._space.line_keeps(
                points[k], points[ahead], self._radius, self._among
            ):
                ahead = k + max(1, (ahead - k) // 2)
            k = ahead
            kept.append(points[k])
        return np.array(kept)
