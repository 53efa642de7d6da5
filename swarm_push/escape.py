"""Off a wall: which way an object can go that is stuck there, where robots cannot get behind it.

Motions in all directions, turns among them, are bent to what the walls allow (no point of the
outline that is beside a wall goes into it); of those that robots at the places which walls leave
free can push, with the walls that it slides along pushing back, the one nearest to what is wanted
is taken that is unlike those which were tried at the same place.
"""

import math

import numpy as np
from scipy.optimize import nnls

from push_model import se2
from push_model.arrays import Array
from push_model.coulomb import cone_edges
from push_model.grasp import grasp_matrix
from push_model.specs import ObjectSpec
from swarm_push.rim import Rim
from swarm_push.walls import Walls

_DIRECTIONS = 80
_OUTLINE = 0.03  # [m] between points of the outline that are looked at
_BESIDE = 0.02  # [m] of room from which on a wall does not matter
_SLIDES = 1e-6  # part of a motion at most away from a wall that is along it
_LEAST = 0.1  # of a direction that must be left when it is bent
_SAME = 0.06  # [m] within which a place is the same
_UNLIKE = 0.7  # cosine between motions below which they are
_LACKING = 0.2  # part of the wrench that free places and walls may lack


class Escape:
    """For one object among walls."""

    def __init__(self, rim: Rim, item: ObjectSpec, radius: float, walls: Walls) -> None:
        """rim: of robots of a radius [m] about the object."""
        self._rim, self._walls = rim, walls
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

    def direction(self, pose: Array, wanted: Array) -> Array | None:
        """``(3,)`` a motion of unit length in the object's frame, turns by its radius of friction;
        None where there is none (more), then it begins anew. wanted: twist ``(3,)`` in its frame.
        """
        if self._stuck is None or self._way(pose, self._stuck) > _SAME:
            self._stuck, self._tried = pose, []
        motion = self._best(pose, wanted * self._scale)
        self._tried = [] if motion is None else [*self._tried, motion]
        return None if motion is None else motion / self._scale

    def _way(self, pose: Array, start: Array) -> float:
        turn = abs(se2.wrap(float(pose[2] - start[2])))
        return math.hypot(*(pose - start)[:2]) + float(self._scale[2]) * turn

    def _best(self, pose: Array, goal: Array) -> Array | None:
        turned = se2.rotation_matrix(pose[2])
        free = self._walls.free(self._rim.points @ turned.T + pose[:2])
        pushes = self._columns[:, free].reshape(3, -1)
        if not pushes.shape[1]:
            return None
        into, motions = self._into_walls(turned, pose), self._units
        if into.shape[1]:
            motions = np.array([unit - into @ nnls(into, unit)[0] for unit in motions])
        length = np.hypot(np.hypot(motions[:, 0], motions[:, 1]), motions[:, 2])
        motions = motions[length > _LEAST] / length[length > _LEAST, None]
        for motion in motions[np.argsort(-(motions @ goal))]:
            if any(motion @ other > _UNLIKE for other in self._tried):
                continue
            back = -into[:, motion @ into > -_SLIDES]
            wrench = self._surface.wrench(motion / self._scale) / self._scale
            columns = np.hstack([pushes, back])
            if nnls(columns, wrench / np.linalg.norm(wrench))[1] < _LACKING:
                found: Array = motion
                return found
        return None

    def _into_walls(self, turned: Array, pose: Array) -> Array:
        """``(3, k)`` wrenches of unit forces into the walls that the outline is beside: as motions
        by the scale, what leads into them."""
        points = self._outline @ turned.T + pose[:2]
        near = self._walls.clearance(points) < _BESIDE
        inward = self._walls.towards(points[near]) @ turned
        G = grasp_matrix(self._outline[near]).reshape(3, -1, 2)
        into: Array = np.einsum("ikj,kj->ik", G, inward) / self._scale[:, None]
        return into
