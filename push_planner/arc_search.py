"""A* over arcs of stable curvature: object poses through which a cheap plan may lead.

The searches of ``push_search.py`` join poses that are drawn beforehand. Here the poses arise from
one another: from each one the robot drives short arcs of a few curvatures, or changes the side. Of
all nodes in a cell of positions and headings, on the same side, only the cheapest one is kept
(hybrid A*: Dolgov, Thrun, Montemerlo, Diebel, "Path planning for autonomous vehicles in unknown
semi-structured environments", 2010). The last piece, into the goal, is a push curve. The estimate
of the rest is a lower bound: that of one run on this side, or that of a change of the side and of
the way of the object's centre of mass. The search may also run backward from the goal.

Collisions are looked for in the middle and at the end of each arc only. ``arc_pushes.py`` makes
push curves of the result, which are checked all along.
"""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from push_model import heap
from push_model.arrays import Array
from push_planner.arc_room import free, may_change, room_of
from push_planner.least_way import way_at
from push_planner.push_curve import BASIS_COARSE, BASIS_DENSE, solve_curve
from push_planner.push_sweep import push_clearance
from push_planner.rough_cost import guessed_length
from push_planner.run_bounds import run_length, run_time, wrapped
from push_planner.run_ends import RunEnds
from push_planner.scene import PushScene
from push_planner.shortest_chord import shortest_chords

_WIDTH, _ANGLES = 0.03, 96  # [m] of a cell, at least; cells in a turn
_MOST = 4_000_000  # cells: on a large map they are wider
_STEP = 1.5  # widths of a cell that an arc is long
_BENDS = np.array([-0.99, -0.5, 0.0, 0.5, 0.99])  # of the trusted curvatures
_NEAR = 0.6  # [m] from the target: a push to it is tried from each node that is so near,
_FAR = 4  # and from one in so many of the others
_BEND_COST = (
    1.03  # time of the push to the target, as a multiple of that of a straight one: a guess
)
_SLICE = 400  # nodes between two reports


class _Target(NamedTuple):
    """The other end of the search: ``(sides, 3)`` poses of the robot in contact there, ``(sides,)``
    whether it has room, and [s] that a plan costs more for its side there, what bounds runs and
    ways to there (``RunEnds``), and 1 forward, -1 backward."""

    robots: Any
    reached: Any
    extra: Any
    radii: Any
    fastest: Any
    ways: Any
    places: Any
    direction: float


class _Sides(NamedTuple):
    """``(sides, 3)`` poses of the object in the robot frame and of the robot in the object frame,
    ``(sides, 2)`` [1/m] trusted curvatures, and tables of shortest chords."""

    grasps: Any
    contacts: Any
    limits: Any
    chords: Any


class _Costs(NamedTuple):
    """speeds: see ``run_time``. begin: [s] of each run. changes: ``(sides, sides)`` [s]. least: [s]
    of them."""

    speeds: Any
    begin: float
    changes: Any
    least: float


class _Tree(NamedTuple):
    """poses ``(n, 3)``, costs ``(n,)`` [s], parents ``(n,)``, sides ``(n,)`` of the nodes; a heap
    of them; ``(rows, columns, angles, sides)`` least costs of cells; x, y [m] of the first cell,
    width [m] of a cell. counts: nodes, size of the heap, expanded ones. best: cost [s] and last
    node of the best plan."""

    poses: Any
    costs: Any
    parents: Any
    sides: Any
    keys: Any
    items: Any
    cells: Any
    x: float
    y: float
    width: float
    counts: Any
    best: Any


