"""Random planning problems by kind: anywhere, traps, doors, clutter, narrow gaps.

A problem is a function of its kind, a seed and a number, and of nothing that a planner does. What
makes a kind hard is drawn (sizes, places, turns), and so is what should not matter.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from push_model.arrays import Array
from push_model.distance_field import DistanceField
from push_model.occupancy import rasterise
from push_model.shapes import Shape
from push_model.specs import BoxSpec, CircleSpec, EnvironmentSpec, ObjectSpec

SPARE = 0.04  # [m] by which a narrow gap is wider than the object
_APART = 0.013  # [m] from the object to obstacles at start and goal: what pushes keep, and a little
_DRAWS = 5000  # poses before a place counts as too small for the object

Draw = Callable[[np.random.Generator], Array]


@dataclass(frozen=True)
class Problem:
    """start, goal: poses ``(3,)`` of the object's geometric frame."""

    world: EnvironmentSpec
    start: Array
    goal: Array


def _turned(centre: Array, yaw: float, x: float, y: float) -> tuple[float, float]:
    """A point of a frame at ``centre`` ``(2,)`` that is turned by ``yaw``, in the world frame."""
    c, s = math.cos(yaw), math.sin(yaw)
    return float(centre[0] + c * x - s * y), float(centre[1] + s * x + c * y)


def _within(low: tuple[float, float], high: tuple[float, float]) -> Draw:
    """Poses with the origin in a rectangle and any heading."""
    return lambda random: random.uniform([*low, -math.pi], [*high, math.pi])


def trap(random: np.random.Generator, shape: Shape) -> tuple[EnvironmentSpec, Draw, Draw]:
    """A U 0.8-1.2 m wide and 0.7-1.1 m deep round the start, its closed end towards the goal."""
    size = float(random.uniform(3.2, 4.5)), float(random.uniform(2.4, 3.5))
    width, depth = float(random.uniform(0.8, 1.2)), float(random.uniform(0.7, 1.1))
    thick, yaw = float(random.uniform(0.03, 0.12)), float(random.uniform(-0.4, 0.4))
    # Beside the U and before its opening there is room for the object, the robot and a turn.
    centre = np.array(
        [
            random.uniform(-0.5, 0.5) * (size[0] - depth - 1.6),
            random.uniform(-0.5, 0.5) * (size[1] - width - 1.2),
        ]
    )
    end = BoxSpec(
        _turned(centre, yaw, 0.5 * (depth + thick), 0.0), (thick, width + 2.0 * thick), yaw
    )
    sides = tuple(
        BoxSpec(_turned(centre, yaw, 0.0, k * 0.5 * (width + thick)), (depth, thick), yaw)
        for k in (-1.0, 1.0)
    )

    def start(draw: np.random.Generator) -> Array:
        x, y = draw.uniform([-0.5 * depth, -0.5 * width], [0.5 * depth, 0.5 * width])
        return np.array([*_turned(centre, yaw, x, y), draw.uniform(-math.pi, math.pi)])

    x0 = min(float(centre[0]) + 0.5 * depth + 0.1, 0.5 * size[0] - 0.4)
    goal = _within((x0, -0.5 * size[1]), (0.5 * size[0], 0.5 * size[1]))
    return EnvironmentSpec(size, (end, *sides)), start, goal


def _wall(
    size: tuple[float, float], x: float, thick: float, middle: float, width: float
) -> tuple[BoxSpec, ...]:
    """A wall across a room, with an opening so wide about y = ``middle``."""
    half = 0.5 * size[1]
    low, high = middle - 0.5 * width, middle + 0.5 * width
    return (
        BoxSpec((x, 0.5 * (low - half)), (thick, low + half)),
        BoxSpec((x, 0.5 * (high + half)), (thick, half - high)),
    )


