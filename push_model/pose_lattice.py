"""A* over a lattice of a body's poses, which can be interrupted and continued.

Poses are numbered by heading, row and column, in this order. A step leads to one of the eight
neighbours with the same heading, or turns on the spot to the next heading. A step is allowed if the
body keeps its clearance all along it, not only at its ends (``body_room.py``). Costs are integers:
a step to a side costs ``STRAIGHT``. Clearances are computed when they are needed, and stored.
"""

import math
from typing import Any

import numba
import numpy as np

from push_model.body_room import STEP, motion_keeps, room_at_pose
from push_model.bucket_queue import pop, push
from push_model.distance_field import lookup, piece_square
from push_model.grid_search import DIAGONAL, STRAIGHT
from push_model.room import STEPS

FREE, ENDS, CLOSED = 32, 64, 255
"""Bits of a pose's state: settled; leads to the goal. CLOSED: no room. Its lower bits: 0 unknown, 1
to 8 come here by that step, 9 and 10 by a turn to the left or right, 11 from the start."""
_COME, _LEFT, _RIGHT, START = 31, 9, 10, 11


@numba.njit(cache=True)
def pose_of(number: int, rows: int, columns: int, headings: int, pitch: float, s: Any) -> Any:
    """x, y [m] and heading of a pose by its number; places are ``pitch`` [m] apart."""
    rest = number % (rows * columns)
    x = s.ox + (rest % columns) * pitch
    y = s.oy + (rest // columns) * pitch
    return x, y, 2.0 * math.pi * (number // (rows * columns)) / headings


@numba.njit(cache=True)
def room_of(
    number: int, rooms: Any, rows: int, columns: int, headings: int, pitch: float, s: Any, sure: Any
) -> float:
    """Clearance [m] at a pose by its number; stored in ``rooms (n,)``, negative where unknown.

    A lower bound, which is tight only below ``sure`` [m].
    """
    x, y, theta = pose_of(number, rows, columns, headings, pitch, s)
    if s.capsules.shape[0] == 0:
        around = lookup(s.field, x, y, s.ox, s.oy, s.scale) - s.reach
        if around >= sure:
            return float(around)
    if rooms[number] < 0.0:
        rooms[number] = room_at_pose(s, x, y, theta, math.inf)
    return float(rooms[number])


@numba.njit(cache=True)
def _step_keeps(
    a: int,
    b: int,
    rooms: Any,
    rows: int,
    columns: int,
    headings: int,
    pitch: float,
    s: Any,
    need: float,
) -> Any:
    """Whether a body keeps its clearance on a step, and the number of poses that were checked."""
    x, y, theta = pose_of(a, rows, columns, headings, pitch, s)
    u, v, phi = pose_of(b, rows, columns, headings, pitch, s)
    turn = (phi - theta + math.pi) % (2.0 * math.pi) - math.pi
    gap = (u - x) ** 2 + (v - y) ** 2
    looked = 0
    # What is left at least serves first, then what is known exactly.
    for sure in (need + STEP, math.inf):
        looked += (rooms[a] < 0.0) + (rooms[b] < 0.0) if sure == math.inf else 0
        first = room_of(a, rooms, rows, columns, headings, pitch, s, sure)
        second = room_of(b, rooms, rows, columns, headings, pitch, s, sure)
        if abs(turn) > 1e-6:
            low = 0.5 * (first + second - s.reach * abs(turn))
            if low >= need:
                return True, looked
        # The squared distance of every point of the body is nearly concave, see distance_field.
        elif max(0.0, piece_square(first**2, second**2, gap)) >= need * need:
            return True, looked
    c, si = math.cos(theta), math.sin(theta)
    motion = np.array([c * (u - x) + si * (v - y), -si * (u - x) + c * (v - y), turn])
    keeps, more = motion_keeps(s, np.array([x, y, theta]), motion, need, False)
    return keeps, looked + more


@numba.njit(cache=True)
def expand_poses(
    s: Any,
    need: float,
    shape: Any,
    pitch: float,
    turn: int,
    rooms: Any,
    state: Any,
    cost: Any,
    heads: Any,
    pool: Any,
    front: Any,
    guess: Any,
    turned: Any,
    ends: Any,
    lengths: Any,
    budget: int,
) -> Any:
    """Continue until the goal is reached, or ``budget`` poses have been settled or checked.

    shape ``(3,)``: headings, rows, columns. turn: cost of a turn to the next heading. guess
    ``(rows, columns)`` and turned ``(headings,)``: lower bounds of what is left to the goal; their
    sum is one, too. ends, lengths ``(k,)``: poses that lead to the goal, and what that costs. front
    ``(2,)``: bucket and how many wait. The goal has the number after the last pose's.

    Returns
    -------
    The pool of the queue; the last pose before the goal, -1 until it is found; the budget spent.
    """
    headings, rows, columns = shape[0], shape[1], shape[2]
    layer = rows * columns
    count = headings * layer
    buckets = heads.shape[0]
    bucket, waiting = front[0], front[1]
    spent, found = 0, -1
    while waiting > 0 and found < 0 and spent < budget:
        while heads[bucket] == 0:
            bucket = (bucket + 1) % buckets
        number = pop(heads, pool, bucket)
        waiting -= 1
        if number >= count:
            found = ends[number - count]
            break
        if state[number] & FREE:
            continue
        spent += 1
        state[number] |= FREE
        h, rest = number // layer, number % layer
        i, j = rest // columns, rest % columns
        way, here = cost[number], guess[i, j] + turned[h]
        if state[number] & ENDS:
            for k in range(ends.shape[0]):
                if ends[k] == number:
                    more = max(0, lengths[k] - here)
                    pool = push(heads, pool, (bucket + more) % buckets, count + k)
                    waiting += 1
        for k in range(10):
            if k < 8:
                ni, nj, nh = i + STEPS[k, 0], j + STEPS[k, 1], h
                if ni < 0 or nj < 0 or ni >= rows or nj >= columns:
                    continue
                longer = way + (STRAIGHT if k < 4 else DIAGONAL)
            else:
                ni, nj, nh = i, j, (h + (1 if k == 8 else headings - 1)) % headings
                longer = way + turn
            other = nh * layer + ni * columns + nj
            known = state[other]
            if known & FREE:
                continue
            if known & _COME:
                if longer >= cost[other]:
                    continue
            else:
                new = rooms[other] < 0.0
                if (
                    room_of(other, rooms, rows, columns, headings, pitch, s, need + STEP)
                    < need + STEP
                ):
                    state[other] = CLOSED
                    spent += new
                    continue
                spent += new and rooms[other] >= 0.0
            keeps, looked = _step_keeps(
                number, other, rooms, rows, columns, headings, pitch, s, need
            )
            spent += looked
            if keeps:
                cost[other] = longer
                state[other] = (known & ENDS) | (k + 1)
                more = longer - way + guess[ni, nj] + turned[nh] - here
                pool = push(heads, pool, (bucket + max(0, more)) % buckets, other)
                waiting += 1
    front[0], front[1] = bucket, waiting
    return pool, found, spent


@numba.njit(cache=True)
def chain(state: Any, number: int, shape: Any) -> Any:
    """Numbers of the poses on the way to a settled one, from the first to the last."""
    headings, rows, columns = shape[0], shape[1], shape[2]
    layer = rows * columns
    numbers = [number]
    while True:
        k = int(state[number]) & _COME
        if k == START:
            break
        h, rest = number // layer, number % layer
        if k == _LEFT:
            h = (h + headings - 1) % headings
        elif k == _RIGHT:
            h = (h + 1) % headings
        else:
            rest -= STEPS[k - 1, 0] * columns + STEPS[k - 1, 1]
        number = h * layer + rest
        numbers.append(number)
    return np.array(numbers[::-1])
