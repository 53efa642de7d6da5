"""Walls of a map, for the robots of a swarm: distances, lines of sight, and paths round corners."""

from typing import Any

import numba
import numpy as np

from push_model.arrays import Array, Mask
from push_model.flood import Flood
from push_model.free_space import FreeSpace, sees
from push_model.grid_search import DONE, SEEN, STRAIGHT, nearest_place
from push_model.obstacles import NOTHING
from push_model.occupancy import OccupancyGrid
from push_model.room import STEPS
from swarm_push.region import is_open

_LATTICE = 0.03  # [m] between places of robots' ways
_SPARE = 0.01  # [m] that ways keep from walls beside the robot's radius
_LEAST = 0.5  # part of its radius that the centre of a robot always keeps from walls
_AHEAD = 20  # places of its path among which a robot heads for the farthest one that it sees
_NEAR = 8  # places in each direction among which a robot looks for one that it sees
_MOVED = 0.03  # [m] of motion of the object after which the paths to it are computed again
_STEP = 0.01  # [m] of the differences that give the direction of the nearest wall
_BUDGET = 6_000  # places that a tick adds to the paths, which takes about 1 ms


class Walls:
    """The walls of a map, for round robots of one radius [m].

    open: whether the only walls are those of the room."""

    def __init__(self, grid: OccupancyGrid, radius: float) -> None:
        """grid: the map, with at least one place where a robot has room."""
        self.grid, self._radius, self.open = grid, radius, is_open(grid)
        self.space = FreeSpace(grid, _LATTICE)
        self._field = self.space.field
        self._need = (radius + _SPARE) / self._field.spacing
        self._ways: Flood | None = None  # to where the object was
        self._newer: Flood | None = None  # to where it is, while they are looked for
        self._towards = np.full(2, np.inf)
        self._load()

    def _load(self) -> None:
        """Load what is compiled, so that no tick waits for it."""
        here = self._field.lattice(np.array([self.grid.origin]))
        flood = self._flood_from(here[0])
        _are_reached(flood.state, flood.stride, here)
        farthest_seen(self._field.values, flood.state, flood.cost, flood.stride, here, 1.0, 1.0)
        flood.step(1)
        self.into_room(np.array([self.grid.origin]))

    def clearance(self, points: Array) -> Array:
        """``(n,)`` [m] of points ``(n, 2)`` to walls."""
        return self.space.clearance(points)

    def free(self, points: Array) -> Mask:
        """Which centres of robots at ``(n, 2)`` [m] are clear of walls."""
        clear: Mask = self.space.clearance(points) >= self._radius
        return clear

    def into_room(self, points: Array) -> Array:
        """Points ``(n, 2)`` [m]; those too close to walls are moved to the nearest free place."""
        found, stride = points.copy(), self.space.stride
        for k in np.flatnonzero(~self.free(points)):
            u, v = self._field.lattice(points[k])
            i, j = nearest_place(
                self._field.values, self._need**2, np.inf, stride, float(stride), u, v
            )
            if i >= 0:
                found[k] = self.space.metres(np.array([j, i]) * stride)
        return found

    def bounds(self, points: Array, rate: float, gap: float) -> Array:
        """Speed limits towards walls of robots at ``(n, 2)`` [m].

        Returns ``(n, 3)``: the unit vector towards the nearest wall, and the greatest speed [m/s]
        along it, which is ``rate`` [1/s] times the distance left beyond ``gap`` [m].
        """
        here = self.space.clearance(points)
        most = rate * (here - self._radius - gap)
        unit = self.towards(points)
        most[~unit.any(axis=1)] = np.inf
        return np.column_stack([unit, most])

    def towards(self, points: Array) -> Array:
        """See ``towards_walls``."""
        return towards_walls(self.space, points)

    def round_corners(
        self, robots: Array, aims: Array, length: Array, item: Array
    ) -> tuple[Array, Array]:
        """Next points for robots ``(n, 2)`` [m] on their way to aims ``(n, 2)`` round an object.

        A robot that sees its aim heads for it. Any other one follows the shortest path along the
        walls to the object at ``item (2,)``. The paths are computed in slices, one a call. Until a
        robot's path is known, the robot stops. A robot that has none keeps its aim.

        Returns
        -------
        Points ``(n, 2)`` [m] to head for, and lengths ``(n,)`` [m] of the ways that are left; those
        of robots that see their aims are ``length``.
        """
        hidden = np.flatnonzero(~self.sees(robots, aims))
        if not len(hidden):
            return aims, length
        here = self._field.lattice(robots[hidden])
        ways = self._ways_to(item, here)
        found, lengths = farthest_seen(
            self._field.values,
            ways.state,
            ways.cost,
            ways.stride,
            here,
            self._radius / self._field.spacing,
            _LEAST * self._radius / self._field.spacing,
        )
        known = np.isfinite(lengths)
        aims, length = aims.copy(), length.copy()
        some = hidden[known]
        aims[some] = self.space.metres(found[known])
        length[some] = lengths[known] * self._field.spacing
        if not ways.done:
            aims[hidden[~known]] = robots[hidden[~known]]
        return aims, length

    def sees(self, here: Array, there: Array) -> Mask:
        """Which robots can move straight from ``here`` to ``there (n, 2)`` [m], at any distance."""
        return self.space.sees(here, there, self._radius, _LEAST * self._radius)

    def _flood_from(self, tip: Array) -> Flood:
        """Ways from a point ``(2,)`` in lattice spacings."""
        nothing, stride = self.space.capsules(NOTHING), self.space.stride
        return Flood.of_disc(self._field.values, nothing, tip, self._need, stride)

    def _ways_to(self, item: Array, here: Array) -> Flood:
        """Paths to the object, for robots at ``(n, 2)`` [lattice spacings].

        While paths to its present position are computed, those to its former position are used.
        """
        if self._newer is None and np.hypot(*(item - self._towards)) > _MOVED:
            self._newer = self._flood_from(self._field.lattice(item))
            self._towards = np.array(item)
        ways = self._newer if self._newer is not None else self._ways
        assert ways is not None
        if not ways.done and not _are_reached(ways.state, ways.stride, here):
            ways.step(_BUDGET)
        if self._ways is None or ways.done or _are_reached(ways.state, ways.stride, here):
            self._ways, self._newer = ways, None
        return self._ways


