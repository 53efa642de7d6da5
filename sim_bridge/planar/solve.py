"""Steps of a planar world. Compiled."""

import math

import numba
import numpy as np

from sim_bridge.planar.collide import Neighbours, Parts, find_contacts, place_parts
from sim_bridge.planar.constraints import OBJECT, Bodies, again, prepare, turns
from sim_bridge.planar.memory import Contacts, Sums, add_up, keep, match

_MARGIN = 1e-3  # [m] within which contacts are found at least


@numba.njit(cache=True, error_model="numpy")
def _reach(b: Bodies, radius: float, dt: float) -> float:
    """[m] within which contacts must be found, so that nobody meets another within a step."""
    fastest, widest = 0.0, 0.0
    for i in range(b.pose.shape[0]):
        if b.there[i]:
            v = max(
                math.hypot(b.velocity[i, 0], b.velocity[i, 1]),
                math.hypot(b.target[i, 0], b.target[i, 1]),
            )
            fastest = max(fastest, v)
            widest = max(widest, abs(b.velocity[i, 2]), abs(b.target[i, 2]))
    return max(_MARGIN, 2.0 * dt * (fastest + widest * radius))


@numba.njit(cache=True, error_model="numpy")
def advance(
    steps: int, dt: float, iterations: int, tolerance: float, b: Bodies, parts: Parts,
    near: Neighbours, c: Contacts, sums: Sums, summed: bool, radius: float,
) -> int:  # fmt: skip
    """Steps of dt [s]; turns end before ``iterations`` when no impulse changes by tolerance [N] dt.

    radius: [m] of the largest part. Returns how many steps were made: fewer where there is no room
    for all contacts, and then nothing has been done yet of the next one.
    """
    bodies = b.pose.shape[0]
    cosine, sine = np.ones(bodies), np.zeros(bodies)
    for done in range(steps):
        place_parts(b.pose, parts)
        margin = _reach(b, radius, dt)
        n = find_contacts(c.ints, c.reals, parts, near, b.there, margin)
        if n >= c.ints.shape[0] or (summed and sums.number[0] + n > sums.keys.shape[0]):
            return done
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
    return steps
