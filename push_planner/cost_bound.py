"""A lower bound on the cost of every plan between two poses of the object.

Successive pushes on the same side are called a run. In a run the robot drives a curve whose
curvature is within the limits of that side, so a run is not shorter than the shortest path of
bounded curvature (dubins_bound.py). Obstacles lengthen it: the object's centre of mass has a least
distance to them, and it moves at most ``fastest`` times as far as the robot. The cost (2.10) of a
plan is therefore at least the smallest of these:

- one run: the time of its bound, and that of one push to begin and to end;
- two runs: the smallest sum of two bounds over all poses at which the side is changed, and the
  times of two pushes to begin and of one change;
- three runs or more: the distance that the centre must move, or the length in which the object can
  turn as far as it must, and the times of three pushes to begin and of two changes.

The first push needs room for the robot at the start, the last one at the goal; other sides do not
count there. The smallest sum over poses is found by branch and bound. A box of positions and
headings has a bound of its own, and the box with the lowest bound is divided next. The work may
stop at any time: the lowest bound of the boxes that are left is valid.
"""

import heapq
import math
from collections.abc import Iterator
from typing import Any

import numba
import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.distance_field import DistanceField, lookup
from push_model.flood import Flood
from push_planner.dubins_bound import least_length
from push_planner.guide_path import origin_floor
from push_planner.scene import PushScene

_STRIDE, _PLACES = 2, 100000  # [lattice spacings] between places of a flood; so many about at most
_OCTAGON = math.cos(math.pi / 8.0)  # of a path of straight and diagonal steps: the shortest one
_ENDS = 1.0  # [strides] that such a path may be longer than that (tested: none was)
_BATCH = 64  # boxes that are divided at a time
_WORTH = 0.003  # of the cost: boxes that may save less are not divided


@numba.njit(cache=True)  # infinities: no fast mathematics
def _way(ways: Any, x: float, y: float, half: float, ox: float, oy: float, scale: float) -> float:
    """Least value [m] at the places in and about a square; infinite if it has none.

    The square is ``2 half`` [m] wide. The values at both sides of a wall differ by more than the
    square is wide, so that the value in the middle says nothing of the others.

    ways: ``(levels, rows, columns)`` [m] from ``_windows``.
    """
    levels, rows, columns = ways.shape
    bottom = max(0, int(math.floor((y - half - oy) * scale)))
    left = max(0, int(math.floor((x - half - ox) * scale)))
    top = min(rows - 1, int(math.floor((y + half - oy) * scale)) + 1)
    right = min(columns - 1, int(math.floor((x + half - ox) * scale)) + 1)
    if top < bottom or right < left:
        return math.inf
    level = min(levels - 1, int(math.log2(min(top - bottom, right - left) + 1)))
    size = 1 << level
    least = math.inf
    i = bottom
    while True:
        j = left
        while True:
            least = min(least, ways[level, i, j])
            if j + size > right:
                break
            j = min(j + size, right - size + 1)
        if i + size > top:
            break
        i = min(i + size, top - size + 1)
    return float(least)


def _windows(ways: Array) -> Array:
    """``(levels, rows, columns)`` least values of windows ``(2**level, 2**level)``, each at its
    first row and column; windows at the end are cut off."""
    levels = [ways]
    size = 1
    while 2 * size <= min(ways.shape):
        pairs = levels[-1].copy()
        pairs[:-size] = np.minimum(pairs[:-size], levels[-1][size:])
        whole = pairs.copy()
        whole[:, :-size] = np.minimum(whole[:, :-size], pairs[:, size:])
        levels.append(whole)
        size *= 2
    return np.array(levels)


@numba.njit(cache=True)
def _run(
    x: float, y: float, theta: float, bx: float, by: float, angle: float, radii: Any,
    off: float, slack: float,
) -> float:  # fmt: skip
    """``least_length`` from the pose (x, y, theta) to about the pose (bx, by, angle)."""
    c, s = math.cos(theta), math.sin(theta)
    dx, dy = bx - x, by - y
    return float(
        least_length(
            c * dx + s * dy, c * dy - s * dx, angle - theta, radii[0], radii[1], off, slack
        )
    )


