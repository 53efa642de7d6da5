"""Leading an object off a wall where robots cannot get behind it.

The object is stuck when robots are at it, it makes no progress and no robot comes nearer to its
place. Then motions in all directions of translation and rotation are tried in thought. Each is
projected onto what the walls allow: no point of the outline that is beside a wall moves into it.
Kept are those that robots can push from the places that walls leave free, with the reaction forces
of the walls that the object slides along. Of these, the one is chosen after which robots find
places to push the object as it is wanted. Motions like those that have been tried at the same place
are left out.
"""

import math
from collections.abc import Generator

import numpy as np
from scipy.optimize import nnls

from push_model import se2
from push_model.arrays import Array
from push_model.coulomb import cone_edges
from push_model.grasp import grasp_matrix
from push_model.screws import screw_poses
from push_model.specs import ObjectSpec
from swarm_push.rim import Rim
from swarm_push.walls import Walls

_DIRECTIONS = 80
"""Directions of motion that are tried, spread evenly over the sphere of (x, y, turn): about 23
degrees apart, from sqrt(4 pi / 80) rad."""
_OUTLINE = 0.03
"""[m] between points of the outline that are compared with walls: three fifths of the radius of an
e-puck, so that a corner or an edge that touches a wall has a point beside it."""
_BESIDE = 0.02
"""[m] of distance below which a point of the outline is beside a wall: the depth that the map's
cells add to a wall, two cells of 1 cm at the most."""
_SLIDES = 1e-6
"""Sine of the angle between a motion and a wall, below which the motion counts as along the wall,
and the wall's reaction as available: the rounding error of the projection, nothing physical."""
_LEAST = 0.1
"""Length of a unit direction that must be left after its projection. What is left of a direction
within 6 degrees of a wall's normal is rounding and noise rather than a direction."""
_NEARER = 0.3
"""[m] by which the sum of all robots' ways must shrink to count as robots coming nearer: six radii
of an e-puck. Chosen, so that robots that jostle in place do not count."""
_ELSEWHERE = 0.3
"""[m] from where the watch began at which the object is no longer stuck, in whatever direction it
has moved: the size of an object of the transport tasks."""
_SAME = 0.06
"""[m] within which the object counts as being at the same place, where motions that did not help
are not repeated: half of the shortest motion."""
_UNLIKE = 0.7
"""Cosine below which two motions are different: 45 degrees apart."""
_LENGTHS = (0.12, 0.2)
"""[m] of motions that are tried: after the shorter one an e-puck (0.1 m across) fits behind the
object, after the longer one two of them do."""
_FAR, _AHEAD = 1.0, 0.1
"""Weights against the missing part of the wrench (0 to 1): of a metre of motion, and of a motion in
the wanted direction. Chosen small (0.08 between the two lengths, 0.1 for the direction): they
decide between motions that leave about the same part missing."""
_LACKING = 0.2
"""Part of a motion's wrench that free places and walls may fail to supply: the wrench is then
within asin(0.2) = 12 degrees of the wanted one, half the spacing of the directions."""
_SLICE = 30
"""Motions that are compared in a tick, 3 ms about."""
Choice = Generator[None, None, tuple[Array, float] | None]
"""Of a motion in slices: what it is, and how far [m] it leads."""