def towards_walls(space: FreeSpace, points: Array) -> Array:
    """Unit vectors ``(n, 2)`` from points ``(n, 2)`` [m] towards the nearest wall.

    Zero where two walls are equally near.
    """
    around = points + _STEP * np.array([[[1.0, 0.0]], [[-1, 0]], [[0, 1]], [[0, -1]]])
    east, west, north, south = space.clearance(around.reshape(-1, 2)).reshape(4, -1)
    away = np.column_stack([west - east, south - north])
    length = np.hypot(*away.T)
    part = np.where(length > 1e-6, 1.0, 0.0) / np.maximum(length, 1e-9)
    unit: Array = part[:, None] * away
    return unit


@numba.njit(cache=True)
def _are_reached(state: Any, stride: int, here: Any) -> bool:
    """Whether paths are known to a place beside each of the points."""
    rows, columns = state.shape
    for k in range(here.shape[0]):
        some = False
        for di in range(2):
            for dj in range(2):
                i, j = int(here[k, 1] / stride) + di, int(here[k, 0] / stride) + dj
                if 0 <= i < rows and 0 <= j < columns:
                    some = some or DONE <= state[i, j] < 2 * DONE
        if not some:
            return False
    return True


@numba.njit(cache=True)
def farthest_seen(
    field: Any, state: Any, cost: Any, stride: int, here: Any, radius: float, least: float
) -> Any:
    """The farthest point on its path that each robot sees, and the length of the path; infinite
    where none is known. In lattice spacings."""
    rows, columns = state.shape
    found, lengths = here.copy(), np.full(here.shape[0], np.inf)
    for k in range(here.shape[0]):
        u, v = here[k, 0], here[k, 1]
        best, bi, bj = np.inf, -1, -1
        ci, cj = int(round(v / stride)), int(round(u / stride))
        for i in range(max(0, ci - _NEAR), min(rows - 1, ci + _NEAR) + 1):
            for j in range(max(0, cj - _NEAR), min(columns - 1, cj + _NEAR) + 1):
                if not DONE <= state[i, j] < 2 * DONE:
                    continue
                x, y = 1.0 * j * stride, 1.0 * i * stride
                away = np.hypot(x - u, y - v)
                if away < best and sees(field, u, v, x, y, radius, least):
                    best, bi, bj = away, i, j
        if bi < 0:  # from where it stands it sees none: to the nearest one
            bi, bj = nearest_place(state, DONE, 2 * DONE - 1, 1, 1.0 * stride, u, v)
            if bi < 0:
                continue
            best = np.hypot(1.0 * bj * stride - u, 1.0 * bi * stride - v)
        lengths[k] = best + cost[bi, bj] * stride / STRAIGHT
        found[k, 0], found[k, 1] = 1.0 * bj * stride, 1.0 * bi * stride
        for _ in range(_AHEAD):
            way = state[bi, bj] - DONE
            if way == SEEN:
                break
            bi, bj = bi - STEPS[way - 1, 0], bj - STEPS[way - 1, 1]
            x, y = 1.0 * bj * stride, 1.0 * bi * stride
            if sees(field, u, v, x, y, radius, least):
                found[k, 0], found[k, 1] = x, y
    return found, lengths