@numba.njit(cache=True)
def _of_boxes(
    boxes: Any,
    starts: Any,
    leaves: Any,
    goals: Any,
    arrives: Any,
    contacts: Any,
    radii: Any,
    changes: Any,
    fastest: Any,
    pace: float,
    begin: float,
    ways: Any,
    place_scale: float,
    least: float,
    field: Any,
    ox: float,
    oy: float,
    scale: float,
) -> Any:
    """Lower bounds [s] of the cost of plans of two runs that change the side within a box.

    Parameters
    ----------
    boxes: ``(n, 5)`` x, y [m], theta [rad] of the centre, half the width in x and y [m], in theta
        [rad].
    starts, goals: ``(sides, 3)`` poses of the robot in contact at the start and at the goal.
    leaves, arrives: ``(sides,)`` whether the robot has room there.
    contacts: ``(sides, 3)`` the same in the frame of the object.
    radii: ``(sides, 2)`` [m] smallest turning radii to the left and to the right.
    changes: ``(sides, sides)`` [s] of a change of the side; infinite on the diagonal.
    fastest: ``(sides,)`` how far the centre moves at most while the robot drives 1 m.
    pace: [s/m] of a push. begin: [s] that each push takes longer.
    ways: ``(2, levels, rows, columns)`` [m] least way of the centre from the start and to the goal,
        see ``_windows``.
    place_scale: [1/m] places of ``ways`` per metre.
    least: [m] distance of the centre to obstacles.
    """
    n, sides = boxes.shape[0], contacts.shape[0]
    result = np.full(n, math.inf)
    first, second = np.empty(sides), np.empty(sides)
    for k in range(n):
        x, y, theta, half, slack = boxes[k]
        off = half * math.sqrt(2.0)
        # What is looked up is a lower bound, by less than a spacing of the lattice.
        if lookup(field, x, y, ox, oy, scale) + off + 1.0 / scale < least:
            continue
        gone = _way(ways[0], x, y, half, ox, oy, place_scale)
        left = _way(ways[1], x, y, half, ox, oy, place_scale)
        c, s = math.cos(theta), math.sin(theta)
        for side in range(sides):
            gx, gy, turned = contacts[side]
            rx, ry, angle = x + c * gx - s * gy, y + s * gx + c * gy, theta + turned
            around = off + 2.0 * math.hypot(gx, gy) * math.sin(0.5 * slack)
            there, here = radii[side], radii[side, ::-1]
            ax, ay, before = starts[side]
            bx, by, after = goals[side]
            first[side] = second[side] = math.inf
            if leaves[side]:
                length = _run(ax, ay, before, rx, ry, angle, there, around, slack)
                first[side] = max(length, gone / fastest[side])
            if arrives[side]:
                # The way into the goal, driven backward: left turns become right ones.
                length = _run(bx, by, after + math.pi, rx, ry, angle + math.pi, here, around, slack)
                second[side] = max(length, left / fastest[side])
        for a in range(sides):
            for b in range(sides):
                result[k] = min(result[k], pace * (first[a] + second[b]) + changes[a, b])
        result[k] += 2.0 * begin
    return result


def _stride(field: DistanceField) -> int:
    """[lattice spacings] between places; more than the least one on a large map."""
    return max(_STRIDE, math.ceil(math.sqrt(field.values.size / _PLACES)))


def _ways(field: DistanceField, pose: Array, least: float) -> Array:
    """Lower bounds [m] of the way of the centre between a pose and the places of a flood, see
    ``_windows``.

    Every point with the clearance ``least`` has a place about it with less than half a diagonal
    less.
    """
    ox, oy, scale = field.args
    stride = _stride(field)
    need = max(0.0, least * scale - stride / math.sqrt(2.0))
    flood = Flood(field.values, np.zeros((0, 5)), need, stride)
    rows, columns = flood.state.shape
    u, v = (pose[0] - ox) * scale / stride, (pose[1] - oy) * scale / stride
    about = [(i, j) for i in (int(v), int(v) + 1) for j in (int(u), int(u) + 1)]
    flood.begin(np.array([(i, j, 0) for i, j in about if i < rows and j < columns]))
    flood.step(rows * columns)
    return _windows(np.maximum(_OCTAGON * flood.lengths - _ENDS * stride, 0.0) / scale)


def least_way(field: DistanceField, start: Array, goal: Array, least: float) -> float:
    """Lower bound [m] of the way of a point from one position ``(2,)`` to another one.

    least: [m] distance that the point keeps from obstacles.
    """
    ways = _ways(field, start, least)
    return float(_way(ways, *goal[:2], 0.0, *field.args[:2], field.args[2] / _stride(field)))


