"""Short ways over the lattice of a distance field, for a body that takes up a disc.

One expansion serves A* from place to place (``shortest_way``) and Dijkstra's flood over all places
(``flood.py``). Units and arguments as in ``room.py``.
"""

import math
from typing import Any

import numba
import numpy as np

from push_model.arrays import Array
from push_model.bucket_queue import new_pool, pop, push
from push_model.obstacles import point_gap
from push_model.room import STEPS, segment_keeps, slack_at

BLOCKED, DONE, SEEN = 255, 16, 9
"""States of a place: no room; bit of those that are settled; where a search begins. 1 to 8: reached
by that step."""
_OPEN = 10  # at the goal: has room, whatever the field says
STRAIGHT, DIAGONAL = 12, 17
"""Costs of the steps."""
_GREED = 1.05  # weight of the heuristic: far less is searched for hardly more way
BUCKETS = 64
"""More than the estimate of a way can grow by in one step."""


@numba.njit(cache=True)
def block(state: Any, capsules: Any, ends: Any, need: float, stride: int) -> None:
    """Mark the points of the lattice that obstacles leave too little room."""
    rows, columns = state.shape
    for k in range(capsules.shape[0]):
        reach = capsules[k, 4] + need
        bottom = min(capsules[k, 1], capsules[k, 3]) - reach
        top = max(capsules[k, 1], capsules[k, 3]) + reach
        west = min(capsules[k, 0], capsules[k, 2]) - reach
        east = max(capsules[k, 0], capsules[k, 2]) + reach
        for i in range(
            max(0, math.ceil(bottom / stride)), min(rows - 1, math.floor(top / stride)) + 1
        ):
            for j in range(
                max(0, math.ceil(west / stride)), min(columns - 1, math.floor(east / stride)) + 1
            ):
                x, y = 1.0 * j * stride, 1.0 * i * stride
                if point_gap(capsules, k, x, y) < need - slack_at(ends, x, y):
                    state[i, j] = BLOCKED


@numba.njit(cache=True)
def _joins(
    field: Any, capsules: Any, body: float, ends: Any, need: float, tip: Any, stride: int
) -> Any:
    """Points ``(4, 2)`` of the coarse lattice around an end; -1 where the way there has no room."""
    result = np.full((4, 2), -1, dtype=np.int64)
    found = False
    # The end may have just what it needs and lie between points of the lattice that have less.
    for lenient in (False, True):
        if found or (lenient and stride > 1):
            break
        for k in range(4):
            i = int(math.floor(tip[1] / stride)) + k // 2
            j = int(math.floor(tip[0] / stride)) + k % 2
            y, x = 1.0 * i * stride, 1.0 * j * stride
            if not (0 <= y < field.shape[0] and 0 <= x < field.shape[1]):
                continue
            if field[i * stride, j * stride] > 0.0 and (
                lenient or segment_keeps(field, capsules, body, ends, need, tip[0], tip[1], x, y)
            ):
                result[k, 0], result[k, 1] = i, j
                found = True
    return result


