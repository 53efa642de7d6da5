"""How wide a way can be: floods over the lattice of a distance field.

Units and arguments as in ``room.py``.
"""

import heapq
import math
from typing import Any

import numba
import numpy as np

from push_model.bucket_queue import new_pool, pop, push
from push_model.obstacles import point_gap
from push_model.room import STEPS, corners, room_at, slack_at


@numba.njit(cache=True)
def widest_clearance(
    field: Any, start: Any, goal: Any, ends: Any, need: float, cap: float
) -> float:
    """The greatest distance that a way over the lattice from start to goal keeps, up to ``cap``.

    A flood from the start that always goes on where there is most distance (Prim's algorithm): the
    least distance that it has passed when it reaches the goal is the greatest possible one. Squared
    distances are whole numbers, so it is exact. A place near an end where there is ``need`` less
    the slack does not count.

    Returns
    -------
    0 when obstacles part start and goal.
    """
    rows, columns = field.shape
    seen = np.zeros((rows, columns), dtype=np.uint8)
    targets = corners(field, goal[0], goal[1])
    top = int(math.ceil(cap * cap))
    heads = np.zeros(top + 1, dtype=np.int32)
    pool = new_pool()
    level = top
    before = math.inf  # squared distance to the goal of the place taken last
    steps = STEPS
    fresh = corners(field, start[0], start[1])
    count = 4
    around = np.empty((8, 2), dtype=np.int64)
    while True:
        # Of places with equal distance the last is taken first: those nearer to the goal.
        for nearer in (False, True):
            for k in range(count):
                i, j = fresh[k, 0], fresh[k, 1]
                if i < 0 or j < 0 or i >= rows or j >= columns or seen[i, j]:
                    continue
                gap = (i - goal[1]) ** 2 + (j - goal[0]) ** 2
                if not nearer and gap < before:
                    continue
                seen[i, j] = 1
                square = int(min(field[i, j], level))
                if 0 < square < level:
                    slack = slack_at(ends, j, i)
                    if slack > 0.0 and math.sqrt(square) >= need - slack:
                        square = level
                if square > 0:
                    pool = push(heads, pool, square, i * columns + j)
        while level > 0 and heads[level] == 0:
            level -= 1
        if level == 0:
            return 0.0
        index = pop(heads, pool, level)
        i, j = index // columns, index % columns
        before = (i - goal[1]) ** 2 + (j - goal[0]) ** 2
        for k in range(4):
            if i == targets[k, 0] and j == targets[k, 1]:
                return min(cap, math.sqrt(level))
        count = 8
        for k in range(8):
            around[k, 0], around[k, 1] = i + steps[k, 0], j + steps[k, 1]
        fresh = around


@numba.njit(cache=True)
def escape_radius(
    field: Any, capsules: Any, body: float, end: Any, need: float, floor: float
) -> float:
    """Radius about an end within which a way leads from it, with room ``floor``, to room ``need``.

    The least such radius, and an edge of the lattice more; infinite when there is no such way.
    """
    if room_at(field, capsules, body, end[0], end[1]) >= need:
        return 0.0
    rows, columns = field.shape
    seen = np.zeros((rows, columns), dtype=np.uint8)
    queue = [(0.0, 0)]
    queue.pop()
    steps = STEPS
    fresh = corners(field, end[0], end[1])
    count = 4
    around = np.empty((8, 2), dtype=np.int64)
    radius = 0.0
    first = True
    while True:
        for k in range(count):
            i, j = fresh[k, 0], fresh[k, 1]
            if i < 0 or j < 0 or i >= rows or j >= columns or seen[i, j]:
                continue
            seen[i, j] = 1
            room = math.sqrt(field[i, j]) - body
            for m in range(capsules.shape[0]):
                room = min(room, point_gap(capsules, m, 1.0 * j, 1.0 * i))
            # The end itself lies between points of the lattice that may have a little less.
            if room >= floor or (first and room >= floor - 0.75):
                heapq.heappush(queue, (math.hypot(j - end[0], i - end[1]), i * columns + j))
                if room >= need:
                    # marked by a second bit, so that it is known when it is taken out
                    seen[i, j] = 2
        first = False
        if len(queue) == 0:
            return math.inf
        key, index = heapq.heappop(queue)
        radius = max(radius, key)
        i, j = index // columns, index % columns
        if seen[i, j] == 2:
            return radius + 1.5
        count = 8
        for k in range(8):
            around[k, 0], around[k, 1] = i + steps[k, 0], j + steps[k, 1]
        fresh = around
