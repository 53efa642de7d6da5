"""What a method says about its last step: figures with units, and shapes to draw.

Page, bag and pictures show reports; none of them knows a method by name.
"""

import math
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from push_model.arrays import Array


class ShapeKind(IntEnum):
    """How the points of a shape are drawn; the constants of push_msgs/Report."""

    POLYLINE = 0
    POLYGON = 1
    DISCS = 2
    ARROWS = 3


@dataclass(frozen=True)
class Figure:
    """A number. unit: "" where dimensionless. limit: a value beyond it needs attention."""

    name: str
    value: float
    unit: str = ""
    limit: float = math.nan


@dataclass(frozen=True)
class Drawable:
    """A shape in the fixed frame.

    layer: what it shows, for example "forces"; shapes of a layer share a colour. points ``(n, 2)``
    [m]; of arrows, tails and heads in turn. radius: [m] of discs.
    """

    layer: str
    kind: ShapeKind
    points: Array
    radius: float = 0.0


@dataclass(frozen=True)
class Report:
    """phase: what the method is doing, in a word or two. solve_time: [s] CPU time of the step."""

    phase: str
    figures: tuple[Figure, ...] = ()
    shapes: tuple[Drawable, ...] = ()
    solve_time: float = 0.0

    def figure(self, name: str) -> float:
        """A figure's value; nan where there is none of the name."""
        return next((f.value for f in self.figures if f.name == name), math.nan)


def arrows(layer: str, tails: Array, vectors: Array) -> Drawable:
    """Arrows from points ``(n, 2)`` [m], of vectors ``(n, 2)`` [m]."""
    tails, vectors = np.reshape(tails, (-1, 2)), np.reshape(vectors, (-1, 2))
    points = np.stack([tails, tails + vectors], axis=1).reshape(-1, 2)
    return Drawable(layer, ShapeKind.ARROWS, points)


def polyline(layer: str, points: Array) -> Drawable:
    """Lines through points ``(n, 2)`` [m]."""
    return Drawable(layer, ShapeKind.POLYLINE, np.reshape(points, (-1, 2)))


def polygon(layer: str, points: Array) -> Drawable:
    """A closed outline ``(n, 2)`` [m]."""
    return Drawable(layer, ShapeKind.POLYGON, np.reshape(points, (-1, 2)))


def discs(layer: str, points: Array, radius: float) -> Drawable:
    """Discs about points ``(n, 2)`` [m]."""
    return Drawable(layer, ShapeKind.DISCS, np.reshape(points, (-1, 2)), radius)


_ROUND = np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)
_CIRCLE = np.column_stack([np.cos(_ROUND), np.sin(_ROUND)])


def ellipses(layer: str, means: Array, roots: Array) -> list[Drawable]:
    """The one-sigma contours of Gaussians ``exp(-|root (q - mean)|^2 / 2)``.

    means ``(n, 2)`` [m], roots ``(n, 2, 2)`` [1/m].
    """
    return [
        polygon(layer, mean + np.linalg.solve(root, _CIRCLE.T).T)
        for mean, root in zip(means, roots, strict=True)
    ]


@dataclass(frozen=True)
class Status:
    """How a job stands, as in JobState.

    phase: a JobPhase's value; name: of the state, in messages. code: a JobError's value, of the
    last job that ended. progress: 0 to 1. index, count: of the step under way. times: [s] that each
    target took, where a task has several.
    """

    phase: int
    name: str
    reason: str
    code: int = 0
    progress: float = 0.0
    index: int = 0
    count: int = 0
    replans: int = 0
    pushes: int = 0
    times: tuple[float, ...] = field(default=())
