"""What robot and object sweep in a push, and what the robot sweeps when it backs out of one.

Between two poses of a motion every point of a body moves on a curve. With A and B the clearances at
the two poses, g the longest chord of any point and e how far its curve bulges from the chord, what
it passes is at least

    sqrt(min over t of (1 - t) A^2 + t B^2 - t (1 - t) g^2) - e

away (see distance_field.py for the first term). Both g and e are bounded for all points at once:
with R the greatest distance of a point from the axle midpoint c,

    g <= |dc| + R |dtheta|,    e <= h^2 / 8 max(|c''| + R |theta''| + R theta'^2),

the error of linear interpolation over a step h of the curve's parameter. A stretch is halved until
its bound is nearly the least clearance found, so that few poses are looked at in the open and no
obstacle slips through between two of them.
"""

import math
from typing import Any

import numba
import numpy as np

from push_model.distance_field import between_samples, lookup, piece_square, points_clearance

SWEEP_LOSS = 0.0005
"""[m] by which the clearance of a push may be underestimated."""
_COARSEST = 0.16  # [m] between the first poses that are looked at
_FINEST = 20  # times that a stretch is halved at most
_MOST = 2000  # poses of a push that are looked at; what is not sure by then counts as it is
_BACK = 0.003  # [m] between poses of the way back at most


@numba.njit(cache=True, fastmath=True)
def _pose_at(t: float, x: float, y: float, ki: float, c: float, s: float, result: Any) -> None:
    """x, y, heading, c', c'', of the cubic from the origin: 7 numbers. c, s: k_f's components."""
    h, hi, hf = t * t * (3.0 - 2.0 * t), t * (t - 1.0) ** 2, t * t * (t - 1.0)
    d, di, df = 6.0 * t * (1.0 - t), (t - 1.0) * (3.0 * t - 1.0), t * (3.0 * t - 2.0)
    b, bi, bf = 6.0 - 12.0 * t, 6.0 * t - 4.0, 6.0 * t - 2.0
    result[0], result[1] = h * x + hi * ki + hf * c, h * y + hf * s
    result[3], result[4] = d * x + di * ki + df * c, d * y + df * s
    result[5], result[6] = b * x + bi * ki + bf * c, b * y + bf * s
    result[2] = math.atan2(result[4], result[3])


@numba.njit(cache=True, fastmath=True)
def _bulge(a: Any, b: Any, step: float, third_x: float, third_y: float, radius: float) -> float:
    """[m] that no point of the bodies gets off its chord, between two poses; -1 if unknown."""
    bend = max(math.hypot(a[5], a[6]), math.hypot(b[5], b[6]))  # c'' is linear
    slowest = 0.5 * (math.hypot(a[3], a[4]) + math.hypot(b[3], b[4]) - bend * step)
    if slowest <= 0.0:
        return -1.0
    # N = c' x c'' is quadratic and N' = c' x c''' linear; theta' = N / |c'|^2.
    n = max(abs(a[3] * a[6] - a[4] * a[5]), abs(b[3] * b[6] - b[4] * b[5]))
    first, last = a[3] * third_y - a[4] * third_x, b[3] * third_y - b[4] * third_x
    n += 0.125 * step * abs(last - first)
    turn = n / slowest**2
    faster = max(abs(first), abs(last)) / slowest**2 + 2.0 * n * bend / slowest**3
    return float(0.125 * step * step * (bend + radius * (faster + turn * turn)))