@numba.njit(cache=True)
def _composed(pose: Any, x: float, y: float, angle: float) -> Any:
    """``(3,)`` the pose (x, y, angle) of the frame at a pose."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    result = np.empty(3)
    result[0], result[1] = pose[0] + c * x - s * y, pose[1] + s * x + c * y
    result[2] = pose[2] + angle
    return result


@numba.njit(cache=True)
def _along_arc(pose: Any, length: float, turn: float) -> Any:
    """``(3,)`` the pose after an arc of this length [m], which turns so far [rad]."""
    half = 0.5 * turn
    chord = length * math.sin(half) / half if turn != 0.0 else length
    return _composed(pose, chord * math.cos(half), chord * math.sin(half), turn)


@numba.njit(cache=True)
def _placed(pose: Any, offsets: Any, side: int) -> Any:
    """``(3,)`` the pose that has the offset of a side from a pose."""
    return _composed(pose, offsets[side, 0], offsets[side, 1], offsets[side, 2])


@numba.njit(cache=True)
def _cell(pose: Any, tree: Any) -> tuple[int, int, int]:
    """Indices of the cell of a pose; the first is -1 outside the map."""
    rows, columns, angles = tree.cells.shape[:3]
    i, j = int((pose[1] - tree.y) / tree.width), int((pose[0] - tree.x) / tree.width)
    if pose[0] < tree.x or pose[1] < tree.y or i >= rows or j >= columns:
        i = -1
    return i, j, int(pose[2] % (2.0 * math.pi) / (2.0 * math.pi) * angles) % angles


@numba.njit(cache=True)  # infinities: no fast mathematics
def _rest(pose: Any, robot: Any, side: int, target: Any, costs: Any) -> float:
    """Estimate [s] from a node to the target, never more than it is."""
    places = target.places
    way = way_at(target.ways, pose[0], pose[1], 0.0, places[0], places[1], places[2])
    other = costs.least + costs.begin + run_time(way / target.fastest.max(), 0.0, costs.speeds)
    if not target.reached[side]:
        return float(other)
    x, y, theta = target.robots[side]
    if target.direction > 0.0:
        length = run_length(robot[0], robot[1], robot[2], x, y, theta, target.radii[side], 0.0, 0.0)
    else:
        length = run_length(x, y, theta, robot[0], robot[1], robot[2], target.radii[side], 0.0, 0.0)
    length = max(length, way / target.fastest[side])
    return float(min(other, run_time(length, abs(wrapped(theta - robot[2])), costs.speeds)))


@numba.njit(cache=True)  # infinities: no fast mathematics
def _last_push(
    robot: Any, side: int, target: Any, sides: Any, room: Any, most: float, near: bool,
    coarse: Any, dense: Any,
) -> float:  # fmt: skip
    """Length [m] of a push curve between a node and the target, infinite without one.

    most: [m] it may be. near: whether only targets that are near count.
    """
    field, ox, oy, scale = room.map
    a, b = robot, target.robots[side]
    if target.direction < 0.0:
        a, b = b, a
    x, y, theta = a
    c, s = math.cos(theta), math.sin(theta)
    d, e = math.cos(b[2]), math.sin(b[2])
    guess = guessed_length(x, y, c, s, b[0], b[1], d, e, sides.chords[side])
    if guess > most or (near and guess > _NEAR):
        return math.inf
    dx, dy, turn = b[0] - x, b[1] - y, b[2] - theta
    ki, kf, length, found = solve_curve(
        c * dx + s * dy, -s * dx + c * dy, math.cos(turn), math.sin(turn),
        sides.limits[side, 0], sides.limits[side, 1], coarse, dense,
    )  # fmt: skip
    if not found or length > most:
        return math.inf
    clearance = push_clearance(
        a, b, ki, kf, length, room.needed, sides.grasps[side], field, room.robot_points,
        room.object_points, room.robot_radius, room.object_radius, ox, oy, scale,
    )  # fmt: skip
    return float(length) if clearance >= room.needed else math.inf


@numba.njit(cache=True)  # infinities: no fast mathematics
def _estimate(
    pose: Any, robot: Any, side: int, cost: float, tree: Any, target: Any, costs: Any
) -> float:
    """Estimated cost [s] of plans through a node; infinite where none can be cheaper than those
    that are known, or its cell has a cheaper node."""
    i, j, k = _cell(pose, tree)
    if i < 0 or cost >= tree.best[0] or tree.cells[i, j, k, side] <= cost:
        return math.inf
    key = cost + _rest(pose, robot, side, target, costs)
    return key if key < tree.best[0] else math.inf


@numba.njit(cache=True)
def _add(pose: Any, side: int, cost: float, key: float, parent: int, tree: Any) -> None:
    """Add a node, the cheapest one of its cell."""
    i, j, k = _cell(pose, tree)
    tree.cells[i, j, k, side] = cost
    n = tree.counts[0]
    tree.poses[n], tree.costs[n], tree.parents[n], tree.sides[n] = pose, cost, parent, side
    tree.counts[0] = n + 1
    tree.counts[1] = heap.push(tree.keys, tree.items, tree.counts[1], key, n)


@numba.njit(cache=True)  # infinities: no fast mathematics
def _advance(
    budget: int, tree: Any, target: Any, sides: Any, costs: Any, room: Any, bends: Any,
    coarse: Any, dense: Any,
) -> bool:  # fmt: skip
    """Expand so many nodes; True when the search has ended."""
    step = _STEP * tree.width
    pace = _BEND_COST * costs.speeds[0]
    for _ in range(budget):
        if tree.counts[1] == 0 or tree.counts[0] + len(bends) + len(sides.grasps) > len(tree.costs):
            return True
        estimate, n, tree.counts[1] = heap.pop(tree.keys, tree.items, tree.counts[1])
        if estimate >= tree.best[0]:
            return True
        pose, side, cost = tree.poses[n], tree.sides[n], tree.costs[n]
        i, j, k = _cell(pose, tree)
        if tree.cells[i, j, k, side] < cost:
            continue
        tree.counts[2] += 1
        robot = _placed(pose, sides.contacts, side)
        if target.reached[side]:
            least = cost + target.extra[side]
            most, near = (tree.best[0] - least) / pace, tree.counts[2] % _FAR != 0
            length = _last_push(robot, side, target, sides, room, most, near, coarse, dense)
            if length < math.inf:
                tree.best[0], tree.best[1] = least + pace * length, n
        low, high = sides.limits[side]
        for bend in bends:
            turn = step * target.direction * bend * (high if bend > 0.0 else -low)
            after = _along_arc(robot, step * target.direction, turn)
            total = cost + run_time(step, abs(turn), costs.speeds)
            needed = room.needed if total > room.first else room.leaving
            reached = _placed(after, sides.grasps, side)
            key = _estimate(reached, after, side, total, tree, target, costs)
            if key == math.inf or not free(reached, after, needed, room):
                continue
            halfway = _along_arc(robot, 0.5 * step * target.direction, 0.5 * turn)
            if free(_placed(halfway, sides.grasps, side), halfway, needed, room):
                _add(reached, side, total, key, n, tree)
        parent = tree.parents[n]
        if parent < 0 or tree.sides[parent] != side:
            continue
        may_back_off = False
        for other in range(len(sides.grasps)):
            total = cost + costs.changes[side, other] + costs.begin
            after = _placed(pose, sides.contacts, other)
            key = _estimate(pose, after, other, total, tree, target, costs)
            if key == math.inf:
                continue
            may_back_off = may_back_off or may_change(robot, side, room)
            if not may_back_off:
                break
            if may_change(after, other, room) and free(pose, after, room.needed, room):
                _add(pose, other, total, key, n, tree)
    return False


class ArcSearch:
    """A search from the start, or backward from the goal. ``run`` does the work in slices.

    cost: [s] about what the plan costs; infinite while none was found.
    """

    def __init__(
        self,
        scene: PushScene,
        ends: RunEnds,
        begins: NDArray[np.bool_],
        backward: bool,
        bound: float,
        most: int,
        first: Array | None = None,
    ) -> None:
        """Prepare the search.

        begins: ``(sides,)`` whether the robot has room at the side at the start, and a way to it.
        backward: from the goal to the start. bound: [s] the plan must cost less. most: number of
        nodes at most. first: ``(sides,)`` [s] until a first push on the side begins; None for 0.
        """
        time, sides = scene.time, scene.sides
        none = np.zeros(len(sides))
        first = none if first is None else first
        pose, self._target = (ends.goal, ends.start) if backward else (ends.start, ends.goal)
        self._backward = backward
        known = ends.radii, ends.fastest
        if backward:
            gone = ends.gone
            target = _Target(ends.starts, begins, first, *known, gone.levels, gone.places, -1.0)
        else:
            left = ends.left
            target = _Target(ends.goals, ends.arrives, none, *known, left.levels, left.places, 1.0)
        limits = np.array([[s.trusted.minimum, s.trusted.maximum] for s in sides])
        chords = np.array([shortest_chords(*limit) for limit in limits])
        changes = time.changes.copy()
        np.fill_diagonal(changes, math.inf)
        room = room_of(scene, pose, backward)
        roots = (ends.arrives, none) if backward else (begins, first)
        self._tree = self._planted(scene, pose, *roots, bound, most)
        self._known = (
            target,
            _Sides(np.array([s.grasp for s in sides]), ends.contacts, limits, chords),
            _Costs(time.speeds, time.begin, changes, float(changes.min())),
            room,
            *(_BENDS, BASIS_COARSE, BASIS_DENSE),
        )

    def _planted(
        self,
        scene: PushScene,
        pose: Array,
        begins: NDArray[np.bool_],
        extra: Array,
        bound: float,
        most: int,
    ) -> _Tree:
        """A tree with a node for each side, which costs so much more [s]."""
        x0, x1, y0, y1 = scene.field.grid.extent
        count = len(scene.sides)
        width = max(_WIDTH, math.sqrt((x1 - x0) * (y1 - y0) * _ANGLES * count / _MOST))
        shape = math.ceil((y1 - y0) / width), math.ceil((x1 - x0) / width), _ANGLES, count
        tree = _Tree(
            np.empty((most, 3)),
            np.empty(most),
            np.full(most, -1, dtype=np.int64),
            np.empty(most, dtype=np.int64),
            np.empty(most),
            np.empty(most, dtype=np.int64),
            np.full(shape, math.inf),
            *(x0, y0, width),
            np.zeros(3, dtype=np.int64),
            np.array([bound, -1.0]),
        )
        for n, side in enumerate(np.flatnonzero(begins)):
            tree.poses[n], tree.sides[n] = pose, side
            tree.costs[n] = scene.time.begin + extra[side]
            tree.counts[:2] = n + 1, heap.push(tree.keys, tree.items, n, 0.0, n)
        return tree

    @property
    def cost(self) -> float:
        """See the class."""
        return float(self._tree.best[0]) if self._tree.best[1] >= 0.0 else math.inf

    def run(self) -> Iterator[None]:
        """Search; yields after each slice."""
        while not _advance(_SLICE, self._tree, *self._known):
            yield

    def path(self) -> tuple[Array, NDArray[np.int64]]:
        """``(n, 3)`` poses of the object from the start to the goal, and ``(n - 1,)`` numbers of
        the sides on which it is pushed between them."""
        tree, n = self._tree, int(self._tree.best[1])
        found, on = [self._target, tree.poses[n]], [int(tree.sides[n])]
        while tree.parents[n] >= 0:
            before = int(tree.parents[n])
            if tree.sides[before] == tree.sides[n]:
                found.append(tree.poses[before])
                on.append(int(tree.sides[n]))
            n = before
        if self._backward:
            return np.array(found), np.array(on)
        return np.array(found[::-1]), np.array(on[::-1])
