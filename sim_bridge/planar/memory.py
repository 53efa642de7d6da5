"""What contacts remember: impulses from step to step, and sums until they are read. Compiled."""

from typing import Any, NamedTuple

import numba


class Contacts(NamedTuple):
    """Contacts of this step and the last one, and the table by which they are matched.

    ints, reals: see collide.py. impulse ``(m, 2)`` along the normal and along the tangent, which
    is to its left; rows ``(m, 10)``: normal, lever arms about a and b, inverses of the effective
    masses along both, speed at which the gap would be closed, friction. old ``(m,)`` keys,
    old_impulse ``(m, 2)``; number ``(1,)`` of old ones; table: hashed rows of old.
    """

    ints: Any
    reals: Any
    impulse: Any
    rows: Any
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


@numba.njit(cache=True, error_model="numpy")
def _slot(key: int, mask: int) -> int:
    h = key * 0x9E3779B1
    return (h ^ (h >> 15)) & mask


@numba.njit(cache=True, error_model="numpy")
def rehash(keys: Any, number: Any, table: Any) -> None:
    """Fill an empty table with the rows of the first ``number[0]`` keys."""
    mask = table.shape[0] - 1
    for row in range(number[0]):
        slot = _slot(keys[row], mask)
        while table[slot] >= 0:
            slot = (slot + 1) & mask
        table[slot] = row


@numba.njit(cache=True, error_model="numpy")
def match(c: Contacts, n: int, wide: int) -> None:
    """Impulses of the last step to the contacts of this one; then keep this one's keys."""
    ints, keys, impulse, table = c.ints, c.keys, c.impulse, c.table
    old, old_impulse = c.old, c.old_impulse
    mask = table.shape[0] - 1
    for k in range(n):
        key = (ints[k, 2] * wide + ints[k, 3]) * 1024 + ints[k, 4]
        keys[k] = key
        impulse[k, 0] = impulse[k, 1] = 0.0
        slot = _slot(key, mask)
        while table[slot] >= 0:
            row = table[slot]
            if old[row] == key:
                impulse[k, 0], impulse[k, 1] = old_impulse[row, 0], old_impulse[row, 1]
                break
            slot = (slot + 1) & mask


@numba.njit(cache=True, error_model="numpy")
def keep(c: Contacts, n: int) -> None:
    """Note this step's impulses for the next one."""
    keys, impulse, table, old, old_impulse = c.keys, c.impulse, c.table, c.old, c.old_impulse
    mask = table.shape[0] - 1
    for k in range(c.number[0]):  # empty what is in use
        slot = _slot(old[k], mask)
        while table[slot] >= 0:
            table[slot] = -1
            slot = (slot + 1) & mask
    for k in range(n):
        old[k] = keys[k]
        old_impulse[k, 0], old_impulse[k, 1] = impulse[k, 0], impulse[k, 1]
        slot = _slot(keys[k], mask)
        while table[slot] >= 0:
            slot = (slot + 1) & mask
        table[slot] = k
    c.number[0] = n


@numba.njit(cache=True, error_model="numpy")
def add_up(c: Contacts, n: int, bodies: int, moving: int, sums: Sums, dt: float) -> None:
    """Contacts of a step to the sums."""
    ints, reals, impulse = c.ints, c.reals, c.impulse
    keys, values, stamp, number, table = sums.keys, sums.values, sums.stamp, sums.number, sums.table
    mask = table.shape[0] - 1
    number[1] += 1
    now = number[1]
    for k in range(n):
        jn, jt = impulse[k, 0] / dt, impulse[k, 1] / dt
        if jn <= 0.0:
            continue
        other = ints[k, 1] if ints[k, 1] >= 0 else bodies + ints[k, 3] - moving
        a, sign = ints[k, 0], 1.0
        if other < a:  # a pair is told in one order
            a, other, sign = other, a, -1.0
        key = (a << 32) + other
        slot = _slot(key, mask)
        while table[slot] >= 0 and keys[table[slot]] != key:
            slot = (slot + 1) & mask
        row = table[slot]
        if row < 0:
            row = number[0]
            table[slot] = row
            keys[row] = key
            values[row, :] = 0.0
            stamp[row] = 0
            number[0] += 1
        nx, ny = sign * reals[k, 0], sign * reals[k, 1]
        values[row, 0] += jn * nx - jt * ny
        values[row, 1] += jn * ny + jt * nx
        values[row, 2] += jn * reals[k, 2]
        values[row, 3] += jn * reals[k, 3]
        values[row, 4] += jn * nx
        values[row, 5] += jn * ny
        values[row, 6] += jn
        if stamp[row] != now:
            stamp[row] = now
            values[row, 7] += 1.0
