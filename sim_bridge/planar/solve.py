"""A step of a planar world: contacts, floor and drives as one problem in impulses. Compiled.

Projected Gauss-Seidel (sequential impulses): every constraint in turn asks for the impulse that
satisfies it, clamped to what it may give in a step; each starts from its impulse of the step
before. Coulomb friction is bounded by its contact's normal impulse, the floor under an object by
its limit surface, traction by what a drive has.

The floor follows the law of maximal dissipation: where it slides, the impulse is on the ellipsoid
at the place whose normal is the motion, p = -proj(p - k A v), A being diag(F^2, F^2, T^2): at rest
in that, p is parallel to -A v, which is (3.4). Scaling the impulse that would stop the object
does not give that, because mass and inertia are not in the ratio of F and T.
"""

import math
from typing import Any, NamedTuple

import numba
import numpy as np

from sim_bridge.planar.collide import Neighbours, Parts, find_contacts, place_parts

OBJECT, HOLONOMIC, WHEELS = range(3)
_MARGIN = 1e-3  # [m] within which contacts are found
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


class Contacts(NamedTuple):
    """Contacts of this step and the last one, and the table by which they are matched.

    ints, reals: see collide.py. impulse ``(m, 2)`` normal and along the tangent (ny left of it);
    arms ``(m, 6)``: lever arms about a and b, effective masses. old ``(m,)`` keys,
    old_impulse ``(m, 2)``; number ``(1,)`` of old ones; table: hashed rows of old.
    """

    ints: Any
    reals: Any
    impulse: Any
    arms: Any
    keys: Any
    old: Any
    old_impulse: Any
    number: Any
    table: Any


class Sums(NamedTuple):
    """Contacts of many steps by pairs of bodies: keys ``(r,)``, values ``(r, 8)``: force x, y,
    load-weighted point x, y, normal push x, y, load, steps in touch; stamp ``(r,)``: last step;
    number ``(2,)``: of rows, of steps; table: hashed rows."""

    keys: Any
    values: Any
    stamp: Any
    number: Any
    table: Any


@numba.njit(cache=True)
def _slot(key: int, mask: int) -> int:
    h = key * 0x9E3779B1
    return (h ^ (h >> 15)) & mask


@numba.njit(cache=True)
def _match(c: Contacts, n: int, wide: int) -> None:
    """Impulses of the last step to the contacts of this one; then keep this one's keys."""
    mask = c.table.shape[0] - 1
    for k in range(n):
        key = (c.ints[k, 2] * wide + c.ints[k, 3]) * 1024 + c.ints[k, 4]
        c.keys[k] = key
        c.impulse[k, 0] = c.impulse[k, 1] = 0.0
        slot = _slot(key, mask)
        while c.table[slot] >= 0:
            row = c.table[slot]
            if c.old[row] == key:
                c.impulse[k, 0], c.impulse[k, 1] = c.old_impulse[row, 0], c.old_impulse[row, 1]
                break
            slot = (slot + 1) & mask


@numba.njit(cache=True)
def _keep(c: Contacts, n: int) -> None:
    """Note this step's impulses for the next one."""
    mask = c.table.shape[0] - 1
    for k in range(c.number[0]):  # empty what is in use
        slot = _slot(c.old[k], mask)
        while c.table[slot] >= 0:
            c.table[slot] = -1
            slot = (slot + 1) & mask
    for k in range(n):
        c.old[k] = c.keys[k]
        c.old_impulse[k, 0], c.old_impulse[k, 1] = c.impulse[k, 0], c.impulse[k, 1]
        slot = _slot(c.keys[k], mask)
        while c.table[slot] >= 0:
            slot = (slot + 1) & mask
        c.table[slot] = k
    c.number[0] = n


@numba.njit(cache=True)
def _give(b: Bodies, i: int, px: float, py: float, moment: float) -> None:
    b.velocity[i, 0] += b.inverse[i, 0] * px
    b.velocity[i, 1] += b.inverse[i, 0] * py
    b.velocity[i, 2] += b.inverse[i, 1] * moment


