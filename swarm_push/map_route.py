"""The route of the object on a map, as every robot computes it for itself.

All robots are told the same map, the same places where the object starts and is to go, and the
same radius of a disc that contains the object. So all of them find the same route, without a word.
"""

import math

import numpy as np

from push_job.open_room import NoWay
from push_model.arrays import Array, Mask
from push_model.free_space import FreeSpace
from push_model.settings import bounded, settings

_WIDTHS = 0.02  # [m] between the clearances that are tried
_LEAST = 0.01  # [m] the smallest of them
_STEP = 0.05  # [m] between points of a route that are aimed at
_SEES = 0.5  # part of the object's radius that a line of sight keeps from walls at least


@settings
class RouteSettings:
    """How the object is led round walls."""

    wide: float = bounded(
        0.2,
        low=0.0,
        high=10.0,
        doc="Preferred clearance of the object from walls on its route, in addition to the "
        "diameter of a robot (m). If there is no such route, the one with the greatest clearance "
        "is taken",
    )
    ahead: float = bounded(
        0.4,
        low=0.05,
        high=10.0,
        doc="Look-ahead distance along the route to the point towards which the robots push the "
        "object (m)",
    )
    back: float = bounded(
        1.0,
        low=0.0,
        high=10.0,
        doc="Shift of the point towards which the object is pushed, to the other side of the "
        "route, divided by the distance of the object from the route (dimensionless)",
    )


class MapRoute:
    """A route of a disc of a radius [m]. points ``(n, 2)`` [m]: of the route, ``_STEP`` apart."""

    def __init__(
        self,
        space: FreeSpace,
        start: Array,
        target: Array,
        radii: tuple[float, float],
        settings: RouteSettings,
    ) -> None:
        """start, target ``(2,)`` [m]; radii [m]: of the disc and of a robot.

        Raises
        ------
        NoWay: the disc does not fit through.
        """
        self._space, self.radius, self._settings = space, radii[0], settings
        corners = self._widest(start, target, 2.0 * radii[1] + settings.wide)
        lengths = np.hypot(*np.diff(corners, axis=0).T)
        at = np.concatenate([[0.0], np.cumsum(lengths)])
        self.length = float(at[-1])
        even = np.linspace(0.0, self.length, max(2, math.ceil(self.length / _STEP) + 1))
        self.points: Array = np.column_stack([np.interp(even, at, c) for c in corners.T])
        self._spacing = self.length / (len(self.points) - 1)

    def _widest(self, start: Array, target: Array, most: float) -> Array:
        count = max(1, math.ceil((most - _LEAST) / _WIDTHS))
        for room in np.linspace(most, _LEAST, count + 1):
            way = self._space.from_here(start, self.radius + float(room)).way_to(target)
            if way is not None:
                return way
        raise NoWay(f"an object in a disc of {self.radius:.3g} m has no way to the target")

    def place(self, point: Array) -> int:
        """Number of the point of the route that is nearest to a point ``(2,)`` [m] and not behind a
        wall, for a route may come back on the other side of one. The nearest if all are behind."""
        away = np.hypot(*(self.points - point).T)
        nearest = int(away.argmin())
        if not self._in_sight(point, self.points[nearest : nearest + 1])[0]:
            sees = self._in_sight(point, self.points)
            nearest = int(np.where(sees, away, away + away.max()).argmin())
        return nearest

    def _in_sight(self, point: Array, others: Array) -> Mask:
        """To which points ``(n, 2)`` [m] no wall is in the way."""
        return self._space.sees(np.repeat(point[None], len(others), axis=0), others, _LEAST, 0.0)

    def direction(self, point: Array) -> Array:
        """Unit vector ``(2,)`` along the route beside a point ``(2,)`` [m]; zero at its end."""
        here = self.place(point)
        way = self.points[min(here + 3, len(self.points) - 1)] - self.points[here]
        found: Array = way / max(math.hypot(*way), 1e-9)
        return found

    def left(self, point: Array) -> float:
        """[m] of route that an object at ``(2,)`` [m] has to its end."""
        here = self.place(point)
        rest = (len(self.points) - 1 - here) * self._spacing
        return rest + math.hypot(*(self.points[here] - point))

    def aim(self, point: Array) -> Array:
        """``(2,)`` [m] to which an object at ``(2,)`` is pushed: the farthest point within the
        look-ahead to which the disc can go straight, the one after the nearest if it can go to
        none; moved to the other side of the route, except at the ends of it."""
        here = self.place(point)
        count = max(1, round(self._settings.ahead / max(self._spacing, 1e-9)))
        ahead = self.points[here : here + count + 1]
        sees = self._space.sees(
            np.repeat(point[None], len(ahead), axis=0),
            ahead,
            self.radius,
            _SEES * self.radius,
        )
        found = ahead[int(np.flatnonzero(sees).max(initial=min(1, len(ahead) - 1)))]
        if here in (0, len(self.points) - 1):
            return np.array(found)
        moved: Array = found + self._settings.back * (self.points[here] - point)
        return moved
