"""The way of an object among obstacles that leaves its robots room all round it.

Pieces of one twist each: along such a piece the wrench that the floor asks for is the same in the
object's frame, so that robots which hold it at the beginning hold it to the end. Between pieces
they change places, which costs more than a detour of some centimetres: few pieces are better.

A way is looked for in slices (``way_search.py``), or at once (``WayFinder.way``).
"""

from copy import copy
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.body_room import Body, motion_keeps, rooms_at_poses
from push_model.free_space import FreeSpace, Obstacles
from push_model.occupancy import OccupancyGrid
from push_model.screws import screw_poses
from push_model.way_search import NoObjectWay, ObjectWay, PoseLattice, WaySearch

__all__ = ["NoObjectWay", "ObjectWay", "WayFinder", "WaySearch", "pieces", "warm_up"]

_AT_ONCE = 1 << 20  # of a search's budget


@dataclass(frozen=True)
class _Known:
    """What ways for one object on one map share, whatever room they keep."""

    body: Body
    lattice: PoseLattice


class WayFinder:
    """Finds ways for one object, ``room`` [m] clear of everything."""

    def __init__(self, space: FreeSpace, outline: Array, room: float) -> None:
        """outline ``(m, 2)`` [m] about the object's centre of mass."""
        self._space, self._room = space, room
        self._known = _Known(Body.of(outline), PoseLattice(space.field))

    def with_room(self, room: float) -> "WayFinder":
        """One for the same object that keeps so far [m] from everything; what is known of the map
        is shared."""
        other = copy(self)
        other._room = room
        return other

    def clearance(self, poses: Array, among: Obstacles) -> Array:
        """``(n,)`` [m] of the object at poses ``(n, 3)``, from everything, never more than it is; 0
        where anything overlaps it or stands inside its outline."""
        poses = np.ascontiguousarray(np.atleast_2d(poses), dtype=np.float64)
        around = self._known.body.among(self._space.field, among)
        found: Array = rooms_at_poses(around, poses)
        return found

    def keeps(self, start: Array, motion: Array, among: Obstacles, leaves: bool = False) -> bool:
        """Whether the object keeps its room all along a piece, or comes away where it has less.
        leaves: whether it may touch something at the start, which it leaves."""
        around = self._known.body.among(self._space.field, among)
        return bool(motion_keeps(around, start, motion, self._room, leaves)[0])

    def search(self, start: Array, goal: Array, among: Obstacles) -> WaySearch:
        """A search for a way, see ``way``, that goes on when its ``step`` is called."""
        known = self._known
        around = known.body.among(self._space.field, among)
        return WaySearch(known.lattice, known.body, around, self._room, start, goal)

    def way(self, start: Array, goal: Array, among: Obstacles) -> ObjectWay:
        """From a pose ``(3,)`` to another, of the centre of mass; where the goal's heading is nan
        with any heading.

        Raises
        ------
        NoObjectWay
        """
        search = self.search(start, goal, among)
        while not search.step(_AT_ONCE):
            pass
        return search.way


@lru_cache(maxsize=1)
def warm_up() -> None:
    """Load what is compiled, so that the first search does not wait: find a way round a wall."""
    occupied = np.zeros((60, 60), dtype=np.bool_)
    occupied[:36, 28:30] = True
    space = FreeSpace(OccupancyGrid(occupied, 0.02, np.zeros(2)))
    outline = 0.05 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    start, goal = np.array([0.2, 0.2, 0.0]), np.array([1.0, 0.2, 0.0])
    finder = WayFinder(space, outline, 0.02)
    finder.way(start, goal, Obstacles(discs=np.array([[0.6, 1.1, 0.02]])))
    finder.clearance(start, Obstacles())


def pieces(way: ObjectWay) -> list[tuple[Array, Array]]:
    """Pose where each piece begins, and its motion."""
    found, pose = [], way.start
    for motion in way.motions:
        found.append((pose, motion))
        pose = screw_poses(pose, motion, np.ones(1))[0]
        pose[2] = se2.wrap(float(pose[2]))
    return found
