"""Where the bodies of a group start, chosen by ``kind``: on a grid, on a ring, at random."""

import math
from dataclasses import field
from typing import Annotated, Literal

import numpy as np

from push_model.arrays import Array
from push_model.se2 import wrap
from push_model.settings import SettingsError, bounded, settings, told_by_key
from push_scenario.room import Room

_TRIES = 2000
"""Places tried for each body of a random placement."""


@settings
class GridPlacement:
    """In rows, from the lowest upward."""

    kind: Literal["grid"] = field(default="grid", kw_only=True)
    corner: tuple[float, float] = bounded(
        low=-1e4, high=1e4, doc="Position x, y of the first body of the grid (m)"
    )
    spacing: float = bounded(
        low=1e-3, high=100.0, doc="Distance between neighbours in the grid (m)"
    )
    columns: int | None = bounded(
        None,
        low=1,
        high=10000,
        doc="Number of bodies in a row of the grid; default: as many as there are rows",
    )
    heading: float = bounded(0.0, low=-10.0, high=10.0, doc="Heading of all bodies (rad)")

    def poses(self, count: int, radius: float, room: Room, taken: Array) -> Array:
        """``(count, 3)`` poses; see ``RandomPlacement.poses``."""
        columns = self.columns or math.ceil(math.sqrt(count))
        row, column = np.divmod(np.arange(count), columns)
        x, y = self.corner
        return np.column_stack(
            [x + self.spacing * column, y + self.spacing * row, np.full(count, self.heading)]
        )


@settings
class RingPlacement:
    """Evenly on a circle, counter-clockwise."""

    kind: Literal["ring"] = field(default="ring", kw_only=True)
    centre: tuple[float, float] = bounded(low=-1e4, high=1e4, doc="Centre of the ring (m)")
    radius: float = bounded(low=1e-3, high=1000.0, doc="Radius of the ring (m)")
    first: float = bounded(0.0, low=-10.0, high=10.0, doc="Polar angle of the first body (rad)")
    facing: Literal["inward", "outward", "along"] = bounded(
        "inward", doc="Direction in which the bodies on the ring face"
    )

    def poses(self, count: int, radius: float, room: Room, taken: Array) -> Array:
        """``(count, 3)`` poses; see ``RandomPlacement.poses``."""
        angle = self.first + np.arange(count) * 2.0 * math.pi / count
        turn = {"inward": math.pi, "outward": 0.0, "along": math.pi / 2.0}[self.facing]
        x, y = self.centre
        return np.column_stack(
            [
                x + self.radius * np.cos(angle),
                y + self.radius * np.sin(angle),
                [wrap(a + turn) for a in angle],
            ]
        )


@settings
class RandomPlacement:
    """At random free places, apart from each other and from everything placed before."""

    kind: Literal["random"] = field(default="random", kw_only=True)
    area: tuple[float, float, float, float] | None = bounded(
        None,
        low=-1e4,
        high=1e4,
        doc="Rectangle x_min, x_max, y_min, y_max (m); default: the whole arena",
    )
    gap: float = bounded(
        0.01, low=0.0, high=10.0, doc="Least gap between a body and any other body or wall (m)"
    )
    heading: float | None = bounded(
        None, low=-10.0, high=10.0, doc="Heading of all bodies (rad); default: random"
    )
    seed: int = bounded(1, low=0, high=2**62, doc="Seed; equal seeds give equal poses")

    def __post_init__(self) -> None:
        if self.area is not None and not (
            self.area[0] < self.area[1] and self.area[2] < self.area[3]
        ):
            raise SettingsError(f"area: expected x_min < x_max and y_min < y_max, got {self.area}")

    def poses(self, count: int, radius: float, room: Room, taken: Array) -> Array:
        """``(count, 3)`` poses.

        Parameters
        ----------
        radius: [m] of the circle about its pose that holds a body.
        room: its walls are kept clear. taken: ``(k, 3)`` [m] circles x, y, radius to keep clear.

        Raises
        ------
        SettingsError: no room found for one of them.
        """
        random = np.random.default_rng(self.seed)
        x0, x1, y0, y1 = self.area or (room.low[0], room.high[0], room.low[1], room.high[1])
        circles = np.empty((len(taken) + count, 3))
        circles[: len(taken)] = taken
        poses = np.empty((count, 3))
        for i in range(count):
            known = circles[: len(taken) + i]
            for _ in range(_TRIES):
                x, y, theta = random.uniform([x0, y0, -math.pi], [x1, y1, math.pi])
                away = np.hypot(known[:, 0] - x, known[:, 1] - y) - known[:, 2]
                if (away >= radius + self.gap).all() and (
                    room.clearance(np.array([[x, y]]))[0] >= radius + self.gap
                ):
                    break
            else:
                raise SettingsError(
                    f"no room found for number {i + 1} of {count} in {_TRIES} tries; "
                    "enlarge 'area', or reduce 'gap' or 'count'"
                )
            poses[i] = x, y, theta if self.heading is None else self.heading
            circles[len(taken) + i] = x, y, radius
        return poses


Placement = Annotated[
    GridPlacement | RingPlacement | RandomPlacement, told_by_key("grid", "ring", "random")
]
