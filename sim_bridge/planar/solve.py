"""Steps of a planar world. Compiled."""

import math

import numba
import numpy as np

from sim_bridge.planar.collide import Neighbours, Parts, find_contacts, place_parts
from sim_bridge.planar.constraints import OBJECT, Bodies, again, prepare, turns
from sim_bridge.planar.memory import Contacts, Sums, add_up, keep, match

_MARGIN = 1e-3  # [m] within which contacts are found


@numba.njit(cache=True, error_model="numpy")
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
        match(c, n, parts.body.shape[0])
        for i in range(bodies):
            if b.there[i] and b.kind[i] != OBJECT:
                # Along the heading in the middle of the step a turning robot stays on its arc.
                middle = b.pose[i, 2] + 0.5 * dt * b.velocity[i, 2]
                cosine[i], sine[i] = math.cos(middle), math.sin(middle)
            if b.there[i]:
                again(b, i, cosine[i], sine[i])
        prepare(b, c, n, dt)
        turns(b, c, n, cosine, sine, iterations, tolerance * dt, dt)
        keep(c, n)
        if summed:
            add_up(c, n, bodies, parts.moving, sums, dt)
        for i in range(bodies):
            if b.there[i]:
                for j in range(3):
                    b.pose[i, j] += dt * b.velocity[i, j]
