"""Counting collisions, as distinct from intended contacts."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field

_APART = 0.1  # [s] without contact after which a touch is a new collision


@dataclass
class Collisions:
    """Counts collisions of a run. A touch counts once, however long it lasts.

    A robot that touches an object pushes it, which is no collision. Anything that is neither a
    robot nor an object is a wall.
    """

    robots: Collection[str]
    objects: Collection[str]
    between_robots: int = 0
    robots_with_walls: int = 0
    objects_with_walls: int = 0
    between_objects: int = 0
    _touched: dict[tuple[str, str], float] = field(default_factory=dict)

    @property
    def with_walls(self) -> int:
        """Names of robots and of objects."""
        return self.robots_with_walls + self.objects_with_walls

    def take(self, time: float, body_a: Iterable[str], body_b: Iterable[str]) -> None:
        """Add the contacts of a time [s], as pairs; times must not decrease except by a reset."""
        for a, b in zip(body_a, body_b, strict=True):
            pair = (a, b) if a < b else (b, a)
            last = self._touched.get(pair)
            self._touched[pair] = time
            if last is None or not 0.0 <= time - last <= _APART:
                self._count(pair)

    def _count(self, pair: tuple[str, str]) -> None:
        robots = sum(name in self.robots for name in pair)
        objects = sum(name in self.objects for name in pair)
        if robots == 2:
            self.between_robots += 1
        elif objects == 2:
            self.between_objects += 1
        elif robots == 1 and objects == 0:
            self.robots_with_walls += 1
        elif objects == 1 and robots == 0:
            self.objects_with_walls += 1
