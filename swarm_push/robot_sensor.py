"""What one robot sees from where it stands, in its own frame. Stands in for a sensor on the robot.

A robot scans the outline of the object all round, and sees the robots and the walls that are near.
It knows where the target is, as if a beacon stood there that can be seen over everything, and how
far it has moved itself (odometry). The object hides robots that are behind it; robots do not hide
the object, which is taller than they are. No robot gets the pose of anything in a common frame.
"""

import math
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
        doc="Standard deviation of the measured motion of the robot as a fraction of the motion "
        "(dimensionless)",
    )


@dataclass(frozen=True)
class Reading:
    """What a robot sees, in its frame at present.

    object ``(k, 2)`` [m]: points of the outline, in the order of their directions, empty where the
    object is out of range. robots ``(m, 2)`` [m]: centres of those that are seen. walls ``(w, 2)``
    [m]: the nearest point of each wall that is near. target ``(2,)`` [m]. moved ``(3,)`` [m, m,
    rad]: the pose of the robot in its frame at the reading before.
    """

    object: Array
    robots: Array
    walls: Array
    target: Array
    moved: Array


class RobotSensor:
    """The sensors of all robots. They share nothing but the generator of their errors."""

    def __init__(
        self, outline: Array, size: tuple[float, float], settings: RobotSensorSettings, seed: int
    ) -> None:
        """outline ``(k, 2)`` [m] about the object's centre of mass; size [m] of a room about the
        origin."""
        self._outline, self._half = outline, 0.5 * np.array(size)
        self._settings, self._random = settings, np.random.default_rng([seed, 7])
        angles = 2.0 * math.pi * np.arange(settings.rays) / settings.rays
        self._rays = np.column_stack([np.cos(angles), np.sin(angles)])
        self._before: Array | None = None

    def look(self, pose: Array, robots: Array, target: Array) -> list[Reading]:
        """One reading of each robot. pose ``(3,)`` of the object's centre of mass; robots
        ``(n, 3)``; target ``(2,)`` [m]."""
        before = robots if self._before is None else self._before
        if len(before) != len(robots):
            before = robots
        self._before = robots.copy()
        corners = se2.transform(pose, self._outline)
        places = np.ascontiguousarray(robots[:, :2])
        reach = _scans(places, robots[:, 2].copy(), corners, self._rays)
        hidden = _hidden(places, corners)
        return [
            self._reading(i, robots, before[i], reach[i], hidden[i], target)
            for i in range(len(robots))
        ]

    def _reading(
        self, i: int, robots: Array, before: Array, reach: Array, hidden: Mask, target: Array
    ) -> Reading:
        s, here = self._settings, robots[i]
        inverse = se2.inverse(here)
        seen = reach < s.range
        points = self._measured(self._rays[seen] * reach[seen][:, None])
        others = ~hidden
        others[i] = False
        mates = se2.transform(inverse, robots[others, :2])
        mates = self._measured(mates[np.hypot(*mates.T) < s.range])
        x, y = here[:2]
        (w, h) = self._half
        walls = se2.transform(inverse, np.array([[w, y], [-w, y], [x, h], [x, -h]]))
        walls = self._measured(walls[np.hypot(*walls.T) < s.range])
        moved = se2.compose(se2.inverse(before), here)
        moved[2] = se2.wrap(float(moved[2]))
        moved = moved * (1.0 + s.odometry_error * self._random.normal(size=3))
        return Reading(points, mates, walls, se2.transform(inverse, target[None])[0], moved)

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


@numba.njit(cache=True, error_model="numpy")
def _scans(places: Any, headings: Any, corners: Any, rays: Any) -> Any:
    """``(n, k)`` [m] along the rays ``(k, 2)`` of each robot to an outline; inf where it is not."""
    n, count, m = places.shape[0], rays.shape[0], corners.shape[0]
    reach = np.empty((n, count))
    for i in range(n):
        c, s = math.cos(headings[i]), math.sin(headings[i])
        for k in range(count):
            x, y = c * rays[k, 0] - s * rays[k, 1], s * rays[k, 0] + c * rays[k, 1]
            best = math.inf
            for j in range(m):
                best = min(
                    best,
                    _crossing(places[i, 0], places[i, 1], x, y, corners[j], corners[(j + 1) % m]),
                )
            reach[i, k] = best
    return reach


@numba.njit(cache=True, error_model="numpy")
def _hidden(places: Any, corners: Any) -> Any:
    """``(n, n)`` whether an outline is between two places."""
    n, m = places.shape[0], corners.shape[0]
    hidden = np.zeros((n, n), np.bool_)
    for i in range(n):
        for k in range(i + 1, n):
            x, y = places[k, 0] - places[i, 0], places[k, 1] - places[i, 1]
            for j in range(m):
                if (
                    _crossing(places[i, 0], places[i, 1], x, y, corners[j], corners[(j + 1) % m])
                    <= 1.0
                ):
                    hidden[i, k] = hidden[k, i] = True
                    break
    return hidden
