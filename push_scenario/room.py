"""Exact geometry of an environment: whether a body is free in it, and distances of points."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.bumpers import RingBumper
from push_model.distance_field import DistanceField
from push_model.occupancy import MapSpec
from push_model.outlines import cells_hit, distance, inside, overlap, overlaps_disc
from push_model.specs import BoxSpec, EnvironmentSpec, ObjectSpec, RobotSpec

_TOUCH = 1e-4  # [m] overlap that counts as touching


@dataclass(frozen=True)
class Footprint:
    """The area of the floor that a body covers.

    centre: ``(2,)`` [m]. radius: [m] of the circle about it that holds the body.
    outline: ``(n, 2)`` [m], world frame; None for a disc of that radius.
    """

    name: str
    centre: Array
    radius: float
    outline: Array | None

    def meets(self, other: "Footprint", touch: float = _TOUCH) -> bool:
        """Whether two bodies overlap by more than about ``touch`` [m]."""
        apart = float(np.hypot(*(self.centre - other.centre)))
        if apart >= self.radius + other.radius - touch:
            return False
        if self.outline is not None and other.outline is not None:
            return overlap(self._shrunk(touch), other.outline)
        if self.outline is not None:
            return overlaps_disc(self.outline, other.centre, other.radius - touch)
        if other.outline is not None:
            return overlaps_disc(other.outline, self.centre, self.radius - touch)
        return True

    def _shrunk(self, touch: float) -> Array:
        assert self.outline is not None
        factor = max(0.0, 1.0 - touch / self.radius)
        shrunk: Array = self.centre + factor * (self.outline - self.centre)
        return shrunk


def robot_footprint(name: str, spec: RobotSpec, pose: Array) -> Footprint:
    """Footprint of a robot with its axle midpoint at a pose ``(3,)``."""
    round_body = isinstance(spec.bumper, RingBumper)
    outline = None if round_body else se2.transform(pose, spec.outline)
    return Footprint(name, pose[:2], spec.footprint_radius, outline)


def object_footprint(name: str, spec: ObjectSpec, pose: Array) -> Footprint:
    """Footprint of an object with its geometric frame at a pose ``(3,)``."""
    radius = float(np.hypot(*spec.outline.T).max())
    return Footprint(name, pose[:2], radius, se2.transform(pose, spec.outline))


class Room:
    """The free space of an environment."""

    def __init__(self, environment: EnvironmentSpec | MapSpec) -> None:
        self._environment = environment
        self._obstacles: list[Footprint] = []
        if isinstance(environment, EnvironmentSpec):
            self.low = -0.5 * np.array(environment.size)
            self.high = -self.low
            self._obstacles = _obstacles(environment)
        else:
            x0, x1, y0, y1 = environment.grid.extent
            self.low, self.high = np.array([x0, y0]), np.array([x1, y1])

    def trouble(self, body: Footprint, touch: float = _TOUCH) -> str | None:
        """Why a body cannot be there, e.g. "outside the arena" or "in box 2"; None if it can.

        touch: [m] that counts as touching.
        """
        if body.outline is None:
            low, high = body.centre - body.radius, body.centre + body.radius
        else:
            low, high = body.outline.min(axis=0), body.outline.max(axis=0)
        if (low < self.low - touch).any() or (high > self.high + touch).any():
            inside_at_all = (high > self.low).all() and (low < self.high).all()
            return "in the arena's wall" if inside_at_all else "outside the arena"
        for obstacle in self._obstacles:
            if body.meets(obstacle, touch):
                return f"in {obstacle.name}"
        if isinstance(self._environment, MapSpec) and self._in_cells(body, low, high, touch):
            return "in an occupied or unknown cell of the map"
        return None

    def clearance(self, points: Array) -> Array:
        """``(k,)`` [m] lower bounds of the distances of points ``(k, 2)`` to obstacles."""
        points = np.asarray(points, dtype=np.float64)
        least = np.minimum(points - self.low, self.high - points).min(axis=1)
        for obstacle in self._obstacles:
            if obstacle.outline is None:
                away = np.hypot(*(points - obstacle.centre).T) - obstacle.radius
            else:
                away = distance(obstacle.outline, points)
                away[inside(obstacle.outline, points)] = 0.0
            least = np.minimum(least, away)
        if isinstance(self._environment, MapSpec):
            least = np.minimum(least, [self._field.at(x, y) for x, y in points])
        clear: Array = np.maximum(least, 0.0)
        return clear

    @cached_property
    def _field(self) -> DistanceField:
        assert isinstance(self._environment, MapSpec)
        return DistanceField(self._environment.grid)

    def _in_cells(self, body: Footprint, low: Array, high: Array, touch: float) -> bool:
        assert isinstance(self._environment, MapSpec)
        grid = self._environment.grid
        size = np.array(grid.occupied.shape[::-1])
        first = np.clip(np.floor((low - grid.origin) / grid.resolution), 0, size).astype(int)
        last = np.clip(np.ceil((high - grid.origin) / grid.resolution), 0, size).astype(int)
        part = grid.occupied[first[1] : last[1], first[0] : last[0]]
        corners = (np.argwhere(part)[:, ::-1] + first) * grid.resolution + grid.origin
        if not len(corners):
            return False
        if body.outline is not None:
            return bool(cells_hit(body._shrunk(touch), corners, grid.resolution).any())
        nearest = np.clip(body.centre, corners, corners + grid.resolution)
        away = np.hypot(*(body.centre - nearest).T)
        return bool((away < body.radius - touch).any())


def _obstacles(environment: EnvironmentSpec) -> list[Footprint]:
    outlines = [(f"box {i}", _box(b)) for i, b in enumerate(environment.boxes)]
    outlines += [(f"polygon {i}", np.array(p.vertices)) for i, p in enumerate(environment.polygons)]
    obstacles = []
    for name, outline in outlines:
        centre = outline.mean(axis=0)
        radius = float(np.hypot(*(outline - centre).T).max())
        obstacles.append(Footprint(name, centre, radius, outline))
    for i, circle in enumerate(environment.circles):
        obstacles.append(Footprint(f"circle {i}", np.array(circle.centre), circle.radius, None))
    return obstacles


def _box(box: BoxSpec) -> Array:
    a, b = 0.5 * box.size[0], 0.5 * box.size[1]
    corners = np.array([[-a, -b], [a, -b], [a, b], [-a, b]])
    return se2.transform(se2.pose(*box.centre, box.yaw), corners)
