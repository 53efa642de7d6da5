"""Many planar worlds that differ only in their state, one after the other in one call. Compiled."""

from typing import Any, TypeVar

import numba
import numpy as np

from sim_bridge.planar.collide import Neighbours, Parts
from sim_bridge.planar.constraints import Bodies
from sim_bridge.planar.memory import Contacts, Sums
from sim_bridge.planar.solve import advance

Table = TypeVar("Table", Bodies, Parts, Neighbours, Contacts)
OWN: dict[type[Any], tuple[str, ...]] = {
    Bodies: Bodies._fields,
    Parts: ("friction", "middles", "corners"),
    Neighbours: ("heads", "following", "cells", "stamp"),
    Contacts: Contacts._fields,
}
"""What each world has a copy of; the rest is shared."""


def stacked(table: Table, count: int) -> Table:
    """A table for so many worlds: what is their own has a further first axis."""
    own: dict[str, Any] = {
        name: np.repeat(getattr(table, name)[None], count, axis=0) for name in OWN[type(table)]
    }
    return table._replace(**own)


def of_world(table: Table, world: int) -> Table:
    """Views on one world's part of a table."""
    own: dict[str, Any] = {name: getattr(table, name)[world] for name in OWN[type(table)]}
    return table._replace(**own)


@numba.njit(cache=True, error_model="numpy", nogil=True)
def advance_all(
    steps: int, dt: float, iterations: int, tolerance: float, b: Bodies, p: Parts,
    near: Neighbours, c: Contacts, sums: Sums, radius: float, done: Any,
) -> int:  # fmt: skip
    """Bring every world from ``done[w]`` steps of dt [s] to ``steps``; see ``advance``.

    Returns the first world that has no room for its contacts, -1 where all have. Sums are not kept.
    """
    for w in range(done.shape[0]):
        if done[w] >= steps:
            continue
        done[w] += advance(
            steps - done[w],
            dt,
            iterations,
            tolerance,
            Bodies(
                b.pose[w], b.velocity[w], b.inverse[w], b.kind[w], b.there[w], b.floor[w],
                b.target[w], b.own_frame[w], b.most[w], b.track[w], b.given[w],
            ),
            Parts(
                p.moving, p.body, p.first, p.count, p.local, p.radius, p.friction[w], p.vertices,
                p.middles[w], p.corners[w], p.large, p.small,
            ),
            Neighbours(
                near.heads[w], near.following[w], near.cells[w], near.spacing, near.low, near.size,
                near.start, near.items, near.box, near.cell, near.stamp[w],
            ),
            Contacts(
                c.ints[w], c.reals[w], c.impulse[w], c.rows[w], c.keys[w], c.old[w],
                c.old_impulse[w], c.number[w], c.table[w],
            ),
            sums,
            False,
            radius,
        )  # fmt: skip
        if done[w] < steps:
            return w
    return -1