@numba.njit(cache=True, fastmath=True)
def push_clearance(
    start: Any,
    end: Any,
    k_start: float,
    k_end: float,
    length: float,
    needed: float,
    offset: Any,
    field: Any,
    robot_points: Any,
    object_points: Any,
    robot_radius: float,
    object_radius: float,
    ox: float,
    oy: float,
    scale: float,
) -> float:
    """Lower bound of the clearance [m] of robot and object on all of a push curve.

    At most ``SWEEP_LOSS`` less than at the poses looked at. Coarse ones come first, so that a push
    that collides is found out early: stops at the first pose with less than ``needed``.
    """
    dx, dy = end[0] - start[0], end[1] - start[1]
    ct, st = math.cos(start[2]), math.sin(start[2])
    x, y = ct * dx + st * dy, -st * dx + ct * dy
    turn = end[2] - start[2]
    c, s = k_end * math.cos(turn), k_end * math.sin(turn)
    third_x, third_y = -12.0 * x + 6.0 * (k_start + c), -12.0 * y + 6.0 * s
    radius = max(robot_radius, math.hypot(offset[0], offset[1]) + object_radius)
    parts = max(1, int(math.ceil(length / _COARSEST)))
    most = parts + _FINEST + 1
    # A stack of stretches that have not been looked at: where they begin and end, with the poses
    # and clearances there. What is known of the right end of one is that of the next one's left.
    ends = np.empty((most, 8))
    at = np.empty(most)
    least, bound = 1e9, 1e9
    for k in range(parts + 1):
        row = parts - k
        at[row] = k / parts
        _pose_at(at[row], x, y, k_start, c, s, ends[row])
        ends[row, 7] = _clearance_at(
            ends[row], start, ct, st, offset, least, field, robot_points, object_points,
            robot_radius, object_radius, ox, oy, scale,
        )  # fmt: skip
        least = min(least, ends[row, 7])
        if least < needed:
            return float(least)
    top, looked = parts, parts + 1
    while top > 0:
        a, b = ends[top], ends[top - 1]
        step = at[top - 1] - at[top]
        angle = abs(b[2] - a[2])
        angle = min(angle, 2.0 * math.pi - angle)
        gap = math.hypot(b[0] - a[0], b[1] - a[1]) + radius * angle
        off = _bulge(a, b, step, third_x, third_y, radius)
        low = 0.0
        if off >= 0.0:
            square = piece_square(a[7] * a[7], b[7] * b[7], gap * gap)
            low = max(0.0, math.sqrt(max(0.0, square)) - off)
        if low >= least - SWEEP_LOSS or top + 1 >= most or looked >= _MOST:
            bound = min(bound, low)
            top -= 1
            continue
        # The left half goes on top.
        ends[top + 1] = ends[top]
        at[top + 1] = at[top]
        at[top] = 0.5 * (at[top] + at[top - 1])
        _pose_at(at[top], x, y, k_start, c, s, ends[top])
        ends[top, 7] = _clearance_at(
            ends[top], start, ct, st, offset, least, field, robot_points, object_points,
            robot_radius, object_radius, ox, oy, scale,
        )  # fmt: skip
        least = min(least, ends[top, 7])
        if least < needed:
            return float(least)
        top += 1
        looked += 1
    return float(min(bound, least))


@numba.njit(cache=True, fastmath=True)
def _clearance_at(
    at: Any,
    start: Any,
    ct: float,
    st: float,
    offset: Any,
    least: float,
    field: Any,
    robot_points: Any,
    object_points: Any,
    robot_radius: float,
    object_radius: float,
    ox: float,
    oy: float,
    scale: float,
) -> float:
    """Lower bound of the clearance [m] at a pose; a rough one if that is not below ``least``."""
    px, py = start[0] + ct * at[0] - st * at[1], start[1] + st * at[0] + ct * at[1]
    heading = start[2] + at[2]
    rough = lookup(field, px, py, ox, oy, scale) - robot_radius
    if rough < least:
        rough = points_clearance(field, robot_points, px, py, heading, ox, oy, scale)
    ch, sh = math.cos(heading), math.sin(heading)
    qx, qy = px + ch * offset[0] - sh * offset[1], py + sh * offset[0] + ch * offset[1]
    other = lookup(field, qx, qy, ox, oy, scale) - object_radius
    if other < least:
        turned = heading + offset[2]
        other = points_clearance(field, object_points, qx, qy, turned, ox, oy, scale)
    return float(min(rough, other))


@numba.njit(cache=True, fastmath=True)
def rooms_behind(
    robots: Any,
    back: float,
    turning: float,
    needed: float,
    field: Any,
    robot_points: Any,
    ox: float,
    oy: float,
    scale: float,
) -> Any:
    """Whether the robot at contact poses (n, 3) can back off so far [m] and turn there.

    ``turning`` [m] is what its axle midpoint needs there; the way back keeps ``needed`` [m].
    """
    result = np.zeros(robots.shape[0], dtype=np.bool_)
    steps = max(1, int(math.ceil(back / _BACK)))
    gap = back / steps
    for i in range(robots.shape[0]):
        x, y, theta = robots[i, 0], robots[i, 1], robots[i, 2]
        c, s = math.cos(theta), math.sin(theta)
        if lookup(field, x - back * c, y - back * s, ox, oy, scale) < turning:
            continue
        k, before = 0, -1.0
        while True:
            b = k * gap
            d = points_clearance(field, robot_points, x - b * c, y - b * s, theta, ox, oy, scale)
            if d < needed or (before >= 0.0 and between_samples(min(before, d), gap) < needed):
                break
            if k == steps:
                result[i] = True
                break
            # Clearance falls no faster than the way grows.
            spare = int((d - needed) / gap)
            before = d if spare == 0 else -1.0
            k = min(steps, k + max(1, spare))
    return result


@numba.njit(cache=True)
def room_behind(
    robot: Any,
    back: float,
    turning: float,
    needed: float,
    field: Any,
    robot_points: Any,
    robot_radius: float,
    ox: float,
    oy: float,
    scale: float,
) -> bool:
    """``rooms_behind`` of one contact pose ``(3,)``, in far less time where there is much room.

    robot_radius: [m] of the circle about the axle midpoint that contains the robot.
    """
    x, y, theta = robot
    middle = 0.5 * back
    around = lookup(
        field, x - middle * math.cos(theta), y - middle * math.sin(theta), ox, oy, scale
    )
    if around >= middle + max(turning, robot_radius + needed):
        return True
    found = rooms_behind(
        robot.reshape((1, 3)), back, turning, needed, field, robot_points, ox, oy, scale
    )
    return bool(found[0])
