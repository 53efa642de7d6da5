"""The room that a disc has at points and along segments: line of sight, and straight ways.

Room is the distance to the map and to other obstacles, less the radius of the disc. A way needs
so much of it everywhere but near its ends: within ``radius`` of an end it may have ``slack`` less,
since a robot that stands beside a wall must be able to leave it.

Lengths are in lattice spacings of a ``DistanceField`` and points in spacings from the first point
of its lattice. ``capsules (n, 5)`` are obstacles (``obstacles.py``) with radii at which no room is
left; ``ends (n, 4)`` are x, y, radius, slack; ``field`` are the field's values. Segments are looked
at by sphere tracing: no part of one is left out, however long it is.
"""

import math
from typing import Any

import numba
import numpy as np

from push_model.distance_field import piece_square, square_at
from push_model.obstacles import point_gap, segment_gap

STEPS = np.array(
    [[0, 1], [1, 0], [0, -1], [-1, 0], [1, 1], [1, -1], [-1, 1], [-1, -1]]
)  # to neighbours, diagonal ones last
_COARSEST = 0.2  # part of a spacing below which a piece of a segment is not halved
_LOOKAHEAD = 48  # corners that a way is straightened over at a time


@numba.njit(cache=True)
def corners(field: Any, u: float, v: float) -> Any:
    """The four points of the lattice around a point, clipped to it: ``(4, 2)`` row, column."""
    result = np.empty((4, 2), dtype=np.int64)
    for k in range(4):
        result[k, 0] = min(max(int(math.floor(v)) + k // 2, 0), field.shape[0] - 1)
        result[k, 1] = min(max(int(math.floor(u)) + k % 2, 0), field.shape[1] - 1)
    return result


@numba.njit(cache=True)
def slack_at(ends: Any, u: float, v: float) -> float:
    """How much less room than elsewhere a way may have at a point."""
    slack = 0.0
    for k in range(ends.shape[0]):
        if (u - ends[k, 0]) ** 2 + (v - ends[k, 1]) ** 2 <= ends[k, 2] ** 2:
            slack = max(slack, ends[k, 3])
    return slack


@numba.njit(cache=True)
def room_at(field: Any, capsules: Any, body: float, u: float, v: float) -> float:
    """Room at a point."""
    room = math.sqrt(max(0.0, square_at(field, u, v))) - body
    for k in range(capsules.shape[0]):
        room = min(room, point_gap(capsules, k, u, v))
    return room


@numba.njit(cache=True)
def segment_keeps(
    field: Any,
    capsules: Any,
    body: float,
    ends: Any,
    need: float,
    u0: float,
    v0: float,
    u1: float,
    v1: float,
) -> bool:
    """Whether a segment surely has the room it needs, everywhere along it."""
    length = math.hypot(u1 - u0, v1 - v0)
    if length == 0.0:
        return bool(room_at(field, capsules, body, u0, v0) >= need - slack_at(ends, u0, v0))
    du, dv = (u1 - u0) / length, (v1 - v0) / length
    near = False  # whether an obstacle leaves less than the full need somewhere
    for k in range(capsules.shape[0]):
        near = near or segment_gap(capsules, k, u0, v0, du, dv, 0.0, length) < need
    way = 0.0
    slack = slack_at(ends, u0, v0)
    square = square_at(field, u0, v0)
    while True:
        room = math.sqrt(max(0.0, square)) - body
        if room < need - slack - 1e-9:
            return False
        if way >= length:
            return True
        step = min(1.0, length - way) if near else min(max(1.0, room - need), length - way)
        while True:
            u, v = u0 + du * (way + step), v0 + dv * (way + step)
            following = square_at(field, u, v)
            beyond = slack_at(ends, u, v)
            if step <= room - need and not near:
                break
            wanted = need - min(slack, beyond)
            low = math.sqrt(max(0.0, piece_square(square, following, step * step))) - body
            if near:
                for k in range(capsules.shape[0]):
                    gap = segment_gap(capsules, k, u0, v0, du, dv, way, way + step)
                    low = min(low, gap)
            if low >= wanted - 1e-9:
                break
            if step < _COARSEST:
                return False
            step *= 0.5
        way += step
        square, slack = following, beyond


@numba.njit(cache=True)
def chain_keeps(field: Any, capsules: Any, body: float, ends: Any, need: float, chain: Any) -> bool:
    """Whether all segments between successive points ``(n, 2)`` surely have the room they need."""
    for k in range(chain.shape[0] - 1):
        u0, v0, u1, v1 = chain[k, 0], chain[k, 1], chain[k + 1, 0], chain[k + 1, 1]
        if not segment_keeps(field, capsules, body, ends, need, u0, v0, u1, v1):
            return False
    return True


@numba.njit(cache=True)
def straightened(
    field: Any, capsules: Any, body: float, ends: Any, need: float, points: Any
) -> Any:
    """Points ``(m, 2)`` of a way ``(n, 2)``, left out as long as the straight way has room."""
    n = points.shape[0]
    kept = np.empty((n, 2))
    kept[0] = points[0]
    count = 1
    i = 0
    while i < n - 1:
        j = min(n - 1, i + _LOOKAHEAD)
        while j > i + 1 and not segment_keeps(
            field,
            capsules,
            body,
            ends,
            need,
            points[i, 0],
            points[i, 1],
            points[j, 0],
            points[j, 1],
        ):
            j -= 1
        kept[count] = points[j]
        count += 1
        i = j
    return kept[:count].copy()
