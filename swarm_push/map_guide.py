"""What a robot with a map makes of its readings: where it is, where the object is, and whither.

The guide replaces the beacon of an open room. It estimates the pose of its robot on the map
(``own_pose.py``) and keeps the place where the object was seen last. The point of the object's
route that is ahead of this place (``map_route.py``) is the target that the law gets. A robot that
does not see the object walks to where it expects it, round the walls. If it is not there, the robot
looks farther along the route, for that is where the others push it.
"""

import math

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.flood import Flood
from push_model.free_space import FreeSpace
from push_model.obstacles import NOTHING
from swarm_push.map_route import MapRoute
from swarm_push.own_pose import OwnPose
from swarm_push.robot_sensor import Reading
from swarm_push.walls import farthest_seen, towards_walls

_SPARE = 0.02  # [m] that a robot's way keeps from walls beside its radius
_EMPTY = 0.4  # [m] from a place: a robot that does not see the object there knows that it has gone
_ON = 0.3  # [m] along the route to where it looks next
_MOVED = 0.1  # [m] that a place moves before the way to it is looked for again
# Chosen on the four maps of ``swarm-maps``, with seeds 501 to 505, 901 to 906 and 1101.
_PINS = 0.2  # cosine of the angle between a wall's normal and a push that is always allowed
_MARGIN = 0.03  # [m] between the object and a wall that pushes at the wall leave
_ALONG = 0.6  # weight of the direction of the route where the object cannot go straight to it
_OPEN, _FRONT = 1.0, 0.4  # weight of room before it there; [m] from it where this is looked for
_EVERY = 5  # readings between looks at the map: 0.1 s
_ARC = 0.2  # [rad] between places on the way round the object
_ANGLES = np.deg2rad([0.0, *(sign * angle for angle in range(10, 100, 10) for sign in (1, -1))])
_TURNS = np.array([se2.rotation_matrix(float(a)) for a in _ANGLES])


class MapGuide:
    """That of one robot."""

    def __init__(self, space: FreeSpace, route: MapRoute, own: OwnPose, radius: float) -> None:
        """radius: [m] of the robot."""
        self._space, self._route, self.own, self._radius = space, route, own, radius
        self._item = route.points[0]  # (2,) [m] where the object is thought to be
        self._readings = _EVERY  # since what follows was found
        self._ahead, self._wall, self._most = np.zeros(2), np.zeros(2), 1.0
        self._is_blocked: dict[bool, bool] = {}  # by whether counterclockwise
        self._way: Flood | None = None
        self._towards = np.full(2, math.inf)

    def look(self, reading: Reading) -> None:
        """See Guide."""
        self.own.step(reading.moved, reading.walls)
        self._readings += 1

    def target(self, centre: Array) -> Array:
        """See Guide."""
        self._item = se2.transform(self.own.pose, centre[None])[0]
        if self._readings >= _EVERY:
            self._readings, self._is_blocked = 0, {}
            self._ahead = self._from_walls(self._route.aim(self._item))
            self._most, self._wall = self._beside()
        return self._seen_from_here(self._item + self._ahead)

    def _from_walls(self, aim: Array) -> Array:
        """``(2,)`` [m] from the object to a point. If robots have no room behind the object, it is
        turned to where they have some: little, along the route and into open space as far as may
        be. It is not turned if there is no room anywhere."""
        way = aim - self._item
        away = self._route.radius + self._radius
        turned = _TURNS @ way
        units = turned / max(math.hypot(*way), 1e-9)
        free = self._space.clearance(self._item - away * units) >= self._radius
        if free[0] or not free.any():
            return np.array(way)
        fronts = np.minimum(self._space.clearance(self._item + _FRONT * units), _FRONT) / _FRONT
        along = units @ self._route.direction(self._item)
        worth = np.cos(_ANGLES) + _ALONG * along + _OPEN * fronts
        found: Array = turned[int(np.where(free, worth, -math.inf).argmax())]
        return found

    def _beside(self) -> tuple[float, Array]:
        """Cosine that a push may have at most with the unit vector ``(2,)`` from the object to the
        nearest wall: the smaller, the closer the wall is."""
        here = self._item[None]
        room = float(self._space.clearance(here)[0]) - self._route.radius
        most = max(_PINS, (room - _MARGIN) / (2.0 * self._radius))
        return most, towards_walls(self._space, here)[0]

    def pins(self, inward: Array) -> bool:
        """See Guide."""
        if self._most >= 1.0:
            return False
        c, s = math.cos(self.own.pose[2]), math.sin(self.own.pose[2])
        x, y = c * inward[0] - s * inward[1], s * inward[0] + c * inward[1]
        return bool(x * self._wall[0] + y * self._wall[1] > self._most)

    def blocked(self, centre: Array, turn: float) -> bool:
        """See Guide."""
        left = turn > 0.0
        if left not in self._is_blocked:
            off = -se2.rotation_matrix(float(self.own.pose[2])) @ centre
            away = min(math.hypot(*off), self._route.radius + self._radius)
            count = max(2, math.ceil(abs(turn) / _ARC))
            angles = math.atan2(off[1], off[0]) + np.linspace(0.0, turn, count)[1:]
            places = self._item + away * np.column_stack([np.cos(angles), np.sin(angles)])
            clear = self._space.clearance(places)
            self._is_blocked[left] = bool((clear < self._radius).any())
        return self._is_blocked[left]

    def walk(self) -> Array:
        """See Guide."""
        self._readings = _EVERY
        self._expect()
        return self._seen_from_here(self._round_walls(self._item))

    def _seen_from_here(self, point: Array) -> Array:
        found: Array = se2.transform(se2.inverse(self.own.pose), point[None])[0]
        return found

    def _expect(self) -> None:
        """Look farther along the route if the object is not where it was. It was not in a wall:
        if its estimated centre is, look for it on the route."""
        here, points = self.own.pose[:2], self._route.points
        if self._space.clearance(self._item[None])[0] < self._radius:
            self._item = points[self._route.place(self._item)]
        if math.hypot(*(self._item - here)) > _EMPTY or not self._sees(here, self._item):
            return
        at = self._route.place(self._item)
        step = max(1, round(_ON * (len(points) - 1) / max(self._route.length, 1e-9)))
        self._item = points[(at + step) % len(points)]

    def _sees(self, here: Array, there: Array) -> bool:
        return bool(self._space.sees(here[None], there[None], self._radius, 0.0)[0])

    def _round_walls(self, goal: Array) -> Array:
        """Next point ``(2,)`` [m] on the way of the robot to a place."""
        here = self.own.pose[:2]
        if self._sees(here, goal):
            return goal
        field = self._space.field
        if self._way is None or math.hypot(*(goal - self._towards)) > _MOVED:
            need = (self._radius + _SPARE) / field.spacing
            nothing, stride = self._space.capsules(NOTHING), self._space.stride
            tip = field.lattice(goal)
            self._way = Flood.of_disc(field.values, nothing, tip, need, stride)
            self._way.step(self._way.state.size)
            self._towards = goal
        found, _ = farthest_seen(
            field.values,
            self._way.state,
            self._way.cost,
            self._way.stride,
            field.lattice(here[None]),
            self._radius / field.spacing,
            0.5 * self._radius / field.spacing,
        )
        next_point: Array = self._space.metres(found)[0]
        return next_point