class Escape:
    """Ways of one object out of places between walls."""

    def __init__(
        self,
        rim: Rim,
        item: ObjectSpec,
        radius: float,
        walls: Walls,
        patience: float = 12.0,
        budge: float = 0.02,
    ) -> None:
        """rim: places of robots of a radius [m] at the object. patience: [s] after which the object
        is stuck if it has moved less than ``budge`` [m] in the wanted direction and no robot has
        come nearer to its place; also the time that it has to come off."""
        self._rim, self._walls, self._patience, self._budge = rim, walls, patience, budge
        self._mark: tuple[float, Array] | None = None  # since when, and from where
        self._nearest = math.inf  # [m] of ways to go since then
        self._leaving: tuple[float, Array, Array, float] | None = None  # until, whence, which way
        self._choice: Choice | None = None  # of a motion, being made
        corners = item.geometry.outline
        count = max(1, int(np.hypot(*np.diff(corners, axis=0).T).max() / _OUTLINE))
        part = np.linspace(0.0, 1.0, count, endpoint=False)[:, None, None]
        self._outline = (corners + part * (np.roll(corners, -1, axis=0) - corners)).reshape(-1, 2)
        self._surface = item.limit_surface()
        self._scale = np.array([1.0, 1.0, self._surface.radius])
        points = rim.points + radius * rim.normals
        edges = np.array([cone_edges(n, item.contact_friction) for n in rim.normals])
        G = grasp_matrix(points) / self._scale[:, None]
        self._columns = np.einsum("ikj,ilj->kil", G.reshape(3, -1, 2).transpose(1, 0, 2), edges)
        k = np.arange(_DIRECTIONS) + 0.5
        z, turn = 1.0 - 2.0 * k / _DIRECTIONS, k * math.pi * (1.0 + math.sqrt(5.0))
        level = np.sqrt(1.0 - z**2)
        self._stuck: Array | None = None  # where, and what was tried there
        self._tried: list[Array] = []
        self._units = np.column_stack([level * np.cos(turn), level * np.sin(turn), z])

    def reset(self) -> None:
        """Another target."""
        self._mark, self._leaving, self._choice = None, None, None

    def motion(self, now: float, pose: Array, wanted: Array, to_go: float | None) -> Array | None:
        """Motion ``(3,)`` of unit length, in the object's frame, that leads it off a wall; None
        unless it is being led off one.

        Parameters
        ----------
        now: [s]. pose ``(3,)`` of the object. wanted: its wanted twist ``(3,)`` in its frame.
            to_go: [m] sum of the robots' ways to their places; None if no robot is at the object.
        """
        if self._choice is not None:
            found = self._go_on()
            if found is not None:
                self._leaving = now + self._patience, pose, *found
        if self._leaving is not None:
            until, start, off, length = self._leaving
            if now < until and self.way(pose, start) < length:
                return off
            self._leaving = self._mark = None
            if now >= until and wanted.any():
                self._choice = self._choose(pose, wanted)
                return None
        if self._mark is None or to_go is None or not wanted.any():
            self._mark, self._nearest = (now, pose), math.inf
            return None
        if to_go < self._nearest - _NEARER or self._onward(pose, wanted) > self._budge:
            self._mark, self._nearest = (now, pose), to_go
        elif now - self._mark[0] > self._patience:
            self._choice, self._mark = self._choose(pose, wanted), None
        return None

    def _go_on(self) -> tuple[Array, float] | None:
        """A slice of the choice that is being made; what was chosen, once it is."""
        assert self._choice is not None
        try:
            next(self._choice)
        except StopIteration as end:
            self._choice = None
            found: tuple[Array, float] | None = end.value
            return found
        return None

    def _onward(self, pose: Array, wanted: Array) -> float:
        """Progress [m] since the watch began, along the wanted twist; a turn counts by the radius
        of friction. Infinite once the object is far from there, in any direction."""
        assert self._mark is not None
        mark = self._mark[1]
        way = se2.rotation_matrix(pose[2]).T @ (pose - mark)[:2]
        moved = np.array([*way, se2.wrap(float(pose[2] - mark[2]))]) * self._scale
        goal = wanted * self._scale
        along = float(moved @ goal / np.linalg.norm(goal))
        return math.inf if self.way(pose, mark) > _ELSEWHERE else along

    def direction(self, pose: Array, wanted: Array) -> tuple[Array, float] | None:
        """A motion ``(3,)`` of unit length in the object's frame, and its length [m]; a turn counts
        by the radius of friction. None if every motion has been tried at this place; the next call
        starts again with all of them. wanted: twist ``(3,)`` in the object's frame, not zero."""
        choice = self._choose(pose, wanted)
        while True:
            try:
                next(choice)
            except StopIteration as end:
                found: tuple[Array, float] | None = end.value
                return found

    def _choose(self, pose: Array, wanted: Array) -> Choice:
        """The same in slices, so that no tick waits for all of it."""
        if self._stuck is None or self.way(pose, self._stuck) > _SAME:
            self._stuck, self._tried = pose, []
        motions = yield from self._possible(pose)
        motions = [m for m in motions if all(m @ other < _UNLIKE for other in self._tried)]
        goal = wanted * self._scale / np.linalg.norm(wanted * self._scale)
        best, found = math.inf, None
        for k, motion in enumerate(motions):
            if k % _SLICE == 0:
                yield
            for length in _LENGTHS:
                after = screw_poses(pose, length * motion / self._scale, np.ones(1))[0]
                if self._in_walls(after):
                    break
                back = se2.rotation_matrix(pose[2] - after[2])  # the twist is wanted in the room
                here = np.array([*(back @ wanted[:2]), wanted[2]])
                cost = self._lacking(here, self._pushes(after)) + _FAR * length
                cost -= _AHEAD * float(motion @ goal)
                if cost < best:
                    best, found = cost, (motion, length)
        self._tried = [] if found is None else [*self._tried, found[0]]
        return None if found is None else (found[0] / self._scale, found[1])

    def way(self, pose: Array, start: Array) -> float:
        """Distance [m] between poses ``(3,)``; a turn counts by the radius of friction."""
        turn = abs(se2.wrap(float(pose[2] - start[2])))
        return math.hypot(*(pose - start)[:2]) + float(self._scale[2]) * turn

    def _possible(self, pose: Array) -> Generator[None, None, list[Array]]:
        """Motions that robots at free places can push, with the reactions of walls along which the
        object slides."""
        pushes = self._pushes(pose)
        into, motions = self._into_walls(pose), self._units
        if into.shape[1]:
            motions = np.array([unit - into @ nnls(into, unit)[0] for unit in motions])
        length = np.linalg.norm(motions, axis=1)
        motions = motions[length > _LEAST] / length[length > _LEAST, None]
        found = []
        for k, motion in enumerate(motions):
            if k % (2 * _SLICE) == 0:
                yield
            back = -into[:, motion @ into > -_SLIDES]
            columns = np.hstack([pushes, back])
            if self._lacking(motion / self._scale, columns) < _LACKING:
                found.append(motion)
        return found

    def _pushes(self, pose: Array) -> Array:
        """``(3, k)`` wrenches that robots at places clear of walls can apply."""
        free = self._walls.free(se2.transform(pose, self._rim.points))
        columns: Array = self._columns[:, free].reshape(3, -1)
        return columns

    def _lacking(self, twist: Array, columns: Array) -> float:
        """Part (0 to 1) of a twist's wrench that wrenches ``(3, k)`` cannot supply."""
        if not columns.shape[1]:
            return 1.0
        wrench = self._surface.wrench(twist) / self._scale
        return float(nnls(columns, wrench / np.linalg.norm(wrench))[1])

    def _in_walls(self, pose: Array) -> bool:
        return bool((self._walls.clearance(se2.transform(pose, self._outline)) <= 0.0).any())

    def _into_walls(self, pose: Array) -> Array:
        """``(3, k)`` wrenches of unit forces into the walls that the outline is beside. Scaled,
        they are also the directions of motion that lead into these walls."""
        points = se2.transform(pose, self._outline)
        near = self._walls.clearance(points) < _BESIDE
        inward = self._walls.towards(points[near]) @ se2.rotation_matrix(pose[2])
        G = grasp_matrix(self._outline[near]).reshape(3, -1, 2)
        into: Array = np.einsum("ikj,kj->ik", G / self._scale[:, None, None], inward)
        return into
