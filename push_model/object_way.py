"""The way of an object among obstacles that leaves its robots room all round it.

Pieces of one twist each: along such a piece the wrench that the floor asks for is the same in the
object's frame, so that robots which hold it at the beginning hold it to the end. Between pieces
they change places, which costs more than a detour of some centimetres: few pieces are better.
"""

import math
from copy import copy
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from push_model import se2
from push_model.arrays import Array, Mask
from push_model.free_space import FreeSpace, Obstacles
from push_model.screws import screw_between, screw_poses

_HEADINGS = 16
_EVERY = 3  # places of the free space's lattice
_OUTLINE = 0.03  # [m] between points of the outline that are looked at
_STEP = 0.02  # [m] between poses of a piece that are looked at
_TURN = 0.25  # [m] of way that a radian costs
_SOON = 2  # steps in which an object leaves what it touches
_LEAST = 5e-3  # [m] of room that an object keeps even where it starts with less
_TO_LATTICE = 40  # poses of the lattice to which start and goal are tried to join


class NoObjectWay(Exception):
    """Raised when there is no way with room for robots."""


@dataclass(frozen=True)
class ObjectWay:
    """start ``(3,)``; motions ``(k, 3)`` of its pieces, each in the frame where it begins."""

    start: Array
    motions: Array


