"""A search for an object's way that can be interrupted, so that a node can do other work.

The straight piece to the goal is tried first. If it is blocked, A* searches a lattice of poses
(``pose_lattice.py``). Its heuristic is the path length of a disc inside the object, times 1.1: the
way found costs at most a tenth more than the best one on the lattice. Then the way is divided into
few pieces, each as long as possible. The result does not depend on how the search is sliced.
"""

import math
from collections.abc import Generator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from push_model.arrays import Array
from push_model.body_room import STEP, Body, Surroundings, motion_keeps
from push_model.bucket_queue import new_pool, push
from push_model.distance_field import DistanceField
from push_model.flood import Flood
from push_model.grid_search import DIAGONAL, STRAIGHT
from push_model.obstacles import scaled_capsules
from push_model.pose_lattice import ENDS, START, chain, expand_poses, pose_of, room_of
from push_model.screws import screw_between

_HEADINGS = 16
_PITCH = 0.06  # [m] between places of the lattice
_TURN = 0.25  # [m] of way that a radian costs
_JOIN = 0.6  # [m] from start and goal, turns counted as ways, within which they join the lattice
_TO_LATTICE = 40  # poses of the lattice that start and goal try to join
_GREED = 1.1  # weight of the heuristic
_CALL = 15  # poses whose check takes as long as a call of compiled code
_SLICE = 256  # poses that are checked, about, before a search can be interrupted
_PER_PLACE = 10  # places of the flood that take as long as checking one pose


Counts = NDArray[np.int64]
_Numbers = tuple[Counts, Counts, Counts]


class NoObjectWay(Exception):
    """Raised if there is no way with room for robots."""


@dataclass(frozen=True)
class ObjectWay:
    """start ``(3,)``; motions ``(k, 3)`` of its pieces, each in the frame where it begins."""

    start: Array
    motions: Array


