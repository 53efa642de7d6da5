"""Free space on a map for round robots, and their paths through it.

This is the interface in metres and world coordinates. The compiled functions that it calls work in
lattice spacings of the distance field (``room.py``, ``grid_search.py``, ``flood.py``).
"""

import math
from functools import cached_property
from typing import Any

import numba
import numpy as np

from push_model.arrays import Array, Mask, Rows
from push_model.disc_way import disc_way, reliefs, straight_keeps
from push_model.distance_field import DistanceField, lookup, lookups, square_at
from push_model.flood import Flood
from push_model.obstacles import (
    NOTHING,
    Obstacles,
    inside_outlines,
    point_gap,
    scaled_capsules,
)
from push_model.room import segment_keeps, straightened

__all__ = ["FreeSpace", "Obstacles", "Reach"]

_NO_ENDS, _NO_CAPSULES = np.zeros((0, 4)), np.zeros((0, 5))
_SPARE = 0.05
"""[lattice spacings] by which a line may come closer to an obstacle than its tighter end. The lower
bound along a line is smaller than the bounds at its points by up to this much."""


@numba.njit(cache=True)
def _rooms(
    field: Any,
    capsules: Any,
    corners: Any,
    last: Any,
    points: Any,
    ox: float,
    oy: float,
    scale: float,
) -> Any:
    found = np.empty(points.shape[0])
    for k in range(points.shape[0]):
        x, y = points[k, 0], points[k, 1]
        room = lookup(field, x, y, ox, oy, scale)
        for m in range(capsules.shape[0]):
            room = min(room, point_gap(capsules, m, x, y))
        if room > 0.0 and inside_outlines(corners, last, x, y):
            room = 0.0
        found[k] = max(0.0, room)
    return found


@numba.njit(cache=True)
def sees(field: Any, u0: float, v0: float, u1: float, v1: float, need: float, least: float) -> bool:
    """Whether a disc can move straight from one point to another; only the map is considered.

    The centre must keep the distance ``need``. If an end is closer to an obstacle than that, the
    distance at this end is required instead, but never less than ``least``. Lengths are in lattice
    spacings.
    """
    for u, v in ((u0, v0), (u1, v1)):
        need = min(need, math.sqrt(max(0.0, square_at(field, u, v))) - _SPARE)
    return bool(
        need >= least - 1e-9
        and segment_keeps(field, _NO_CAPSULES, 0.0, _NO_ENDS, need, u0, v0, u1, v1)
    )


@numba.njit(cache=True)
def _all_see(field: Any, here: Any, there: Any, need: float, least: float) -> Any:
    found = np.empty(here.shape[0], dtype=np.bool_)
    for k in range(here.shape[0]):
        found[k] = sees(field, here[k, 0], here[k, 1], there[k, 0], there[k, 1], need, least)
    return found