@numba.njit(cache=True)
def _give_contact(b: Bodies, c: Contacts, k: int, jn: float, jt: float) -> None:
    """Impulses along the normal and the tangent (-ny, nx) of a contact, on both bodies."""
    nx, ny = c.reals[k, 0], c.reals[k, 1]
    px, py = jn * nx - jt * ny, jn * ny + jt * nx
    a, o = c.ints[k, 0], c.ints[k, 1]
    _give(b, a, px, py, c.arms[k, 0] * py - c.arms[k, 1] * px)
    if o >= 0:
        _give(b, o, -px, -py, c.arms[k, 3] * px - c.arms[k, 2] * py)


@numba.njit(cache=True)
def _prepare(b: Bodies, c: Contacts, n: int) -> None:
    """Lever arms and effective masses; the impulses of the last step are given again."""
    for k in range(n):
        a, o = c.ints[k, 0], c.ints[k, 1]
        nx, ny = c.reals[k, 0], c.reals[k, 1]
        rx, ry = c.reals[k, 2] - b.pose[a, 0], c.reals[k, 3] - b.pose[a, 1]
        c.arms[k, 0], c.arms[k, 1] = rx, ry
        normal = b.inverse[a, 0] + b.inverse[a, 1] * (rx * ny - ry * nx) ** 2
        tangent = b.inverse[a, 0] + b.inverse[a, 1] * (rx * nx + ry * ny) ** 2
        if o >= 0:
            rx, ry = c.reals[k, 2] - b.pose[o, 0], c.reals[k, 3] - b.pose[o, 1]
            c.arms[k, 2], c.arms[k, 3] = rx, ry
            normal += b.inverse[o, 0] + b.inverse[o, 1] * (rx * ny - ry * nx) ** 2
            tangent += b.inverse[o, 0] + b.inverse[o, 1] * (rx * nx + ry * ny) ** 2
        c.arms[k, 4], c.arms[k, 5] = normal, tangent
        _give_contact(b, c, k, c.impulse[k, 0], c.impulse[k, 1])


@numba.njit(cache=True)
def _contact(b: Bodies, c: Contacts, k: int, dt: float) -> float:
    """One contact's turn; the greatest change of an impulse."""
    a, o = c.ints[k, 0], c.ints[k, 1]
    nx, ny = c.reals[k, 0], c.reals[k, 1]
    ux = b.velocity[a, 0] - b.velocity[a, 2] * c.arms[k, 1]
    uy = b.velocity[a, 1] + b.velocity[a, 2] * c.arms[k, 0]
    if o >= 0:
        ux -= b.velocity[o, 0] - b.velocity[o, 2] * c.arms[k, 3]
        uy -= b.velocity[o, 1] + b.velocity[o, 2] * c.arms[k, 2]
    gap, most = c.reals[k, 4], c.reals[k, 5] * c.impulse[k, 0]
    before = c.impulse[k, 1]
    jt = min(most, max(-most, before - (uy * nx - ux * ny) / c.arms[k, 5]))
    c.impulse[k, 1] = jt
    slid = jt - before
    if slid != 0.0:
        _give_contact(b, c, k, 0.0, slid)
        ux = b.velocity[a, 0] - b.velocity[a, 2] * c.arms[k, 1]
        uy = b.velocity[a, 1] + b.velocity[a, 2] * c.arms[k, 0]
        if o >= 0:
            ux -= b.velocity[o, 0] - b.velocity[o, 2] * c.arms[k, 3]
            uy -= b.velocity[o, 1] + b.velocity[o, 2] * c.arms[k, 2]
    bias = gap / dt if gap > 0.0 else max(-_FASTEST, _PUSH_OUT * min(0.0, gap + _SLOP) / dt)
    before = c.impulse[k, 0]
    jn = max(0.0, before - (ux * nx + uy * ny + bias) / c.arms[k, 4])
    c.impulse[k, 0] = jn
    if jn != before:
        _give_contact(b, c, k, jn - before, 0.0)
    return float(max(abs(slid), abs(jn - before)))