def door(random: np.random.Generator, shape: Shape) -> tuple[EnvironmentSpec, Draw, Draw]:
    """One wall or two, each with a door 0.18-0.5 m wide somewhere in it."""
    size = float(random.uniform(3.0, 4.0)), float(random.uniform(2.0, 2.8))
    count = int(random.integers(1, 3))
    places = (-0.1, 0.1) if count == 1 else (-0.24, 0.24)
    walls: tuple[BoxSpec, ...] = ()
    middles = random.uniform(*places, 1) if count == 1 else np.array(places)
    for x in middles * size[0]:
        middle = random.uniform(-0.5, 0.5) * (size[1] - 0.7)
        thick, width = random.uniform(0.03, 0.3), random.uniform(0.18, 0.5)
        walls += _wall(size, float(x), float(thick), float(middle), float(width))
    left, right = (float(f) * size[0] for f in (middles[0], middles[-1]))
    half = 0.5 * size[1]
    start = _within((-0.5 * size[0], -half), (left, half))
    return EnvironmentSpec(size, walls), start, _within((right, -half), (0.5 * size[0], half))


def clutter(random: np.random.Generator, shape: Shape) -> tuple[EnvironmentSpec, Draw, Draw]:
    """A room of 3 m x 2 m with boxes and circles at random."""
    boxes = tuple(
        BoxSpec(
            tuple(random.uniform([-1.3, -0.8], [1.3, 0.8])),
            tuple(random.uniform(0.08, 0.4, 2)),
            float(random.uniform(-math.pi, math.pi)),
        )
        for _ in range(4)
    )
    circles = tuple(
        CircleSpec(
            tuple(random.uniform([-1.3, -0.8], [1.3, 0.8])), float(random.uniform(0.05, 0.18))
        )
        for _ in range(4)
    )
    anywhere = _within((-1.5, -1.0), (1.5, 1.0))
    return EnvironmentSpec((3.0, 2.0), boxes, circles), anywhere, anywhere


def gap(random: np.random.Generator, shape: Shape) -> tuple[EnvironmentSpec, Draw, Draw]:
    """A wall 0.3 m thick, with a gap ``SPARE`` wider than the object, anywhere in it."""
    size = float(random.uniform(3.0, 3.6)), float(random.uniform(2.0, 2.6))
    thick = 0.3
    x = float(random.uniform(-0.2, 0.2))
    middle = float(random.uniform(-0.5, 0.5) * (size[1] - 0.8))
    walls = _wall(size, x, thick, middle, 2.0 * shape.inradius + SPARE)
    half = 0.5 * size[1]
    start = _within((-0.5 * size[0], -half), (x - 0.5 * thick, half))
    goal = _within((x + 0.5 * thick, -half), (0.5 * size[0], half))
    return EnvironmentSpec(size, walls), start, goal


KINDS: dict[str, Callable[[np.random.Generator, Shape], tuple[EnvironmentSpec, Draw, Draw]]] = {
    "trap": trap,
    "door": door,
    "clutter": clutter,
    "gap": gap,
}


def _free(
    draw: Draw, field: DistanceField, outline: Array, random: np.random.Generator
) -> Array | None:
    """A pose at which the object keeps its distance; None where there is hardly any."""
    for _ in range(_DRAWS):
        pose = draw(random)
        if field.clearance(outline, pose) >= _APART:
            return pose
    return None


def problems_of(kind: str, item: ObjectSpec, count: int, seed: int) -> Iterator[Problem]:
    """Random problems of a kind, at both ends of which the object stands free on the map."""
    shape = item.geometry
    outline = shape.dense_outline(0.01)
    for number in range(count):
        random = np.random.default_rng([seed, number, list(KINDS).index(kind)])
        while True:
            world, *draws = KINDS[kind](random, shape)
            field = DistanceField(rasterise(world))
            start, goal = (_free(draw, field, outline, random) for draw in draws)
            if start is not None and goal is not None:
                yield Problem(world, start, goal)
                break
