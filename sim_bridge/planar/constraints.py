"""Contacts, floor and drives of a planar world as one problem in impulses. Compiled.

Projected Gauss-Seidel (sequential impulses): every constraint in turn asks for the impulse that
satisfies it, clamped to what it may give in a step; each starts from its impulse of the step
before. Coulomb friction is bounded by its contact's normal impulse, the floor under an object by
its limit surface, traction by what a drive has.

The floor follows the law of maximal dissipation: where it slides, the impulse is on the ellipsoid
at the place whose normal is the motion. Its turn is p := proj(p - k A v), A being diag(F^2, F^2,
T^2), and where that changes nothing p is parallel to -A v, which is (3.4). Scaling the impulse that
would stop the object does not give that, because mass and inertia are not in the ratio of F and T.
"""

import math
from typing import Any, NamedTuple

import numba

from sim_bridge.planar.memory import Contacts

OBJECT, HOLONOMIC, WHEELS = range(3)
_SLOP = 1e-5  # [m] of overlap that is let be
_PUSH_OUT = 0.2  # part of an overlap that is made good in a step
_FASTEST = 0.2  # [m/s] at most while that is done


class Bodies(NamedTuple):
    """What moves; a row a body. Velocities and poses ``(n, 3)`` are of the centre of mass.

    inverse ``(n, 2)``: 1 / mass, 1 / inertia. kind: OBJECT, HOLONOMIC or WHEELS. there: whether
    it takes part. floor ``(n, 2)`` [N], [Nm]: greatest friction under an object. target ``(n, 3)``:
    twist that a drive is to make; own_frame: in the robot's frame. most ``(n, 2)``: [N], [Nm] of a
    holonomic drive; [N] by friction and [N] by torque of one wheel. track ``(n, 2)`` [m]: half
    the wheel distance; centre of mass ahead of the axle. given ``(n, 4)``: impulses of floor or
    drive in the last step.
    """

    pose: Any
    velocity: Any
    inverse: Any
    kind: Any
    there: Any
    floor: Any
    target: Any
    own_frame: Any
    most: Any
    track: Any
    given: Any


@numba.njit(cache=True, error_model="numpy")
def _give(velocity: Any, inverse: Any, i: int, rx: float, ry: float, px: float, py: float) -> None:
    """An impulse at a lever arm."""
    velocity[i, 0] += inverse[i, 0] * px
    velocity[i, 1] += inverse[i, 0] * py
    velocity[i, 2] += inverse[i, 1] * (rx * py - ry * px)


@numba.njit(cache=True, error_model="numpy")
def prepare(b: Bodies, c: Contacts, n: int, dt: float) -> None:
    """Rows of all contacts; the impulses of the last step are given again."""
    velocity, inverse, pose = b.velocity, b.inverse, b.pose
    ints, reals, rows, impulse = c.ints, c.reals, c.rows, c.impulse
    for k in range(n):
        a, o = ints[k, 0], ints[k, 1]
        nx, ny, gap = reals[k, 0], reals[k, 1], reals[k, 4]
        rx, ry = reals[k, 2] - pose[a, 0], reals[k, 3] - pose[a, 1]
        qx, qy = 0.0, 0.0
        normal = inverse[a, 0] + inverse[a, 1] * (rx * ny - ry * nx) ** 2
        tangent = inverse[a, 0] + inverse[a, 1] * (rx * nx + ry * ny) ** 2
        if o >= 0:
            qx, qy = reals[k, 2] - pose[o, 0], reals[k, 3] - pose[o, 1]
            normal += inverse[o, 0] + inverse[o, 1] * (qx * ny - qy * nx) ** 2
            tangent += inverse[o, 0] + inverse[o, 1] * (qx * nx + qy * ny) ** 2
        bias = gap / dt if gap > 0.0 else max(-_FASTEST, _PUSH_OUT * min(0.0, gap + _SLOP) / dt)
        rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3], rows[k, 4] = nx, ny, rx, ry, qx
        rows[k, 5], rows[k, 6], rows[k, 7] = qy, 1.0 / normal, 1.0 / tangent
        rows[k, 8], rows[k, 9] = bias, reals[k, 5]
        jn, jt = impulse[k, 0], impulse[k, 1]
        px, py = jn * nx - jt * ny, jn * ny + jt * nx
        _give(velocity, inverse, a, rx, ry, px, py)
        if o >= 0:
            _give(velocity, inverse, o, qx, qy, -px, -py)