@numba.njit(cache=True)
def _floor(b: Bodies, i: int, dt: float) -> float:
    """The floor under an object; how much its impulse changes."""
    f, t = b.floor[i, 0], b.floor[i, 1]
    g = b.given
    k = min(1.0 / (b.inverse[i, 0] * f * f), 1.0 / (b.inverse[i, 1] * t * t))
    px = g[i, 0] - k * f * f * b.velocity[i, 0]
    py = g[i, 1] - k * f * f * b.velocity[i, 1]
    pt = g[i, 2] - k * t * t * b.velocity[i, 2]
    r = math.sqrt((px * px + py * py) / (f * f) + pt * pt / (t * t)) / dt
    if r > 1.0:
        px, py, pt = px / r, py / r, pt / r
    dx, dy, turn = px - g[i, 0], py - g[i, 1], pt - g[i, 2]
    _give(b, i, dx, dy, turn)
    g[i, 0], g[i, 1], g[i, 2] = px, py, pt
    return float(max(abs(dx), abs(dy), abs(turn) * f / t))


@numba.njit(cache=True)
def _traction(b: Bodies, i: int, wx: float, wy: float, dt: float) -> float:
    """A holonomic drive: towards its target (wx, wy) in the world, with bounded force."""
    g = b.given
    px = g[i, 0] + (wx - b.velocity[i, 0]) / b.inverse[i, 0]
    py = g[i, 1] + (wy - b.velocity[i, 1]) / b.inverse[i, 0]
    size, most = math.hypot(px, py), b.most[i, 0] * dt
    if size > most:
        px, py = px * most / size, py * most / size
    most = b.most[i, 1] * dt
    pt = g[i, 2] + (b.target[i, 2] - b.velocity[i, 2]) / b.inverse[i, 1]
    pt = min(most, max(-most, pt))
    dx, dy = px - g[i, 0], py - g[i, 1]
    _give(b, i, dx, dy, pt - g[i, 2])
    g[i, 0], g[i, 1], g[i, 2] = px, py, pt
    return float(max(abs(dx), abs(dy)))


@numba.njit(cache=True)
def _wheels(b: Bodies, i: int, c: float, s: float, dt: float) -> float:
    """Two wheels that hold their speeds and do not slide aside, each within its friction."""
    half, ahead = b.track[i, 0], b.track[i, 1]
    g, im, ij = b.given, b.inverse[i, 0], b.inverse[i, 1]
    sticks, torque = b.most[i, 0] * dt, b.most[i, 1] * dt
    change = 0.0
    for w in range(2):
        side = half if w == 0 else -half  # left, right
        rx, ry = -ahead * c - side * s, -ahead * s + side * c
        ux = b.velocity[i, 0] - b.velocity[i, 2] * ry
        uy = b.velocity[i, 1] + b.velocity[i, 2] * rx
        wanted = b.target[i, 0] - b.target[i, 2] * side
        along = im + ij * (rx * s - ry * c) ** 2
        across = im + ij * (rx * c + ry * s) ** 2
        pl = g[i, 2 * w] + (wanted - (ux * c + uy * s)) / along
        pl = min(torque, max(-torque, pl))
        # Both wheels lie on the axle and share what keeps it from sliding.
        pc = g[i, 2 * w + 1] - 0.5 * (uy * c - ux * s) / across
        size = math.hypot(pl, pc)
        if size > sticks:
            pl, pc = pl * sticks / size, pc * sticks / size
        dl, dc = pl - g[i, 2 * w], pc - g[i, 2 * w + 1]
        px, py = dl * c - dc * s, dl * s + dc * c
        _give(b, i, px, py, rx * py - ry * px)
        g[i, 2 * w], g[i, 2 * w + 1] = pl, pc
        change = max(change, abs(dl), abs(dc))
    return change


@numba.njit(cache=True)
def _again(b: Bodies, i: int, c: float, s: float) -> None:
    """Give floor or drive the impulses of the last step."""
    g = b.given
    if b.kind[i] != WHEELS:
        _give(b, i, g[i, 0], g[i, 1], g[i, 2])
        return
    for w in range(2):
        side = b.track[i, 0] if w == 0 else -b.track[i, 0]
        rx, ry = -b.track[i, 1] * c - side * s, -b.track[i, 1] * s + side * c
        px = g[i, 2 * w] * c - g[i, 2 * w + 1] * s
        py = g[i, 2 * w] * s + g[i, 2 * w + 1] * c
        _give(b, i, px, py, rx * py - ry * px)