class PoseLattice:
    """A lattice of an object's poses on a map, and the clearances known so far.

    shape: headings, rows, columns. pitch: [m] between places. stride: the same in spacings of the
    field's lattice. rooms: clearance [m] by number of pose, negative where it is unknown; only from
    the map, without other obstacles.
    """

    def __init__(self, field: DistanceField) -> None:
        """field: of the map."""
        self.field, self.stride = field, max(1, round(_PITCH / field.spacing))
        self.pitch = self.stride * field.spacing
        rows, columns = field.values.shape
        self.shape = np.array(
            [_HEADINGS, (rows - 1) // self.stride + 1, (columns - 1) // self.stride + 1]
        )
        self.rooms = self.unknown()

    def unknown(self) -> NDArray[np.float32]:
        """``rooms`` with all clearances unknown."""
        return np.full(int(np.prod(self.shape)), -1.0, dtype=np.float32)

    def pose(self, number: int, around: Surroundings) -> Array:
        """A pose ``(3,)`` by its number."""
        h, rows, columns = self.shape.tolist()
        return np.array(pose_of(number, rows, columns, h, self.pitch, around))

    def near(self, end: Array) -> tuple[Counts, Array, Array]:
        """The lattice's poses near another one ``(3,)``, the nearest first.

        Returns
        -------
        Their numbers, their distances [m], and their distances [m] with turns counted as way.
        """
        h, rows, columns = self.shape.tolist()
        x, y = (end[:2] - self.field.args[:2]) / self.pitch
        reach = math.ceil(_JOIN / self.pitch)
        i = np.arange(max(0, round(y) - reach), min(rows - 1, round(y) + reach) + 1)
        j = np.arange(max(0, round(x) - reach), min(columns - 1, round(x) + reach) + 1)
        layer, i, j = (a.ravel() for a in np.meshgrid(np.arange(h), i, j, indexing="ij"))
        away = self.pitch * np.hypot(j - x, i - y)
        off = 2.0 * math.pi * layer / h - (0.0 if math.isnan(end[2]) else end[2])
        turn = np.abs(np.remainder(off + math.pi, 2.0 * math.pi) - math.pi)
        whole = away if math.isnan(end[2]) else away + _TURN * turn
        some = np.flatnonzero(whole < _JOIN)
        some = some[np.argsort(whole[some], kind="stable")]
        numbers = (layer * rows + i) * columns + j
        return numbers[some], away[some], whole[some]


class WaySearch:
    """A search for one way. Call ``step`` until it returns true, then read ``way``."""

    def __init__(
        self,
        lattice: PoseLattice,
        body: Body,
        around: Surroundings,
        room: float,
        start: Array,
        goal: Array,
    ) -> None:
        """room: [m] clearance of the way. start, goal: poses ``(3,)``; a goal whose heading is nan
        may be reached with any heading."""
        self._lattice, self._body, self._around, self._room = lattice, body, around, room
        self._start, self._goal = np.array(start, dtype=float), np.array(goal, dtype=float)
        bare = not len(around.capsules)
        self._rooms: NDArray[np.float32] | None = lattice.rooms if bare else None
        self._found: ObjectWay | NoObjectWay | None = None
        self._work = self._slices()
        self._unit = STRAIGHT / lattice.pitch  # of costs, per [m]

    @property
    def done(self) -> bool:
        """Whether the search has ended, with a way or without."""
        return self._found is not None

    def step(self, budget: int) -> bool:
        """Go on until about ``budget`` poses have been checked (1 to 3 microseconds each).

        Returns ``done``. A step takes at most some hundred poses more than its budget.
        """
        while self._found is None and budget > 0:
            try:
                budget -= next(self._work)
            except StopIteration as end:
                self._found = end.value
            except NoObjectWay as error:
                self._found = error
        return self.done

    @property
    def way(self) -> ObjectWay:
        """The way that was found; only after the search is done.

        Raises
        ------
        NoObjectWay
        """
        if isinstance(self._found, NoObjectWay):
            raise self._found
        assert self._found is not None
        return self._found

    def _slices(self) -> Generator[int, None, ObjectWay]:
        """Yields the number of poses that each slice has checked; returns the way."""
        start, goal = self._start, self._goal
        direct = screw_between(start, _headed(goal, start))
        keeps, looked = motion_keeps(self._around, start, direct, self._room, True)
        yield looked
        if keeps:
            return ObjectWay(start, direct[None])
        if self._rooms is None:
            self._rooms = self._lattice.unknown()
        ends = yield from self._joined(goal, False)
        if not len(ends[0]):
            raise NoObjectWay("there is no room for robots about where the object is to go")
        begins = yield from self._joined(start, True)
        if not len(begins[0]):
            raise NoObjectWay("there is no room for robots about where the object starts")
        guess = yield from self._guess(ends, begins)
        numbers = yield from self._over_lattice(begins, ends, guess)
        chosen = [self._lattice.pose(number, self._around) for number in numbers.tolist()]
        poses = np.vstack([start, *chosen, _headed(goal, chosen[-1])])
        motions = yield from self._few_pieces(poses)
        return ObjectWay(start, motions)

    def _joined(self, end: Array, leaves: bool) -> Generator[int, None, _Numbers]:
        """Poses of the lattice to which a piece leads from an end.

        Returns
        -------
        Their numbers, the costs of their distances, and the same with turns.
        """
        lattice, asked = self._lattice, self._room + STEP
        h, rows, columns = lattice.shape.tolist()
        kept: list[tuple[int, int, int]] = []
        tried, spent = 0, 0
        for number, away, whole in zip(*(a.tolist() for a in lattice.near(end)), strict=True):
            spent += _CALL
            room = room_of(
                number, self._rooms, rows, columns, h, lattice.pitch, self._around, asked
            )
            if room >= asked:
                tried += 1
                pose = lattice.pose(number, self._around)
                first = _headed(end, pose)
                motion = screw_between(first, pose)
                keeps, looked = motion_keeps(self._around, first, motion, self._room, leaves)
                spent += looked + 2 * _CALL
                if keeps:
                    kept.append((number, int(away * self._unit), round(whole * self._unit)))
            if spent > _SLICE:
                yield spent
                spent = 0
            if tried == _TO_LATTICE:
                break
        yield spent
        found = np.array(kept, dtype=np.int64).reshape(-1, 3)
        return found[:, 0].copy(), found[:, 1].copy(), found[:, 2].copy()

    def _guess(self, ends: _Numbers, begins: _Numbers) -> Generator[int, None, Counts]:
        """Costs ``(rows, columns)`` of a disc's paths to the goal, times ``_GREED``; the disc lies
        inside the body."""
        lattice = self._lattice
        _, rows, columns = lattice.shape.tolist()
        need = max(0.0, self._room + self._body.core) / lattice.field.spacing
        args = lattice.field.args
        capsules = scaled_capsules(self._around.capsules, args[:2], args[2])
        flood = Flood(lattice.field.values, capsules, need, lattice.stride)
        place = ends[0] % (rows * columns)
        flood.begin(np.column_stack([place // columns, place % columns, ends[1]]))
        wanted = np.unique(begins[0] % (rows * columns))
        while not flood.reached.ravel()[wanted].all() and not flood.step(_SLICE * _PER_PLACE):
            yield _SLICE
        reached = flood.reached
        if not reached.ravel()[wanted].any():
            raise NoObjectWay(self._no_way())
        least = np.where(reached, flood.cost, flood.frontier)
        weighed: Counts = (_GREED * least).astype(np.int64)
        return weighed

    def _no_way(self) -> str:
        return f"no way for the object with {self._room:.2f} m of room about it for robots"

    def _over_lattice(
        self, begins: _Numbers, ends: _Numbers, guess: Counts
    ) -> Generator[int, None, Counts]:
        """Numbers of the poses of the way found."""
        lattice, goal = self._lattice, self._goal
        h, rows, columns = lattice.shape.tolist()
        turn = round(_TURN * 2.0 * math.pi / h * self._unit)
        turned = np.zeros(h, dtype=np.int64)
        if not math.isnan(goal[2]):
            off = 2.0 * math.pi * np.arange(h) / h - goal[2]
            angle = np.abs(np.remainder(off + math.pi, 2.0 * math.pi) - math.pi)
            turned = (turn * angle * h / (2.0 * math.pi)).astype(np.int64)
        state = np.zeros(h * rows * columns, dtype=np.uint8)
        cost = np.empty(h * rows * columns, dtype=np.int32)
        state[ends[0]] = ENDS
        place = begins[0] % (rows * columns)
        keys = begins[2] + guess.ravel()[place] + turned[begins[0] // (rows * columns)]
        keys -= keys.min()
        most = int(ends[2].max()) + 2 * max(turn, DIAGONAL)
        heads = np.zeros(int(keys.max()) + most + 1, dtype=np.int32)
        pool, front = new_pool(), np.zeros(2, dtype=np.int64)
        for number, spent, key in zip(begins[0], begins[2], keys, strict=True):
            state[number] |= START
            cost[number] = spent
            pool = push(heads, pool, int(key), int(number))
            front[1] += 1
        while True:
            pool, found, spent = expand_poses(
                self._around,
                self._room,
                lattice.shape,
                lattice.pitch,
                turn,
                self._rooms,
                state,
                cost,
                heads,
                pool,
                front,
                guess,
                turned,
                ends[0],
                ends[2],
                _SLICE,
            )
            yield spent
            if found >= 0:
                numbers: Counts = chain(state, found, lattice.shape)
                return numbers
            if not front[1]:
                raise NoObjectWay(self._no_way())

    def _few_pieces(self, poses: Array) -> Generator[int, None, Array]:
        """Motions ``(k, 3)`` in place of poses ``(n, 3)``, each as long as the clearance allows."""
        motions, k = [], 0
        while k < len(poses) - 1:
            ahead = len(poses) - 1
            while ahead > k + 1:
                motion = screw_between(poses[k], poses[ahead])
                keeps, looked = motion_keeps(self._around, poses[k], motion, self._room, k == 0)
                yield looked + 2 * _CALL
                if keeps:
                    break
                ahead -= max(1, (ahead - k) // 6)
            motions.append(screw_between(poses[k], poses[ahead]))
            k = ahead
        return np.array(motions)


def _headed(end: Array, pose: Array) -> Array:
    """An end ``(3,)``; if its heading is nan, with that of a pose."""
    return np.array([*end[:2], pose[2]]) if math.isnan(end[2]) else end
