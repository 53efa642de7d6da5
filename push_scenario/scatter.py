"""Random places for robots in a room, from a generator that the caller has."""

import math
from collections.abc import Callable

import numpy as np

from push_model.arrays import Array
from push_model.free_space import FreeSpace, Obstacles
from push_model.outlines import distance, inside
from push_model.settings import SettingsError
from push_model.specs import ObjectSpec

_GAP = 0.02  # [m] between all at the start
_AROUND = 1.0  # [m] about an object in the origin
_TRIES = 2000  # places for each robot


def around(random: np.random.Generator, count: int, item: ObjectSpec, radius: float) -> Array:
    """``(count, 3)`` poses about an object in the origin, apart from it and each other.

    Raises
    ------
    SettingsError: there is no room for so many.
    """
    reach, outline = max(_AROUND, 0.25 * math.sqrt(count)), item.outline
    placed = _Placed(count)

    def draw() -> bool:
        p = random.uniform(-reach, reach, 2)
        if placed.nearest(p) <= 2.0 * radius + _GAP:
            return False
        if inside(outline, p[None])[0] or distance(outline, p[None])[0] < radius + _GAP:
            return False
        placed.add(p)
        return True

    _repeat(draw, count)
    return np.column_stack([placed.points, random.uniform(-math.pi, math.pi, count)])


def scattered(
    random: np.random.Generator,
    count: int,
    space: FreeSpace,
    outline: Array,
    radius: float,
    gap: float = _GAP,
) -> Array:
    """``(count, 3)`` poses anywhere on a map with an object ``(k, 2)`` [m] on it, all of them
    ``gap`` [m] apart.

    Raises
    ------
    SettingsError: there is no room for so many.
    """
    low, high = space.places.min(axis=0), space.places.max(axis=0)
    placed, headings = _Placed(count), []

    def draw() -> bool:
        p = random.uniform(low, high)
        if placed.nearest(p) <= 2.0 * radius + gap:
            return False
        discs = np.column_stack([placed.points, np.full(placed.count, radius)])
        if space.room(p[None], Obstacles((outline,), discs))[0] <= radius + gap:
            return False
        placed.add(p)
        headings.append(random.uniform(-math.pi, math.pi))
        return True

    _repeat(draw, count)
    return np.column_stack([placed.points, headings])


class _Placed:
    """Places ``(n, 2)`` [m] that have been found, of at most so many."""

    def __init__(self, most: int) -> None:
        self._all, self.count = np.empty((most, 2)), 0

    @property
    def points(self) -> Array:
        return self._all[: self.count]

    def add(self, point: Array) -> None:
        self._all[self.count] = point
        self.count += 1

    def nearest(self, point: Array) -> float:
        """[m] to the nearest of them; inf if there are none."""
        return float(np.hypot(*(point - self.points).T).min(initial=math.inf))


def _repeat(draw: Callable[[], bool], count: int) -> None:
    """Draw until it has succeeded so often."""
    done = 0
    for _ in range(_TRIES * count):
        done += draw()
        if done == count:
            return
    raise SettingsError(f"there is room for {done} of {count} robots; enlarge it or take fewer")
