"""What one robot sees from where it stands, in its own frame. Stands in for a sensor on the robot.

A robot scans the outline of the object all round, and sees the robots and the walls that are near.
It knows where the target is, as if a beacon stood there that can be seen over everything, and how
far it has moved itself (odometry). The object hides robots that are behind it; robots do not hide
the object, which is taller than they are. No robot gets the pose of anything in a common frame.

In a room with walls in it there is no beacon. The robot scans the walls with the same rays, and
they hide the object and robots that are behind them; nor is a wall seen behind the object.
"""

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np

from push_model import se2
from push_model.arrays import Array, Mask
from push_model.settings import bounded, settings


@settings
class RobotSensorSettings:
    """Range and errors of the sensor of a robot. Errors are standard deviations."""

    range: float = bounded(
        1.5,
        low=0.1,
        high=100.0,
        doc="Greatest distance at which a robot sees the object, another robot or a wall (m)",
    )
    rays: int = bounded(
        180, low=24, high=3600, doc="Number of rays of a scan of the full circle (dimensionless)"
    )
    distance_error: float = bounded(
        0.01,
        low=0.0,
        high=0.5,
        doc="Standard deviation of a measured distance as a fraction of the distance "
        "(dimensionless)",
    )
    least_error: float = bounded(
        1e-3,
        low=0.0,
        high=0.1,
        doc="Part of the standard deviation of a measured distance that does not depend on the "
        "distance (m)",
    )
    odometry_error: float = bounded(
        0.02,
        low=0.0,
        high=0.5,
        doc="Standard deviation of the measured motion of the robot as a fraction of the motion; "
        "the error is drawn anew for each measurement (dimensionless)",
    )


@dataclass(frozen=True)
class Reading:
    """What a robot sees, in its frame at present.

    object ``(k, 2)`` [m]: points of the outline, in the order of their directions, empty where the
    object is out of range. robots ``(m, 2)`` [m]: centres of those that are seen. walls ``(w, 2)``
    [m]: the nearest point of each wall that is near; with walls in the room all points of the scan
    that lie on walls. target ``(2,)`` [m]; nan where there is no beacon. moved ``(3,)`` [m, m,
    rad]: the pose of the robot in its frame at its reading before.
    """

    object: Array
    robots: Array
    walls: Array
    target: Array
    moved: Array


class RobotSensor:
    """The sensors of all robots. They share nothing but the generator of their errors."""

    def __init__(
        self,
        outline: Array,
        size: tuple[float, float],
        settings: RobotSensorSettings,
        seed: int,
        walls: Array | None = None,
    ) -> None:
        """outline ``(k, 2)`` [m] about the object's centre of mass; size [m] of a room about the
        origin; walls ``(n, 2, 2)`` [m]: ends of the sides of walls, of a room that has some in
        it."""
        self._outline, self._half = outline, 0.5 * np.array(size)
        self._settings, self._random = settings, np.random.default_rng([seed, 7])
        angles = 2.0 * math.pi * np.arange(settings.rays) / settings.rays
        self._rays = np.column_stack([np.cos(angles), np.sin(angles)])
        self._before: dict[Hashable, Array] = {}  # poses at the last reading, by name
        self._walls = walls

    def look(
        self, pose: Array, robots: Array, target: Array, names: Sequence[Hashable] = ()
    ) -> list[Reading]:
        """One reading of each robot. pose ``(3,)`` of the object's centre of mass; robots
        ``(n, 3)``; target ``(2,)`` [m]; names: of the robots, their numbers if none are given."""
        names = names or range(len(robots))
        before = [self._before.get(n, r) for n, r in zip(names, robots, strict=True)]
        self._before.update(zip(names, robots.copy(), strict=True))
        sides = _sides(se2.transform(pose, self._outline))
        places = np.ascontiguousarray(robots[:, :2])
        headings, most = robots[:, 2].copy(), self._settings.range
        reach = _scans(places, headings, sides, self._rays, most)
        if self._walls is None:
            hidden, behind = _hidden(places, sides), np.full_like(reach, math.inf)
        else:
            hidden = _hidden(places, np.concatenate([sides, self._walls]))
            behind = _scans(places, headings, self._walls, self._rays, most)
        return [
            self._reading(i, robots, before[i], (reach[i], behind[i]), hidden[i], target)
            for i in range(len(robots))
        ]

    def _reading(
        self,
        i: int,
        robots: Array,
        before: Array,
        reach: tuple[Array, Array],
        hidden: Mask,
        target: Array,
    ) -> Reading:
        """reach: ``(rays,)`` [m] to the object and to walls."""
        s, here = self._settings, robots[i]
        inverse = se2.inverse(here)
        to_object, to_wall = reach
        points = self._scanned(to_object, (to_object < s.range) & (to_object < to_wall))
        others = ~hidden
        others[i] = False
        mates = se2.transform(inverse, robots[others, :2])
        mates = self._measured(mates[np.hypot(*mates.T) < s.range])
        if self._walls is None:
            x, y = here[:2]
            (w, h) = self._half
            walls = se2.transform(inverse, np.array([[w, y], [-w, y], [x, h], [x, -h]]))
            walls = self._measured(walls[np.hypot(*walls.T) < s.range])
            beacon = se2.transform(inverse, target[None])[0]
        else:
            walls = self._scanned(to_wall, (to_wall < s.range) & (to_wall < to_object))
            beacon = np.full(2, math.nan)
        moved = se2.compose(se2.inverse(before), here)
        moved[2] = se2.wrap(float(moved[2]))
        moved = moved * (1.0 + s.odometry_error * self._random.normal(size=3))
        return Reading(points, mates, walls, beacon, moved)

    def _scanned(self, reach: Array, seen: Mask) -> Array:
        """Points ``(m, 2)`` on the rays that are seen, at distances with errors."""
        return self._measured(self._rays[seen] * reach[seen][:, None])

    def _measured(self, points: Array) -> Array:
        """Points ``(m, 2)`` at distances with errors."""
        s, away = self._settings, np.hypot(*points.T)
        error = self._random.normal(size=len(points)) * (s.least_error + s.distance_error * away)
        measured: Array = points * (1.0 + error / np.maximum(away, 1e-9))[:, None]
        return measured