class FreeSpace:
    """Distances on a map, and a lattice of places on it.

    Attributes
    ----------
    field: the map's distance field.
    stride: distance between neighbouring places, in lattice spacings of the field.
    shape: rows and columns of places.
    """

    def __init__(self, grid: Any, spacing: float = 0.03) -> None:
        """grid: an ``OccupancyGrid``, or its ``DistanceField``. spacing: [m] about, of places."""
        self.field = grid if isinstance(grid, DistanceField) else DistanceField(grid)
        self.stride = max(1, round(spacing / self.field.spacing))
        rows, columns = self.field.values.shape
        self.shape = (rows - 1) // self.stride + 1, (columns - 1) // self.stride + 1

    @cached_property
    def places(self) -> Array:
        """``(k, 2)`` [m] of the lattice, row by row."""
        rows, columns = self.shape
        return self.at(np.arange(rows * columns))

    def near(self, point: Array, away: float) -> Rows:
        """Numbers of the places closer than ``away`` [m] to a point ``(2,)``, the nearest first."""
        rows, columns = self.shape
        x, y = self.field.lattice(point) / self.stride
        reach = away / (self.stride * self.field.spacing)
        i = np.arange(max(0, math.ceil(y - reach)), min(rows - 1, math.floor(y + reach)) + 1)
        j = np.arange(max(0, math.ceil(x - reach)), min(columns - 1, math.floor(x + reach)) + 1)
        gap = np.hypot(*np.meshgrid(i - y, j - x, indexing="ij")).ravel()
        number = (i[:, None] * columns + j).ravel()
        some = np.flatnonzero(gap < reach)
        found: Rows = number[some[np.argsort(gap[some], kind="stable")]]
        return found

    def at(self, places: Rows) -> Array:
        """``(n, 2)`` [m] of places by their numbers."""
        i, j = np.divmod(places, self.shape[1])
        return self.metres(np.column_stack([j, i]) * self.stride)

    def metres(self, points: Array) -> Array:
        """Points ``(n, 2)`` of the field's lattice in [m]."""
        found: Array = points * self.field.spacing + np.array(self.field.args[:2])
        return found

    def capsules(self, among: Obstacles) -> Array:
        """``(n, 5)`` of obstacles, in units of the field's lattice."""
        return scaled_capsules(among.capsules, self.field.args[:2], self.field.args[2])

    def clearance(self, points: Array) -> Array:
        """Distance ``(n,)`` [m] of points ``(n, 2)`` from the map's obstacles and edges.

        A lower bound; 0 inside obstacles and outside the map.
        """
        points = np.ascontiguousarray(points, dtype=np.float64)
        found: Array = lookups(self.field.values, points, *self.field.args)
        return found

    def room(self, points: Array, among: Obstacles) -> Array:
        """Distance ``(n,)`` [m] of points ``(n, 2)`` from the map's obstacles and from others.

        A lower bound; 0 inside any of them.
        """
        points = np.ascontiguousarray(points, dtype=np.float64)
        found: Array = _rooms(
            self.field.values, among.capsules, among.corners, among.last, points, *self.field.args
        )
        return found

    def sees(self, here: Array, there: Array, radius: float, least: float) -> Mask:
        """Which discs ``(n,)`` can move straight between points ``here`` and ``there (n, 2)`` [m].

        Only the map is considered. The lines may have any length. The centre must keep ``radius``
        [m]. If an end is closer to an obstacle than that, the distance at this end is required
        instead, but never less than ``least`` [m].
        """
        field = self.field
        found: Mask = _all_see(
            field.values,
            field.lattice(here),
            field.lattice(there),
            radius / field.spacing,
            least / field.spacing,
        )
        return found

    def from_here(self, start: Array, radius: float, among: Obstacles = NOTHING) -> "Reach":
        """Where a disc can go from a point ``(2,)`` [m].

        Its centre keeps ``radius`` [m] from everything. If it starts closer to an obstacle than
        that, it may not come closer on its way out.
        """
        return Reach(self, np.asarray(start, dtype=np.float64), radius, among)

    def line_keeps(self, a: Array, b: Array, radius: float, among: Obstacles = NOTHING) -> bool:
        """Whether a disc's centre keeps ``radius`` [m] on a straight line from a to b ``(2,)``.

        The line may have any length. If an end is closer to an obstacle than ``radius``, the
        distance at this end is required instead.
        """
        field = self.field
        return straight_keeps(
            field.values,
            self.capsules(among),
            field.lattice(a),
            field.lattice(b),
            radius / field.spacing,
            _SPARE,
        )


class Reach:
    """Where a disc can go from one point, and along which paths."""

    def __init__(self, space: FreeSpace, start: Array, radius: float, among: Obstacles) -> None:
        """radius: [m] that it keeps from everything."""
        self._space, self._field = space, space.field.values
        self._start, self._need = start, radius / space.field.spacing
        self._tip, self._capsules = space.field.lattice(start), space.capsules(among)

    @cached_property
    def _begun(self) -> Flood:
        stride = self._space.stride
        return Flood.of_disc(self._field, self._capsules, self._tip, self._need, stride)

    @property
    def _flood(self) -> Flood:
        if not self._begun.done:
            self._begun.step(self._begun.state.size)
        return self._begun

    def settle(self, places: int) -> bool:
        """Look at up to so many more places; whether all have been looked at. The first question
        about lengths or ways does the rest at once."""
        return self._begun.step(places)

    @property
    def reached(self) -> Mask:
        """Which places ``(k,)`` of the lattice a path leads to."""
        return self._flood.reached.ravel()

    @cached_property
    def lengths(self) -> Array:
        """Path lengths ``(k,)`` [m] to the places of the lattice; infinite where there is none."""
        return self._flood.lengths.ravel() * self._space.field.spacing

    def way_to(self, goal: Array) -> Array | None:
        """Corners ``(n, 2)`` [m] of a short path to a point ``(2,)``; None if there is none."""
        goal = np.asarray(goal, dtype=np.float64)
        tip, spacing = self._space.field.lattice(goal), self._space.field.spacing
        ends = reliefs(self._field, self._capsules, 0.0, self._need, 0.0, (self._tip, tip))
        if segment_keeps(self._field, self._capsules, 0.0, ends, self._need, *self._tip, *tip):
            return np.vstack([self._start, goal])
        if math.hypot(*(tip - self._tip)) * spacing < 1e-9:
            return None
        way = disc_way(self._field, self._capsules, 0.0, self._tip, tip, ends, self._need)
        if not len(way):
            return None
        return np.vstack([self._start, self._space.metres(way[1:-1]), goal])

    def way_to_place(self, place: int) -> Array:
        """The same to a place of the lattice, by its number; its length must be finite."""
        way = np.vstack([self._flood.back(place), self._tip])[::-1]
        ends = reliefs(self._field, self._capsules, 0.0, self._need, 0.0, (self._tip, way[-1]))
        kept = straightened(
            self._field, self._capsules, 0.0, ends, self._need, np.ascontiguousarray(way)
        )
        return np.vstack([self._start, self._space.metres(kept[1:])])