class CostBound:
    """The bound for one start and one goal in a scene.

    value: [s] the cost of no plan is less. one, several: [s] the same for plans of one run, and of
    three or more; ``value`` is not higher. fastest: ``(sides,)`` how far the centre of mass moves
    at most while the robot drives 1 m.
    """

    def __init__(self, scene: PushScene, start: Array, goal: Array) -> None:
        """Bound by the costs of one run and of three runs.

        Parameters
        ----------
        scene: with at least one side to push on.
        start, goal: ``(3,)`` [m, m, rad] poses of the object's centre of mass, world frame.
        """
        settings, sides, field = scene.settings, scene.sides, scene.field
        contacts = np.array([se2.inverse(s.grasp) for s in sides])
        starts, goals = (np.array([s.robot_pose(pose) for s in sides]) for pose in (start, goal))
        keeps = scene.leaving(start)
        leaves = np.array([scene.has_room(p, s, keeps) for p, s in zip(starts, sides, strict=True)])
        arrives = np.array([scene.has_room(p, s) for p, s in zip(goals, sides, strict=True)])
        limits = np.array([[s.trusted.maximum, s.trusted.minimum] for s in sides])
        radii = 1.0 / np.abs(limits)
        x, y = np.array([s.grasp[:2] for s in sides]).T[:, :, None]
        fastest = np.maximum(np.hypot(1.0 - limits * y, limits * x).max(axis=1), 1.0)
        pace, begin, changes = scene.time.pace, scene.time.begin, scene.time.changes.copy()
        np.fill_diagonal(changes, math.inf)
        floor = origin_floor(scene.shape)
        least = floor + min(scene.leaving(start), settings.safety_distance) if floor > 0.0 else 0.0
        ways = np.array([_ways(field, pose, least) for pose in (start, goal)])
        places = field.args[2] / _stride(field)
        self.fastest = fastest
        self._known = (
            *(starts, leaves, goals, arrives, contacts, radii, changes, fastest, pace, begin),
            *(ways, places, least, field.values, *field.args),
        )
        speed, change = float(fastest.max()), float(changes.min())
        straight = math.hypot(*(goal - start)[:2])
        way = float(_way(ways[0], *goal[:2], 0.0, *field.args[:2], places))
        turn = abs(float(se2.wrap(goal[2] - start[2])))
        length = max(max(way, straight) / speed, turn * float(radii.min()))
        both = np.flatnonzero(leaves & arrives)
        runs = [_run(*starts[k], *goals[k], radii[k], 0.0, 0.0) for k in both]
        self.one = begin + pace * max(length, min(runs, default=math.inf))
        self.several = 3.0 * begin + 2.0 * change + pace * length
        self._fixed, self._speed = 2.0 * begin + change, speed / pace
        self.value = min(self.one, self.several, self._fixed + pace * length)
        self._centre = 0.5 * (start + goal)[:2]
        self._turning = float(radii.mean())

    def run(self, boxes: int, cost: float = math.inf) -> Iterator[None]:
        """Raise the bound by dividing up to so many boxes. Yields after each slice.

        cost: [s] of a known plan; the bound is not raised above it.
        """
        most = min(self.one, self.several, cost)
        reach = 0.5 * self._speed * (most - self._fixed)  # the ellipse of the centre is within it
        if self.value >= most or reach <= 0.0:
            self.value = min(self.value, most)
            return
        # As much of the bound is lost by the width of a box as by its headings.
        count = max(1, math.ceil(math.pi * 2.0 * self._turning / (reach * math.sqrt(2.0))))
        slack = math.pi / count
        roots = [(*self._centre, (2 * k + 1) * slack, reach, slack) for k in range(count)]
        queue: list[tuple[float, int, tuple[float, ...]]] = []
        made = self._add(queue, np.array(roots), 0, most)
        while queue and queue[0][0] < (1.0 - _WORTH) * most and boxes > 0:
            self.value = max(self.value, queue[0][0])
            taken = [heapq.heappop(queue)[2] for _ in range(min(_BATCH, len(queue)))]
            boxes -= len(taken)
            made = self._add(queue, _divided(np.array(taken)), made, most)
            yield
        self.value = max(self.value, min(queue[0][0] if queue else math.inf, most))

    def of_boxes(self, boxes: Array) -> Array:
        """Bounds ``(n,)`` [s] of plans of two runs that change the side in a box ``(n, 5)``: x, y
        [m], theta [rad] of its centre, half its width in x and y [m] and in theta [rad]."""
        found: Array = _of_boxes(boxes, *self._known)
        return found

    def _add(
        self,
        queue: list[tuple[float, int, tuple[float, ...]]],
        boxes: Array,
        made: int,
        most: float,
    ) -> int:
        """Put boxes into the queue that may hold a cheaper plan; counts those that were made."""
        bounds = self.of_boxes(boxes)
        for bound, box in zip(bounds.tolist(), boxes.tolist(), strict=True):
            if bound < most:
                made += 1
                heapq.heappush(queue, (max(bound, self.value), made, tuple(box)))
        return made


def _divided(boxes: Array) -> Array:
    """The eight parts of each box, in the middle of x, y and theta."""
    signs = np.array([(i, j, k) for i in (-0.5, 0.5) for j in (-0.5, 0.5) for k in (-0.5, 0.5)])
    widths = boxes[:, [3, 3, 4]]
    centres = boxes[:, None, :3] + signs[None] * widths[:, None]
    halves = np.repeat(0.5 * boxes[:, None, 3:], 8, axis=1)
    return np.concatenate([centres, halves], axis=2).reshape(-1, 5)