@numba.njit(cache=True, error_model="numpy")
def _contacts(velocity: Any, inverse: Any, ints: Any, rows: Any, impulse: Any, n: int) -> float:
    """Every contact's turn, friction before load; the greatest change of an impulse."""
    change = 0.0
    for k in range(n):
        a, o = ints[k, 0], ints[k, 1]
        nx, ny, rx, ry = rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3]
        qx, qy = rows[k, 4], rows[k, 5]
        ux = velocity[a, 0] - velocity[a, 2] * ry
        uy = velocity[a, 1] + velocity[a, 2] * rx
        im, ij = inverse[a, 0], inverse[a, 1]
        om, oj = 0.0, 0.0
        if o >= 0:
            ux -= velocity[o, 0] - velocity[o, 2] * qy
            uy -= velocity[o, 1] + velocity[o, 2] * qx
            om, oj = inverse[o, 0], inverse[o, 1]
        most = rows[k, 9] * impulse[k, 0]
        jt = min(most, max(-most, impulse[k, 1] - (uy * nx - ux * ny) * rows[k, 7]))
        dt = jt - impulse[k, 1]
        # What the friction's change makes of the approach is known without asking the bodies.
        across = rx * nx + ry * ny
        un = ux * nx + uy * ny + dt * ij * (rx * ny - ry * nx) * across
        if o >= 0:
            un += dt * oj * (qx * ny - qy * nx) * (qx * nx + qy * ny)
        jn = max(0.0, impulse[k, 0] - (un + rows[k, 8]) * rows[k, 6])
        dn = jn - impulse[k, 0]
        impulse[k, 0], impulse[k, 1] = jn, jt
        px, py = dn * nx - dt * ny, dn * ny + dt * nx
        velocity[a, 0] += im * px
        velocity[a, 1] += im * py
        velocity[a, 2] += ij * (rx * py - ry * px)
        if o >= 0:
            velocity[o, 0] -= om * px
            velocity[o, 1] -= om * py
            velocity[o, 2] -= oj * (qx * py - qy * px)
        change = max(change, abs(dn), abs(dt))
    return change


@numba.njit(cache=True, error_model="numpy")
def _floor(velocity: Any, inverse: Any, floor: Any, given: Any, i: int, dt: float) -> float:
    """The floor under an object; how much its impulse changes."""
    f, t, im, ij = floor[i, 0], floor[i, 1], inverse[i, 0], inverse[i, 1]
    k = min(1.0 / (im * f * f), 1.0 / (ij * t * t))
    px = given[i, 0] - k * f * f * velocity[i, 0]
    py = given[i, 1] - k * f * f * velocity[i, 1]
    pt = given[i, 2] - k * t * t * velocity[i, 2]
    r = math.sqrt((px * px + py * py) / (f * f) + pt * pt / (t * t)) / dt
    if r > 1.0:
        px, py, pt = px / r, py / r, pt / r
    dx, dy, turn = px - given[i, 0], py - given[i, 1], pt - given[i, 2]
    velocity[i, 0] += im * dx
    velocity[i, 1] += im * dy
    velocity[i, 2] += ij * turn
    given[i, 0], given[i, 1], given[i, 2] = px, py, pt
    return float(max(abs(dx), abs(dy), abs(turn) * f / t))


@numba.njit(cache=True, error_model="numpy")
def _traction(
    velocity: Any, inverse: Any, most: Any, given: Any, i: int, wx: float, wy: float, turn: float,
    dt: float,
) -> float:  # fmt: skip
    """A holonomic drive: towards its target (wx, wy) in the world, with bounded force."""
    im, ij = inverse[i, 0], inverse[i, 1]
    px = given[i, 0] + (wx - velocity[i, 0]) / im
    py = given[i, 1] + (wy - velocity[i, 1]) / im
    square, limit = px * px + py * py, most[i, 0] * dt
    if square > limit * limit:
        shorter = limit / math.sqrt(square)
        px, py = px * shorter, py * shorter
    limit = most[i, 1] * dt
    pt = min(limit, max(-limit, given[i, 2] + (turn - velocity[i, 2]) / ij))
    dx, dy, spin = px - given[i, 0], py - given[i, 1], pt - given[i, 2]
    velocity[i, 0] += im * dx
    velocity[i, 1] += im * dy
    velocity[i, 2] += ij * spin
    given[i, 0], given[i, 1], given[i, 2] = px, py, pt
    return float(max(abs(dx), abs(dy), abs(spin) * most[i, 0] / most[i, 1]))


