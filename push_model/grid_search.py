"""Short ways over the lattice of a distance field, for a body that takes up a disc.

Units and arguments as in ``room.py``.
"""

import math
from typing import Any

import numba
import numpy as np

from push_model.arrays import Array
from push_model.bucket_queue import new_pool, pop, push
from push_model.room import STEPS, segment_keeps, slack_at

_BLOCKED, _DONE, _OPEN, _SEEN = 255, 16, 10, 9  # states; 1 to 8: come here by that step
_STRAIGHT, _DIAGONAL = 12, 17  # costs of the steps
_GREED = 1.05  # weight of the heuristic: far less is searched for hardly more way
_BUCKETS = 64  # more than the estimate of a way can grow by in one step


@numba.njit(cache=True)
def _block(state: Any, circles: Any, ends: Any, need: float, stride: int) -> None:
    """Mark the points of the lattice that circles leave too little room."""
    rows, columns = state.shape
    for k in range(circles.shape[0]):
        u, v, reach = circles[k, 0], circles[k, 1], circles[k, 2] + need
        low = max(0, math.ceil((v - reach) / stride))
        high = min(rows - 1, math.floor((v + reach) / stride))
        for i in range(low, high + 1):
            half = math.sqrt(max(0.0, reach * reach - (i * stride - v) ** 2))
            left = max(0, math.ceil((u - half) / stride))
            right = min(columns - 1, math.floor((u + half) / stride))
            for j in range(left, right + 1):
                y, x = i * stride, j * stride
                if math.hypot(x - u, y - v) - circles[k, 2] < need - slack_at(ends, x, y):
                    state[i, j] = _BLOCKED


@numba.njit(cache=True)
def _joins(
    field: Any, circles: Any, body: float, ends: Any, need: float, tip: Any, stride: int
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
                lenient or segment_keeps(field, circles, body, ends, need, tip[0], tip[1], x, y)
            ):
                result[k, 0], result[k, 1] = i, j
                found = True
    return result


@numba.njit(cache=True)
def _astar(
    field: Any,
    circles: Any,
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
    _block(state, circles, ends, need, stride)
    cost = np.empty((rows, columns), dtype=np.int32)  # valid where the state says so
    steps = STEPS
    heads = np.zeros(_BUCKETS, dtype=np.int32)
    pool = new_pool()
    enough = (need + body) ** 2
    first = _joins(field, circles, body, ends, need - loss, start, stride)
    last = _joins(field, circles, body, ends, need - loss, goal, stride)
    for k in range(4):
        i, j = last[k, 0], last[k, 1]
        if i >= 0:
            state[i, j] = _OPEN  # the way there has room, even if the point itself had too little
    gi, gj = int(round(goal[1] / stride)), int(round(goal[0] / stride))
    waiting = 0
    for k in range(4):
        i, j = first[k, 0], first[k, 1]
        if i >= 0:
            cost[i, j] = 0
            state[i, j] = _SEEN
            pool = push(heads, pool, 0, i * columns + j)
            waiting += 1
    bucket = 0
    found = -1
    done = _DONE
    while waiting > 0 and found < 0:
        while heads[bucket] == 0:
            bucket = (bucket + 1) % _BUCKETS
        index = pop(heads, pool, bucket)
        waiting -= 1
        i, j = index // columns, index % columns
        if state[i, j] & done:
            continue
        for k in range(4):
            if i == last[k, 0] and j == last[k, 1]:
                found = index
        way = cost[i, j]
        ahead = _ahead(i - gi, j - gj)
        state[i, j] |= done
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
                        state[ni, nj] = _BLOCKED
                        continue
            longer = way + (_STRAIGHT if k < 4 else _DIAGONAL)
            if known == 0 or known == _OPEN or longer < cost[ni, nj]:
                cost[ni, nj] = longer
                state[ni, nj] = k + 1
                more = longer - way + int(_GREED * (_ahead(ni - gi, nj - gj) - ahead))
                pool = push(heads, pool, (bucket + max(0, more)) % _BUCKETS, ni * columns + nj)
                waiting += 1
    if found < 0:
        return np.empty((0, 2))
    points = [(goal[0], goal[1])]
    i, j = found // columns, found % columns
    direction = -1
    while True:
        k = int(state[i, j]) & (done - 1)
        if k != direction:
            points.append((1.0 * j * stride, 1.0 * i * stride))
        direction = k
        if k == _SEEN:
            break
        i, j = i - steps[k - 1, 0], j - steps[k - 1, 1]
    points.append((start[0], start[1]))
    result = np.empty((len(points), 2))
    for m in range(len(points)):
        result[m, 0], result[m, 1] = points[len(points) - 1 - m]
    return result


@numba.njit(cache=True)
def _ahead(rows: int, columns: int) -> int:
    """Least cost between points of the lattice so far apart."""
    a, b = abs(rows), abs(columns)
    return _STRAIGHT * max(a, b) + (_DIAGONAL - _STRAIGHT) * min(a, b)


def shortest_way(
    field: Array,
    circles: Array,
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
            field, circles, body, start, goal, widened, need + loss, joining, step
        )
        return result

    # On a diagonal between points with that much, d^2 is at least that of the middle.
    least = min(wanted, need + circles[:, 2].min(initial=np.inf))
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