@numba.njit(cache=True)
def expand(
    field: Any,
    ends: Any,
    body: float,
    need: float,
    stride: int,
    state: Any,
    cost: Any,
    heads: Any,
    pool: Any,
    front: Any,
    goal: Any,
    targets: Any,
    greed: float,
    budget: int,
) -> Any:
    """Settle places in the order of their cost and estimate, until a target, or for so many.

    front ``(4,)``: bucket, how many wait in the queue, cost of the last one that was settled, and
    its number; changed in place, as are state, cost and heads. goal ``(2,)``: row and column that
    the estimate, of weight ``greed``, is of. targets ``(4, 2)``: rows and columns.

    Returns
    -------
    The pool of the queue, and the number of the target that was settled, or -1.
    """
    rows, columns = state.shape
    enough = (need + body) ** 2
    steps = STEPS
    bucket, waiting, buckets = front[0], front[1], heads.shape[0]
    gi, gj = goal[0], goal[1]
    found = -1
    done = DONE
    while waiting > 0 and found < 0 and budget > 0:
        while heads[bucket] == 0:
            bucket = (bucket + 1) % buckets
        index = pop(heads, pool, bucket)
        waiting -= 1
        i, j = index // columns, index % columns
        if state[i, j] & done:
            continue
        budget -= 1
        for k in range(4):
            if i == targets[k, 0] and j == targets[k, 1]:
                found = index
        way = cost[i, j]
        ahead = _ahead(i - gi, j - gj)
        state[i, j] |= done
        front[2], front[3] = way, index
        for k in range(8):
            ni, nj = i + steps[k, 0], j + steps[k, 1]
            if ni < 0 or nj < 0 or ni >= rows or nj >= columns:
                continue
            known = state[ni, nj]
            if known & done:
                continue
            if known == 0:
                square = field[ni * stride, nj * stride]
                if square < enough:
                    less = slack_at(ends, nj * stride, ni * stride)
                    if less == 0.0 or square == 0.0 or math.sqrt(square) - body < need - less:
                        state[ni, nj] = BLOCKED
                        continue
            longer = way + (STRAIGHT if k < 4 else DIAGONAL)
            if known == 0 or known == _OPEN or longer < cost[ni, nj]:
                cost[ni, nj] = longer
                state[ni, nj] = k + 1
                more = longer - way + int(greed * (_ahead(ni - gi, nj - gj) - ahead))
                pool = push(heads, pool, (bucket + max(0, more)) % buckets, ni * columns + nj)
                waiting += 1
    front[0], front[1] = bucket, waiting
    return pool, found


@numba.njit(cache=True)
def seeds(
    field: Any, capsules: Any, ends: Any, need: float, tip: Any, stride: int, reach: int
) -> Any:
    """``(n, 3)`` row, column and cost of the places about a point that it has a straight way to.

    Places have ``need`` and the way there too, but for the slack about ends. reach: places in each
    direction.
    """
    rows, columns = (field.shape[0] - 1) // stride + 1, (field.shape[1] - 1) // stride + 1
    found = np.empty(((2 * reach) ** 2, 3), dtype=np.int64)
    count = 0
    bottom, left = int(math.floor(tip[1] / stride)), int(math.floor(tip[0] / stride))
    for i in range(max(0, bottom - reach + 1), min(rows - 1, bottom + reach) + 1):
        for j in range(max(0, left - reach + 1), min(columns - 1, left + reach) + 1):
            y, x = 1.0 * i * stride, 1.0 * j * stride
            if segment_keeps(field, capsules, 0.0, ends, need, tip[0], tip[1], x, y):
                found[count, 0], found[count, 1] = i, j
                away = math.hypot(x - tip[0], y - tip[1])
                found[count, 2] = int(round(away * STRAIGHT / stride))
                count += 1
    return found[:count].copy()


@numba.njit(cache=True)
def nearest_place(
    values: Any, low: float, high: float, step: int, pitch: float, u: float, v: float
) -> Any:
    """Row and column of the nearest place with a value from low to high; -1, -1 if there is none.

    Places are every ``step``-th value, ``pitch`` apart; (u, v) is a point in the same unit.
    """
    rows, columns = (values.shape[0] - 1) // step + 1, (values.shape[1] - 1) // step + 1
    ci = min(max(int(round(v / pitch)), 0), rows - 1)
    cj = min(max(int(round(u / pitch)), 0), columns - 1)
    best, found_i, found_j = math.inf, -1, -1
    outside = math.hypot(v - ci * pitch, u - cj * pitch)
    for ring in range(max(rows, columns)):
        if best <= ring * pitch - outside:
            break
        for i in range(max(0, ci - ring), min(rows - 1, ci + ring) + 1):
            whole = abs(i - ci) == ring
            for j in range(cj - ring, cj + ring + 1, 1 if whole or ring == 0 else 2 * ring):
                if j < 0 or j >= columns:
                    continue
                if low <= values[i * step, j * step] <= high:
                    away = math.hypot(v - i * pitch, u - j * pitch)
                    if away < best:
                        best, found_i, found_j = away, i, j
    return found_i, found_j


@numba.njit(cache=True)
def back(state: Any, index: int, stride: int) -> Any:
    """Points ``(n, 2)`` where a way bends that leads from a settled place back to its beginning."""
    columns = state.shape[1]
    i, j = index // columns, index % columns
    points = [(0.0, 0.0)]
    points.pop()
    direction = -1
    while True:
        k = int(state[i, j]) & (DONE - 1)
        if k != direction:
            points.append((1.0 * j * stride, 1.0 * i * stride))
        direction = k
        if k == SEEN:
            break
        i, j = i - STEPS[k - 1, 0], j - STEPS[k - 1, 1]
    result = np.empty((len(points), 2))
    for m in range(len(points)):
        result[m, 0], result[m, 1] = points[m]
    return result