@numba.njit(cache=True, error_model="numpy")
def _crossing(x: float, y: float, way_x: float, way_y: float, a: Any, b: Any) -> float:
    """Part of a way from a point at which it meets the line between two corners, or inf."""
    ex, ey, dx, dy = b[0] - a[0], b[1] - a[1], a[0] - x, a[1] - y
    cross = way_x * ey - way_y * ex
    if abs(cross) < 1e-12:
        return math.inf
    part = (dx * ey - dy * ex) / cross
    along = (dx * way_y - dy * way_x) / cross
    return part if part >= 0.0 and -1e-9 <= along <= 1.0 + 1e-9 else math.inf


def _sides(corners: Array) -> Array:
    """``(k, 2, 2)`` ends of the sides of an outline ``(k, 2)``."""
    sides: Array = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    return sides


@numba.njit(cache=True, error_model="numpy")
def _scans(places: Any, headings: Any, sides: Any, rays: Any, most: float) -> Any:
    """``(n, k)`` [m] along the rays ``(k, 2)`` of each robot to sides ``(m, 2, 2)``; inf where none
    is met. Sides farther than ``most`` [m] are left out."""
    n, count, m = places.shape[0], rays.shape[0], sides.shape[0]
    reach = np.full((n, count), math.inf)
    for i in range(n):
        c, s = math.cos(headings[i]), math.sin(headings[i])
        px, py = places[i]
        for j in range(m):
            a, b = sides[j, 0], sides[j, 1]
            ex, ey = b[0] - a[0], b[1] - a[1]
            square = max(ex * ex + ey * ey, 1e-18)
            part = min(max(((px - a[0]) * ex + (py - a[1]) * ey) / square, 0.0), 1.0)
            if math.hypot(a[0] + part * ex - px, a[1] + part * ey - py) > most:
                continue
            for k in range(count):
                x, y = c * rays[k, 0] - s * rays[k, 1], s * rays[k, 0] + c * rays[k, 1]
                reach[i, k] = min(reach[i, k], _crossing(px, py, x, y, a, b))
    return reach


@numba.njit(cache=True, error_model="numpy")
def _hidden(places: Any, sides: Any) -> Any:
    """``(n, n)`` whether one of the sides ``(m, 2, 2)`` is between two places."""
    n, m = places.shape[0], sides.shape[0]
    hidden = np.zeros((n, n), np.bool_)
    for i in range(n):
        for k in range(i + 1, n):
            x, y = places[k, 0] - places[i, 0], places[k, 1] - places[i, 1]
            for j in range(m):
                if _crossing(places[i, 0], places[i, 1], x, y, sides[j, 0], sides[j, 1]) <= 1.0:
                    hidden[i, k] = hidden[k, i] = True
                    break
    return hidden