@numba.njit(cache=True, error_model="numpy")
def _wheels(
    velocity: Any, inverse: Any, most: Any, track: Any, target: Any, given: Any, i: int,
    c: float, s: float, dt: float,
) -> float:  # fmt: skip
    """Two wheels that hold their speeds and do not slide aside, each within its friction."""
    half, ahead = track[i, 0], track[i, 1]
    im, ij = inverse[i, 0], inverse[i, 1]
    sticks, torque = most[i, 0] * dt, most[i, 1] * dt
    change = 0.0
    for w in range(2):
        side = half if w == 0 else -half  # left, right
        rx, ry = -ahead * c - side * s, -ahead * s + side * c
        ux = velocity[i, 0] - velocity[i, 2] * ry
        uy = velocity[i, 1] + velocity[i, 2] * rx
        wanted = target[i, 0] - target[i, 2] * side
        along = im + ij * (rx * s - ry * c) ** 2
        across = im + ij * (rx * c + ry * s) ** 2
        pl = given[i, 2 * w] + (wanted - (ux * c + uy * s)) / along
        pl = min(torque, max(-torque, pl))
        # Both wheels lie on the axle and share what keeps it from sliding.
        pc = given[i, 2 * w + 1] - 0.5 * (uy * c - ux * s) / across
        square = pl * pl + pc * pc
        if square > sticks * sticks:
            shorter = sticks / math.sqrt(square)
            pl, pc = pl * shorter, pc * shorter
        dl, dc = pl - given[i, 2 * w], pc - given[i, 2 * w + 1]
        _give(velocity, inverse, i, rx, ry, dl * c - dc * s, dl * s + dc * c)
        given[i, 2 * w], given[i, 2 * w + 1] = pl, pc
        change = max(change, abs(dl), abs(dc))
    return float(change)


@numba.njit(cache=True, error_model="numpy")
def again(b: Bodies, i: int, c: float, s: float) -> None:
    """Give floor or drive the impulses of the last step."""
    velocity, inverse, given = b.velocity, b.inverse, b.given
    if b.kind[i] != WHEELS:
        velocity[i, 0] += inverse[i, 0] * given[i, 0]
        velocity[i, 1] += inverse[i, 0] * given[i, 1]
        velocity[i, 2] += inverse[i, 1] * given[i, 2]
        return
    for w in range(2):
        side = b.track[i, 0] if w == 0 else -b.track[i, 0]
        rx, ry = -b.track[i, 1] * c - side * s, -b.track[i, 1] * s + side * c
        px = given[i, 2 * w] * c - given[i, 2 * w + 1] * s
        py = given[i, 2 * w] * s + given[i, 2 * w + 1] * c
        _give(velocity, inverse, i, rx, ry, px, py)


@numba.njit(cache=True, error_model="numpy")
def turns(
    b: Bodies, c: Contacts, n: int, cosine: Any, sine: Any, iterations: int, least: float,
    dt: float,
) -> None:  # fmt: skip
    """Floors and drives, then contacts, until no impulse changes by more than ``least``."""
    velocity, inverse, given, kind, there = b.velocity, b.inverse, b.given, b.kind, b.there
    floor, most, track, target, own = b.floor, b.most, b.track, b.target, b.own_frame
    ints, rows, impulse = c.ints, c.rows, c.impulse
    for _ in range(iterations):
        change = 0.0
        for i in range(kind.shape[0]):
            if not there[i]:
                continue
            if kind[i] == OBJECT:
                change = max(change, _floor(velocity, inverse, floor, given, i, dt))
            elif kind[i] == WHEELS:
                change = max(
                    change,
                    _wheels(
                        velocity, inverse, most, track, target, given, i, cosine[i], sine[i], dt
                    ),
                )
            else:
                wx, wy = target[i, 0], target[i, 1]
                if own[i]:
                    wx, wy = cosine[i] * wx - sine[i] * wy, sine[i] * wx + cosine[i] * wy
                change = max(
                    change,
                    _traction(velocity, inverse, most, given, i, wx, wy, target[i, 2], dt),
                )
        change = max(change, _contacts(velocity, inverse, ints, rows, impulse, n))
        if change <= least:
            break
