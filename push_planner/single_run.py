"""A lower bound on the time of one run among obstacles.

A run that passes a pose is not shorter than the shortest paths of bounded curvature from the start
to the pose and from the pose to the goal together. Poses of the object are divided into boxes. A
box is left out where object or robot are too close to an obstacle in all of its poses. A run passes
through boxes of which each is a neighbour of the next one, so its time is at least the greatest of
their bounds. The chain of boxes for which that is least is found by a search from the start: the
box with the lowest bound comes next, and the bound of the runs is the greatest one until the box of
the goal is reached.
"""

import math
from collections.abc import Iterator
from typing import Any

import numba
import numpy as np

from push_model import heap
from push_model.arrays import Array
from push_model.distance_field import lookup
from push_planner.least_way import way_at
from push_planner.run_bounds import part_of_run, run_time, stands
from push_planner.run_ends import RunEnds
from push_planner.scene import PushScene

_WIDTH, _ANGLES = 0.03, 72  # [m] of a box, at least; boxes in a turn
_MOST = 500_000  # boxes: on a large map they are wider
_SLICE = 20_000  # boxes between two reports
_AWAY = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))
_NEXT = np.array(_AWAY, dtype=np.int64)


@numba.njit(cache=True)  # infinities: no fast mathematics
def _through(
    x: float, y: float, theta: float, half: float, slack: float, ends: Any, speeds: Any,
    ways: Any, keeps: Any, bodies: Any, field: Any, ox: float, oy: float, scale: float,
) -> float:  # fmt: skip
    """Lower bound [s] of runs through a box; infinite if nothing can stand there."""
    start, goal, contact, radii, fastest = ends
    gone, left, place_x, place_y, place_scale = ways
    object_points, robot_points, object_radius, robot_radius = bodies
    off, rounding = half * math.sqrt(2.0), 1.0 / scale
    if lookup(field, x, y, ox, oy, scale) + off + rounding < keeps[0]:
        return math.inf
    sway = off + 2.0 * object_radius * math.sin(0.5 * slack) + rounding
    if not stands(object_points, object_radius, x, y, theta, keeps[1] - sway, field, ox, oy, scale):
        return math.inf
    c, s = math.cos(theta), math.sin(theta)
    rx, ry = x + c * contact[0] - s * contact[1], y + s * contact[0] + c * contact[1]
    angle = theta + contact[2]
    around = off + 2.0 * math.hypot(contact[0], contact[1]) * math.sin(0.5 * slack)
    sway = around + 2.0 * robot_radius * math.sin(0.5 * slack) + rounding
    if not stands(robot_points, robot_radius, rx, ry, angle, keeps[1] - sway, field, ox, oy, scale):
        return math.inf
    way = way_at(gone, x, y, half, place_x, place_y, place_scale) / fastest
    there, turned = part_of_run(
        start[0], start[1], start[2], rx, ry, angle, radii, way, around, slack
    )
    # The way to the goal, driven backward: left turns become right ones.
    way = way_at(left, x, y, half, place_x, place_y, place_scale) / fastest
    on, turns = part_of_run(
        goal[0], goal[1], goal[2] + math.pi, rx, ry, angle + math.pi, radii[::-1], way, around,
        slack,
    )  # fmt: skip
    return float(run_time(there + on, turned + turns, speeds))


@numba.njit(cache=True)  # infinities: no fast mathematics
def _advance(
    counts: Any, seen: Any, keys: Any, items: Any, bound: float, most: float, budget: int,
    first: Any, width: float, last: int, steps: Any, ends: Any, speeds: Any, ways: Any, keeps: Any,
    bodies: Any, field: Any, ox: float, oy: float, scale: float,
) -> tuple[float, bool]:  # fmt: skip
    """Take boxes in the order of their bounds: the bound until now, and whether it is final.

    counts: ``(1,)`` size of the heap. seen: ``(rows, columns, angles)`` boxes that were asked for.
    keys, items: the heap. first: [m] corner of the first box. last: the box of the goal.
    """
    rows, columns, angles = seen.shape
    slack = math.pi / angles
    for _ in range(budget):
        if counts[0] == 0:
            return most, True
        bound_here, item, counts[0] = heap.pop(keys, items, counts[0])
        bound = max(bound, bound_here)
        if bound >= most or item == last:
            return min(bound, most), True
        i, rest = divmod(item, columns * angles)
        j, k = divmod(rest, angles)
        for n in range(len(steps)):
            p, q, r = i + steps[n, 0], j + steps[n, 1], (k + steps[n, 2]) % angles
            if not (0 <= p < rows and 0 <= q < columns) or seen[p, q, r]:
                continue
            seen[p, q, r] = True
            value = _through(
                first[0] + (q + 0.5) * width, first[1] + (p + 0.5) * width,
                (2 * r + 1) * slack, 0.5 * width, slack, ends, speeds, ways, keeps, bodies,
                field, ox, oy, scale,
            )  # fmt: skip
            if value < most:
                counts[0] = heap.push(keys, items, counts[0], value, (p * columns + q) * angles + r)
    return bound, False


def least_single_run(scene: PushScene, ends: RunEnds, side: int, most: float) -> Iterator[float]:
    """Lower bounds [s] of the time of a run on a side, without what it takes to speed up and brake.

    Yields one after each slice of the work; each is valid, and none is less than the one before.

    side: number of it. most: [s] the bound is not raised above it.
    """
    x0, x1, y0, y1 = scene.field.grid.extent
    width = max(_WIDTH, math.sqrt((x1 - x0) * (y1 - y0) * _ANGLES / _MOST))
    rows, columns = math.ceil((y1 - y0) / width), math.ceil((x1 - x0) / width)
    seen = np.zeros((rows, columns, _ANGLES), dtype=np.bool_)

    def box(pose: Array) -> tuple[int, int, int]:
        angle = pose[2] % (2.0 * math.pi) / (2.0 * math.pi)
        return (
            min(rows - 1, max(0, int((pose[1] - y0) / width))),
            min(columns - 1, max(0, int((pose[0] - x0) / width))),
            int(angle * _ANGLES) % _ANGLES,
        )

    def number(indices: tuple[int, int, int]) -> int:
        return (indices[0] * columns + indices[1]) * _ANGLES + indices[2]

    keys, items = np.empty(seen.size), np.empty(seen.size, dtype=np.int64)
    counts = np.array([heap.push(keys, items, 0, 0.0, number(box(ends.start)))])
    seen[box(ends.start)] = True
    object_points, robot_points, object_radius, robot_radius, _ = scene.bodies
    known = (
        *(np.array([x0, y0]), width, number(box(ends.goal)), _NEXT),
        (ends.starts[side], ends.goals[side], ends.contacts[side], ends.radii[side],
         float(ends.fastest[side])),
        scene.time.speeds,
        (ends.gone.levels, ends.left.levels, *ends.gone.places),
        (ends.least, ends.nearest),
        (object_points, robot_points, object_radius, robot_radius),
        scene.field.values,
        *scene.field.args,
    )  # fmt: skip
    bound, done = 0.0, False
    while not done:
        bound, done = _advance(counts, seen, keys, items, bound, most, _SLICE, *known)
        yield bound
