"""Random places for robots in a room."""

import math

import numpy as np

from push_model.arrays import Array
from push_model.free_space import FreeSpace, Obstacles
from push_model.outlines import distance, inside
from push_model.specs import ObjectSpec

_GAP = 0.02  # [m] between all at the start
_AROUND = 1.0  # [m] about an object in the origin


def around(random: np.random.Generator, count: int, item: ObjectSpec, radius: float) -> Array:
    """``(n, 3)`` poses about an object in the origin, apart from it and each other."""
    reach = max(_AROUND, 0.25 * math.sqrt(count))
    placed: list[Array] = []
    while len(placed) < count:
        p = random.uniform(-reach, reach, 2)
        outline = item.outline
        if inside(outline, p[None])[0] or distance(outline, p[None])[0] < radius + _GAP:
            continue
        if all(np.hypot(*(p - q)) > 2.0 * radius + _GAP for q in placed):
            placed.append(p)
    return np.column_stack([np.array(placed), random.uniform(-math.pi, math.pi, count)])


def scattered(
    random: np.random.Generator,
    count: int,
    space: FreeSpace,
    outline: Array,
    radius: float,
    gap: float = _GAP,
) -> Array:
    """``(n, 3)`` poses anywhere on a map with an object ``(k, 2)`` [m] on it, all of them ``gap``
    [m] apart."""
    low, high = space.places.min(axis=0), space.places.max(axis=0)
    placed = np.zeros((0, 3))
    while len(placed) < count:
        p = random.uniform(low, high)
        discs = np.column_stack([placed[:, :2], np.full(len(placed), radius)])
        if space.room(p[None], Obstacles((outline,), discs))[0] > radius + gap:
            placed = np.vstack([placed, [*p, random.uniform(-math.pi, math.pi)]])
    return placed