class WayFinder:
    """Finds ways for one object, ``room`` [m] clear of everything."""

    def __init__(self, space: FreeSpace, outline: Array, room: float) -> None:
        """outline ``(m, 2)`` [m] about the object's centre of mass."""
        self._space, self._room = space, room
        following = np.roll(outline, -1, axis=0)
        self._points = np.vstack(
            [
                a
                + np.linspace(0.0, 1.0, max(1, math.ceil(np.hypot(*(b - a)) / _OUTLINE)), False)[
                    :, None
                ]
                * (b - a)
                for a, b in zip(outline, following, strict=True)
            ]
        )
        self._reach = float(np.hypot(*outline.T).max())
        self._on_map: list[Array] = []  # clearance of the lattice's poses on the bare map, if known

    def with_room(self, room: float) -> "WayFinder":
        """One for the same object that keeps so far [m] from everything; what is known of the map
        is shared."""
        other = copy(self)
        other._room = room
        return other

    def clearance(self, poses: Array, among: Obstacles) -> Array:
        """``(n,)`` [m] of the outline at poses ``(n, 3)``."""
        poses = np.atleast_2d(poses)
        c, s = np.cos(poses[:, 2])[:, None], np.sin(poses[:, 2])[:, None]
        x, y = self._points.T
        points = np.stack(
            [poses[:, :1] + c * x - s * y, poses[:, 1:2] + s * x + c * y], axis=2
        ).reshape(-1, 2)
        least: Array = self._space.room(points, among).reshape(len(poses), -1).min(axis=1)
        return least

    def keeps(self, start: Array, motion: Array, among: Obstacles, leaves: bool = False) -> bool:
        """Whether the object keeps its room on a piece, or comes away where it has less. leaves:
        whether it may touch something at the start, which it leaves."""
        length = float(np.hypot(*motion[:2])) + self._reach * abs(motion[2])
        parts = np.linspace(0.0, 1.0, max(2, math.ceil(length / _STEP) + 1))
        room = self.clearance(screw_poses(start, motion, parts), among)
        return self._enough(room, leaves)

    def _enough(self, room: Array, leaves: bool) -> bool:
        """Where an end has less room than is needed, it only becomes more on the way from it."""
        need = np.minimum(self._room, np.maximum.accumulate(room) - 1e-3)
        back = np.minimum(self._room, np.maximum.accumulate(room[::-1])[::-1] - 1e-3)
        if leaves and room[0] < _LEAST:  # no room tells touching from being within: it leaves soon
            room = room[_SOON:]
        return bool((room >= np.minimum(need, back)[-len(room) :]).all() and room.min() >= _LEAST)

    def way(self, start: Array, goal: Array, among: Obstacles) -> ObjectWay:
        """From a pose ``(3,)`` to another, of the centre of mass; where the goal's heading is nan
        with any heading.

        Raises
        ------
        NoObjectWay
        """
        straight = np.array([*goal[:2], start[2] if math.isnan(goal[2]) else goal[2]])
        direct = screw_between(start, straight)
        if self.keeps(start, direct, among, leaves=True):
            return ObjectWay(start, direct[None])
        poses = self._lattice_way(start, goal, among)
        return ObjectWay(start, self._few_pieces(poses, among))

    def _lattice_way(self, start: Array, goal: Array, among: Obstacles) -> Array:
        """Poses ``(n, 3)`` from start to goal, side by side on a lattice but for the ends."""
        rows, columns = self._space.shape
        number = np.arange(rows * columns).reshape(rows, columns)[::_EVERY, ::_EVERY]
        places = self._space.places[number.ravel()]
        headings = 2.0 * math.pi * np.arange(_HEADINGS) / _HEADINGS
        poses = np.array([[x, y, h] for h in headings for x, y in places])
        free = self._lattice_clearance(poses, among) >= self._room
        first, second, cost = self._edges(number.shape)
        keep = free[first] & free[second]
        first, second, cost = first[keep], second[keep], cost[keep]
        count = len(poses)
        for node, end in ((count, start), (count + 1, goal)):
            joined, lengths = self._joined(end, poses, free, among, leaves=node == count)
            if not len(joined):
                where = "starts" if node == count else "is to go"
                raise NoObjectWay(f"there is no room for robots about where the object {where}")
            first = np.concatenate([first, np.full(len(joined), node)])
            second, cost = np.concatenate([second, joined]), np.concatenate([cost, lengths])
        graph = csr_matrix((cost, (first, second)), shape=(count + 2, count + 2))
        lengths, before = dijkstra(graph, directed=False, indices=count, return_predecessors=True)
        if not np.isfinite(lengths[count + 1]):
            raise NoObjectWay(
                f"no way for the object with {self._room:.2f} m of room about it for robots"
            )
        chain, node = [], int(before[count + 1])
        while node != count:
            chain.append(poses[node])
            node = int(before[node])
        return np.vstack([start, *chain[::-1], _headed(goal, chain[0])])

    def _lattice_clearance(self, poses: Array, among: Obstacles) -> Array:
        bare = not among.outlines and not len(among.discs)
        if bare and self._on_map:
            return self._on_map[0]
        found = np.concatenate(
            [self.clearance(layer, among) for layer in np.split(poses, _HEADINGS)]
        )
        if bare:
            self._on_map.append(found)
        return found

    def _edges(self, shape: tuple[int, int]) -> tuple[Array, Array, Array]:
        """Neighbours on the lattice of poses, and what a step between them costs [m]."""
        rows, columns = shape
        number = np.arange(_HEADINGS * rows * columns).reshape(_HEADINGS, rows, columns)
        spacing = _EVERY * float(self._space.places[1, 0] - self._space.places[0, 0])
        turn = _TURN * 2.0 * math.pi / _HEADINGS
        pairs = [
            (number[:, :, :-1], number[:, :, 1:], spacing),
            (number[:, :-1], number[:, 1:], spacing),
            (number[:, :-1, :-1], number[:, 1:, 1:], math.sqrt(2.0) * spacing),
            (number[:, 1:, :-1], number[:, :-1, 1:], math.sqrt(2.0) * spacing),
            (number, np.roll(number, -1, axis=0), turn),
        ]
        return (
            np.concatenate([a.ravel() for a, _, _ in pairs]),
            np.concatenate([b.ravel() for _, b, _ in pairs]),
            np.concatenate([np.full(a.size, cost) for a, _, cost in pairs]),
        )

    def _joined(
        self, end: Array, poses: Array, free: Mask, among: Obstacles, leaves: bool
    ) -> tuple[Array, Array]:
        """Numbers of poses of the lattice that an end has a piece to, and what that costs."""
        off = np.zeros(len(poses)) if math.isnan(end[2]) else poses[:, 2] - end[2]
        turn = np.abs(np.remainder(off + math.pi, 2.0 * math.pi) - math.pi)
        away = np.hypot(poses[:, 0] - end[0], poses[:, 1] - end[1]) + _TURN * turn
        near = np.flatnonzero(free & (away < 0.6))
        near = near[np.argsort(away[near], kind="stable")][:_TO_LATTICE]
        ends = [_headed(end, poses[k]) for k in near]
        keeps = [
            self.keeps(e, screw_between(e, poses[k]), among, leaves)
            for e, k in zip(ends, near, strict=True)
        ]
        near = near[np.array(keeps, dtype=bool)]
        return near, away[near]

    def _few_pieces(self, poses: Array, among: Obstacles) -> Array:
        """From each pose as far along as one piece leads."""
        motions, k = [], 0
        while k < len(poses) - 1:
            ahead = len(poses) - 1
            while ahead > k + 1:
                motion = screw_between(poses[k], poses[ahead])
                if self.keeps(poses[k], motion, among, leaves=k == 0):
                    break
                ahead -= max(1, (ahead - k) // 6)
            motions.append(screw_between(poses[k], poses[ahead]))
            k = ahead
        return np.array(motions)


def _headed(end: Array, pose: Array) -> Array:
    """An end whose heading does not matter has that of a pose."""
    return np.array([*end[:2], pose[2]]) if math.isnan(end[2]) else end


def pieces(way: ObjectWay) -> list[tuple[Array, Array]]:
    """Pose where each piece begins, and its motion."""
    found, pose = [], way.start
    for motion in way.motions:
        found.append((pose, motion))
        pose = screw_poses(pose, motion, np.ones(1))[0]
        pose[2] = se2.wrap(float(pose[2]))
    return found