@numba.njit(cache=True)
def _add_up(b: Bodies, c: Contacts, n: int, moving: int, sums: Sums, dt: float) -> None:
    """Contacts of a step to the sums."""
    mask, bodies = sums.table.shape[0] - 1, b.pose.shape[0]
    sums.number[1] += 1
    now = sums.number[1]
    for k in range(n):
        jn, jt = c.impulse[k, 0] / dt, c.impulse[k, 1] / dt
        if jn <= 0.0:
            continue
        other = c.ints[k, 1] if c.ints[k, 1] >= 0 else bodies + c.ints[k, 3] - moving
        a, sign = c.ints[k, 0], 1.0
        if other < a:  # a pair is told in one order
            a, other, sign = other, a, -1.0
        key = (a << 32) + other
        slot = _slot(key, mask)
        while sums.table[slot] >= 0 and sums.keys[sums.table[slot]] != key:
            slot = (slot + 1) & mask
        row = sums.table[slot]
        if row < 0:
            row = sums.number[0]
            if row >= sums.keys.shape[0]:
                continue
            sums.table[slot] = row
            sums.keys[row] = key
            sums.values[row, :] = 0.0
            sums.stamp[row] = 0
            sums.number[0] += 1
        nx, ny, v = sign * c.reals[k, 0], sign * c.reals[k, 1], sums.values[row]
        v[0] += jn * nx - jt * ny
        v[1] += jn * ny + jt * nx
        v[2] += jn * c.reals[k, 2]
        v[3] += jn * c.reals[k, 3]
        v[4] += jn * nx
        v[5] += jn * ny
        v[6] += jn
        if sums.stamp[row] != now:
            sums.stamp[row] = now
            v[7] += 1.0


@numba.njit(cache=True)
def advance(
    steps: int, dt: float, iterations: int, tolerance: float, b: Bodies, parts: Parts,
    near: Neighbours, c: Contacts, sums: Sums, summed: bool,
) -> None:  # fmt: skip
    """Steps of dt [s]; iterations end before when no impulse changes by tolerance [N] dt."""
    bodies = b.pose.shape[0]
    cosine, sine = np.ones(bodies), np.zeros(bodies)
    for _ in range(steps):
        place_parts(b.pose, parts)
        n = find_contacts(c.ints, c.reals, parts, near, b.there, _MARGIN)
        _match(c, n, parts.body.shape[0])
        for i in range(bodies):
            if b.there[i] and b.kind[i] != OBJECT:
                # Along the heading in the middle of the step a turning robot stays on its arc.
                middle = b.pose[i, 2] + 0.5 * dt * b.velocity[i, 2]
                cosine[i], sine[i] = math.cos(middle), math.sin(middle)
            if b.there[i]:
                _again(b, i, cosine[i], sine[i])
        _prepare(b, c, n)
        for _ in range(iterations):
            change = 0.0
            for i in range(bodies):
                if not b.there[i]:
                    continue
                if b.kind[i] == OBJECT:
                    change = max(change, _floor(b, i, dt))
                elif b.kind[i] == WHEELS:
                    change = max(change, _wheels(b, i, cosine[i], sine[i], dt))
                else:
                    wx, wy = b.target[i, 0], b.target[i, 1]
                    if b.own_frame[i]:
                        wx, wy = cosine[i] * wx - sine[i] * wy, sine[i] * wx + cosine[i] * wy
                    change = max(change, _traction(b, i, wx, wy, dt))
            for k in range(n):
                change = max(change, _contact(b, c, k, dt))
            if change <= tolerance * dt:
                break
        _keep(c, n)
        if summed:
            _add_up(b, c, n, parts.moving, sums, dt)
        for i in range(bodies):
            if b.there[i]:
                for j in range(3):
                    b.pose[i, j] += dt * b.velocity[i, j]
