"""Problems in GCo's simulator: those of its authors, and random ones of the same kind."""

import math
from dataclasses import dataclass

import numpy as np

from push_model import se2
from push_model.arrays import Array

RADIUS = 0.05
"""[m] of a robot."""
ROOMS = ("given", "open", "pillar")
"""``given``: the eight tasks with one object in the evaluation script of the authors. ``open``: a
random object, a random goal 0.5 to 2 m away, robots at random places. ``pillar``: the goal is 2 m
away, and an obstacle stands half way."""
_SIDES, _RADII = (0.15, 0.5), (0.1, 0.3)
"""[m] of rectangles and circles for which the model of GCo was trained."""
_CIRCLES = 0.3  # share of circles among the objects
_PILLAR = 0.1  # [m] its radius
_FIELD = 1.2  # [m] of robots from the object at most, in x and y
_OFF = 0.15, 0.25, 0.3  # [m] of robots from the object, from each other, from an obstacle
_TURN = 1.5  # [rad] of the object at most


@dataclass(frozen=True)
class Problem:
    """Headings are GCo's: a quarter turn less than those of the simulation.

    shape: ``rectangle`` of a size (x, y) [m], or ``circle`` of a radius. start, goal: pose of the
    object. robots: (x, y) [m] of each. obstacles: (x, y, radius) [m]. seed: of GCo's draws.
    """

    shape: str
    size: tuple[float, ...]
    start: tuple[float, float, float]
    goal: tuple[float, float, float]
    robots: tuple[tuple[float, float], ...]
    obstacles: tuple[tuple[float, float, float], ...]
    seed: int

    @property
    def target(self) -> Array:
        """``(3,)`` goal in the frame of the simulation."""
        return np.array(self.goal) + [0.0, 0.0, 0.5 * math.pi]

    def errors(self, pose: Array) -> tuple[float, float]:
        """[m], [rad] of an object at a pose ``(3,)`` of the simulation from the goal."""
        off = pose - self.target
        return float(np.hypot(off[0], off[1])), abs(se2.wrap(float(off[2])))


def problem(room: str, robots: int, seed: int) -> Problem:
    """The problem of a seed; with more robots, it is the same one with more robots."""
    return _given(robots, seed) if room == "given" else _random(room == "pillar", robots, seed)


def _given(robots: int, seed: int) -> Problem:
    easy, (dx, dy) = seed % 8 >= 4, ((0, 1), (0, -1), (-1, 0), (1, 0))[seed % 4]
    way, row = (2.0, 3.0) if easy else (1.0, 0.0)
    turn = 0.0 if not easy else 2.0 if (dx, dy) in ((0, 1), (-1, 0)) else -2.0
    places = ((-0.5, row), (0.0, row), (0.5, row))[:robots]
    half = (0.5 * way * dx, 1.0 + 0.5 * way * dy, _PILLAR)
    goal = (way * dx, 1.0 + way * dy, turn)
    return Problem(
        "rectangle", (0.3, 0.3), (0.0, 1.0, 0.0), goal, places, (half,) if easy else (), seed
    )


def _random(pillar: bool, robots: int, seed: int) -> Problem:
    draw = np.random.default_rng([seed, int(pillar)])
    circle = draw.random() < _CIRCLES
    size = draw.uniform(*_RADII, 1) if circle else draw.uniform(*_SIDES, 2)
    reach = size[0] if circle else 0.5 * math.hypot(*size)
    aside, way = draw.uniform(-math.pi, math.pi), 2.0 if pillar else draw.uniform(0.5, 2.0)
    start, turn = np.array([0.0, 1.0]), draw.uniform(-_TURN, _TURN)
    goal = start + way * np.array([math.cos(aside), math.sin(aside)])
    half = 0.5 * (start + goal)
    places: list[Array] = []
    while len(places) < 3:  # always three: a problem does not depend on how many there are
        place = start + draw.uniform(-_FIELD, _FIELD, 2)
        free = math.dist(place, start) > reach + _OFF[0]
        free &= all(math.dist(place, other) > _OFF[1] for other in places)
        if free and not (pillar and math.dist(place, half) < _OFF[2]):
            places.append(place)
    return Problem(
        "circle" if circle else "rectangle",
        tuple(size.tolist()),
        (0.0, 1.0, 0.0),
        (*goal.tolist(), float(turn)),
        tuple((float(x), float(y)) for x, y in places[:robots]),
        ((*half.tolist(), _PILLAR),) if pillar else (),
        seed,
    )