@numba.njit(cache=True)
def _astar(
    field: Any,
    capsules: Any,
    body: float,
    start: Any,
    goal: Any,
    ends: Any,
    need: float,
    loss: float,
    stride: int,
) -> Any:
    """A* over every ``stride``-th point of the lattice and diagonals, by a queue of buckets.

    need: room on points; loss: how much less than that a segment to start or goal may have.
    """
    rows, columns = (field.shape[0] - 1) // stride + 1, (field.shape[1] - 1) // stride + 1
    state = np.zeros((rows, columns), dtype=np.uint8)
    block(state, capsules, ends, need, stride)
    cost = np.empty((rows, columns), dtype=np.int32)  # valid where the state says so
    heads = np.zeros(BUCKETS, dtype=np.int32)
    pool = new_pool()
    first = _joins(field, capsules, body, ends, need - loss, start, stride)
    last = _joins(field, capsules, body, ends, need - loss, goal, stride)
    for k in range(4):
        i, j = last[k, 0], last[k, 1]
        if i >= 0:
            state[i, j] = _OPEN  # the way there has room, even if the point itself had too little
    front = np.zeros(4, dtype=np.int64)
    for k in range(4):
        i, j = first[k, 0], first[k, 1]
        if i >= 0:
            cost[i, j] = 0
            state[i, j] = SEEN
            pool = push(heads, pool, 0, i * columns + j)
            front[1] += 1
    near = np.array([int(round(goal[1] / stride)), int(round(goal[0] / stride))])
    pool, found = expand(
        field,
        ends,
        body,
        need,
        stride,
        state,
        cost,
        heads,
        pool,
        front,
        near,
        last,
        _GREED,
        state.size,
    )
    if found < 0:
        return np.empty((0, 2))
    corners = back(state, found, stride)
    n = corners.shape[0]
    result = np.empty((n + 2, 2))
    result[0] = start
    for m in range(n):
        result[m + 1] = corners[n - 1 - m]
    result[n + 1] = goal
    return result


@numba.njit(cache=True)
def _ahead(rows: int, columns: int) -> int:
    """Least cost between points of the lattice so far apart."""
    a, b = abs(rows), abs(columns)
    return STRAIGHT * max(a, b) + (DIAGONAL - STRAIGHT) * min(a, b)


def shortest_way(
    field: Array,
    capsules: Array,
    body: float,
    start: Array,
    goal: Array,
    ends: Array,
    need: float,
    exact: bool = False,
) -> Array:
    """A short way: over a coarse lattice first, over all of it where that is too coarse.

    exact: ask ``need`` of the points of the lattice only; else the diagonals between them keep it.

    Returns
    -------
    Corners of the way ``(n, 2)``, start and goal included; ``n`` is 0 when there is none.
    """
    wanted = body + need
    stride = 4
    while stride > 1 and stride > 0.7 * wanted:
        stride //= 2

    def attempt(step: int, loss: float, joining: float) -> Array:
        widened = ends + np.array([0.0, 0.0, max(0.0, -loss), max(0.0, loss)]) * (ends[:, 3:] > 0.0)
        result: Array = _astar(
            field, capsules, body, start, goal, widened, need + loss, joining, step
        )
        return result

    # On a diagonal between points with that much, d^2 is at least that of the middle.
    least = min(wanted, need + capsules[:, -1].min(initial=np.inf))
    for step in (stride, 1) if stride > 1 else (1,):
        if step == 1 and stride > 1:
            # Any point of a way has a coarse one so near: if those part, there is none at all.
            for coarse in (4, 2):
                offset = coarse / math.sqrt(2.0)
                hopeful = wanted - ends[:, 3].max(initial=0.0) > offset
                if hopeful and not len(attempt(coarse, -offset, wanted)):
                    return np.empty((0, 2))
        loss = 0.0 if exact and step == 1 else math.sqrt(least**2 + 0.5 * step**2) - least
        way = attempt(step, loss, loss)
        if len(way):
            break
    return way
