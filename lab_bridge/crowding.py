"""Frames that cannot be: two robots in one place, a robot inside an object, a body off the map.

Wrong units show in this way. A lab that is measured in metres and read as millimetres has all its
bodies at the origin. Such a frame is refused as a whole, so that nothing moves on it.
"""

from collections.abc import Mapping

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.outlines import convex_hull, inside_convex
from push_scenario.scenario import Scenario

_OFF = 1.0  # [m] beyond the edge of the map
_PART = 0.8  # of the distance of two robots that touch


class Crowding:
    """Knows the bodies and the map of a scenario."""

    def __init__(self, scenario: Scenario) -> None:
        self._radii = {n: spec.body_radius for n, (spec, _) in scenario.robots.items()}
        # only convex objects: a robot may stand between the arms of others
        self._outlines = {
            name: outline
            for name, (spec, _) in scenario.objects.items()
            if len(convex_hull(outline := spec.outline)) == len(outline)
        }
        grid = scenario.grid
        rows, columns = grid.occupied.shape
        self._low = np.array(grid.origin, dtype=np.float64) - _OFF
        self._high = self._low + 2.0 * _OFF + grid.resolution * np.array([columns, rows])

    def impossible(self, poses: Mapping[str, Array]) -> str:
        """Why the poses ``(3,)`` by body cannot be; empty where they can."""
        for name, pose in poses.items():
            if not ((self._low <= pose[:2]) & (pose[:2] <= self._high)).all():
                return f"{name} is at ({pose[0]:.2f}, {pose[1]:.2f}) m, off the map"
        robots = [n for n in poses if n in self._radii]
        if not robots:
            return ""
        places = np.array([poses[n][:2] for n in robots])
        radii = np.array([self._radii[n] for n in robots])
        near = np.hypot(*(places[:, None] - places[None]).T)
        np.fill_diagonal(near, np.inf)
        crowded = np.argwhere(near < _PART * (radii[:, None] + radii[None]))
        if len(crowded):
            a, b = crowded[0]
            return f"{robots[a]} and {robots[b]} are in one place"
        for item, outline in self._outlines.items():
            if item in poses:
                inside = inside_convex(outline, se2.transform(se2.inverse(poses[item]), places))
                if inside.any():
                    return f"{robots[int(np.argmax(inside))]} is inside {item}"
        return ""
