"""Walls of a map as a swarm meets them: where robots have room, and their ways round corners."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from push_model.arrays import Array, Mask
from push_model.free_space import FreeSpace, Obstacles, Reach
from push_model.occupancy import OccupancyGrid
from swarm_push.region import is_open

_LATTICE = 0.05  # [m] of robots' ways
_SPARE = 0.01  # [m] that ways keep from walls besides the robot's radius
_LEAST = 0.5  # of its radius that the centre of a robot is always away from walls
_LINE = 24  # points of a straight line that are looked at
_AHEAD = 12  # places of the lattice, at most, that a robot looks ahead on its way
_MOVED = 0.03  # [m] of the object until ways to it are looked for again
_STEP = 0.01  # [m] of differences that tell where a wall is


class Walls:
    """For round robots of one radius [m]. open: whether they are only round the room."""

    def __init__(self, grid: OccupancyGrid, radius: float) -> None:
        """grid: the map, with at least one place where a robot has room."""
        self.grid, self._radius, self.open = grid, radius, is_open(grid)
        self._space = FreeSpace(grid, _LATTICE)
        roomy = self._space.clearance(self._space.places) >= radius + _SPARE
        self._roomy = self._space.places[roomy]
        self._tree = cKDTree(self._roomy)
        self._reach: Reach | None = None
        self._reached: tuple[NDArray[np.int64], cKDTree] | None = None
        self._towards = np.full(2, np.inf)

    def clearance(self, points: Array) -> Array:
        """``(n,)`` [m] of points ``(n, 2)`` to walls."""
        return self._space.clearance(points)

    def free(self, points: Array) -> Mask:
        """Which centres of robots at ``(n, 2)`` [m] are clear of walls."""
        clear: Mask = self._space.clearance(points) >= self._radius
        return clear

    def into_room(self, points: Array) -> Array:
        """``(n, 2)`` [m] the points, those in walls moved to the nearest place with room."""
        found = points.copy()
        out = ~self.free(points)
        if out.any():
            found[out] = self._roomy[self._tree.query(points[out])[1]]
        return found

    def bounds(self, points: Array, rate: float, gap: float) -> Array:
        """``(n, 3)`` a unit vector towards the nearest wall of each robot at ``(n, 2)`` [m], and
        how fast [m/s] it may go along it: so much [1/s] of what is left beyond a gap [m]."""
        here = self._space.clearance(points)
        most = rate * (here - self._radius - gap)
        unit = self.towards(points)
        most[~unit.any(axis=1)] = np.inf
        return np.column_stack([unit, most])

    def towards(self, points: Array) -> Array:
        """``(n, 2)`` unit vectors towards the nearest wall of points ``(n, 2)`` [m]; zero where
        there is none nearer than others."""
        around = points + _STEP * np.array([[[1.0, 0.0]], [[-1, 0]], [[0, 1]], [[0, -1]]])
        east, west, north, south = self._space.clearance(around.reshape(-1, 2)).reshape(4, -1)
        away = np.column_stack([west - east, south - north])
        length = np.hypot(*away.T)
        part = np.where(length > 1e-6, 1.0, 0.0) / np.maximum(length, 1e-9)
        unit: Array = part[:, None] * away
        return unit

    def round_corners(
        self, robots: Array, aims: Array, length: Array, item: Array
    ) -> tuple[Array, Array]:
        """Where robots ``(n, 2)`` [m] head for that want to go to aims ``(n, 2)`` about an object
        at ``item (2,)``, and how far ``(n,)`` [m] they have to go: to the aims where they see them,
        along walls towards the object elsewhere."""
        hidden = np.flatnonzero(~self.sees(robots, aims))
        if not len(hidden):
            return aims, length
        reach, (places, tree) = self._ways_to(item)
        if not len(places):
            return aims, length
        aims, length = aims.copy(), length.copy()
        here = robots[hidden]
        place = places[tree.query(here)[1]]
        length[hidden] = reach.lengths[place]
        found = self._space.places[place]
        count = len(self._space.places)
        for _ in range(_AHEAD):
            place = np.where((place >= 0) & (place < count), reach.before[place], -1)
            there = (place >= 0) & (place < count)
            nodes = self._space.places[np.where(there, place, 0)]
            better = there & self.sees(here, nodes)
            found = np.where(better[:, None], nodes, found)
        aims[hidden] = found
        return aims, length

    def sees(self, here: Array, there: Array) -> Mask:
        """Whether robots can go straight to places, all ``(n, 2)`` [m]."""
        part = np.linspace(0.0, 1.0, _LINE)[:, None, None]
        line = (here + part * (there - here)).reshape(-1, 2)
        room = self._space.clearance(line).reshape(_LINE, -1)
        need = np.minimum(self._radius, np.minimum(room[0], room[-1]))
        need = np.maximum(need, _LEAST * self._radius)  # no line ends in a wall
        seen: Mask = room.min(axis=0) >= need - 1e-9
        return seen

    def _ways_to(self, item: Array) -> tuple[Reach, tuple[NDArray[np.int64], cKDTree]]:
        """Ways of robots from everywhere to the object, and the places that have one."""
        if self._reach is None or np.hypot(*(item - self._towards)) > _MOVED:
            self._reach = self._space.from_here(item, self._radius + _SPARE, Obstacles())
            places = np.flatnonzero(np.isfinite(self._reach.lengths))
            self._reached = places, cKDTree(self._space.places[places].reshape(-1, 2))
            self._towards = np.array(item)
        assert self._reached is not None
        return self._reach, self._reached
