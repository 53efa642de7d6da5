"""A swarm without shared poses: each robot has only its own sensing (``robot_sensor.py``), and its
own copy of one law (``local_law.py``). No robot is told the outline of the object. In an open room
no robot is told a pose either.

In a room with inner walls each robot has a map (``map_guide.py``). It is told where it stands at
the start, where the object starts, where it is to go, and the radii of two discs about its centre:
one contains the object, the other one lies in it.

The node gets the poses of all bodies, because motion capture stands in for the sensors; what it
tells the host, and when the task is done, comes from them too. The robots' laws get readings alone.
"""

import math
from dataclasses import replace

import numpy as np

from push_job.method import Arena, MethodSpec, Unsuited
from push_job.open_room import OpenRoom, OpenRoomMethod, OpenRoomSettings
from push_model.arrays import Array
from push_model.free_space import FreeSpace
from push_model.occupancy import OccupancyGrid
from push_model.outlines import distance, inside
from push_model.specs import ObjectSpec
from swarm_push.local_law import LocalLaw, LocalLawSettings
from swarm_push.map_guide import MapGuide
from swarm_push.map_route import MapRoute, RouteSettings
from swarm_push.own_pose import OwnPose, OwnPoseSettings
from swarm_push.region import is_open
from swarm_push.robot_sensor import RobotSensor, RobotSensorSettings
from swarm_push.swarm_method import check_team
from swarm_push.wall_sides import wall_sides


class OwnSensing:
    """All robots; see VelocityLaw."""

    def __init__(
        self,
        room: OpenRoom,
        law: LocalLawSettings,
        sensor: RobotSensorSettings,
        guides: "Guides | None" = None,
    ) -> None:
        """guides: of robots with a map; None in an open room."""
        self._room, self._law, self._guides = room, law, guides
        outline = room.item.geometry.outline
        walls = None if guides is None else guides.sides
        self._sensor = RobotSensor(outline, room.size, sensor, room.seed, walls)
        self._robots: list[LocalLaw] = []
        self._last: float | None = None
        self._route: MapRoute | None = None

    def left(self, pose: Array) -> float:
        """See WalledLaw."""
        if self._guides is None:
            return math.hypot(*(pose[:2] - self._room.target))
        return math.inf if self._route is None else self._route.left(pose[:2])

    def velocities(self, time: float, pose: Array, robots: Array) -> Array:
        """See VelocityLaw."""
        if len(self._robots) != len(robots):
            self._begin(pose, robots)
        dt, self._last = 0.0 if self._last is None else time - self._last, time
        readings = self._sensor.look(pose, robots, self._room.target)
        told = [r.step(v, dt) for r, v in zip(self._robots, readings, strict=True)]
        own = np.array(told).reshape(-1, 2)
        c, s = np.cos(robots[:, 2]), np.sin(robots[:, 2])
        return np.column_stack([c * own[:, 0] - s * own[:, 1], s * own[:, 0] + c * own[:, 1]])

    def _begin(self, pose: Array, robots: Array) -> None:
        room, guides = self._room, self._guides
        guided: list[MapGuide | None] = [None] * len(robots)
        discs = None
        if guides is not None:
            discs = _discs(room.item.geometry.outline)
            self._route = guides.route(room.item, pose[:2], room.target)
            guided = [*guides.made(room, self._route, robots)]
        self._robots = [
            LocalLaw(room.radius, room.speed, self._law, (room.seed, 9, i), guide, discs)
            for i, guide in enumerate(guided)
        ]


class Guides:
    """Makes the guides of robots on a map. sides ``(n, 2, 2)`` [m]: of its walls."""

    def __init__(
        self,
        grid: OccupancyGrid,
        radius: float,
        route: RouteSettings,
        own: OwnPoseSettings,
        sensor: RobotSensorSettings,
    ) -> None:
        """grid: see ``_centred``; radius: [m] of the robots."""
        self.sides = wall_sides(grid)
        self._space, self._radius = FreeSpace(grid), radius
        self._settings, self._own, self._sensor = route, own, sensor

    def route(self, item: ObjectSpec, start: Array, target: Array) -> MapRoute:
        """See MapRoute."""
        _, radius = _discs(item.geometry.outline)
        return MapRoute(self._space, start, target, (radius, self._radius), self._settings)

    def made(self, room: OpenRoom, route: MapRoute, robots: Array) -> list[MapGuide]:
        """robots ``(n, 3)``: poses at the start, of which each is told its own, with errors."""
        s = self._own
        deviations = np.array([s.start_position, s.start_position, s.start_heading])
        errors = np.random.default_rng([room.seed, 8]).normal(size=(len(robots), 3)) * deviations
        slip = self._sensor.odometry_error
        return [
            MapGuide(self._space, route, OwnPose(self.sides, place, slip, s), self._radius)
            for place in robots + errors
        ]


def _discs(outline: Array) -> tuple[float, float]:
    """Radii [m] of the largest disc about the centre of mass in an outline ``(k, 2)`` [m], 0 if the
    centre is not in it, and of the smallest one that contains it."""
    middle = np.zeros((1, 2))
    inner = float(distance(outline, middle)[0]) if inside(outline, middle)[0] else 0.0
    return inner, float(np.hypot(*outline.T).max())


def _method(arena: Arena) -> OpenRoomMethod:
    law = arena.section("law", LocalLawSettings)
    sensor = arena.section("sensor", RobotSensorSettings)
    if is_open(arena.grid):
        return OpenRoomMethod("own-sensing", lambda room: OwnSensing(room, law, sensor), arena)
    guides = Guides(
        _centred(arena.grid),
        arena.robot.footprint_radius,
        arena.section("route", RouteSettings),
        arena.section("own_pose", OwnPoseSettings),
        sensor,
    )

    def ways(item: ObjectSpec, start: Array, target: Array) -> None:
        guides.route(item, start, target)

    return OpenRoomMethod(
        "own-sensing", lambda room: OwnSensing(room, law, sensor, guides), arena, ways
    )


def _centred(grid: OccupancyGrid) -> OccupancyGrid:
    """A map whose free cells have their middle in the origin, as of ``OpenRoom``."""
    extent = grid.free_extent
    if extent is None:
        raise Unsuited("the map has no free cell")
    left, right, low, high = extent
    return replace(grid, origin=grid.origin - 0.5 * np.array([left + right, low + high]))


METHOD = MethodSpec(
    "own-sensing",
    _method,
    {
        "": OpenRoomSettings,
        "law": LocalLawSettings,
        "sensor": RobotSensorSettings,
        "route": RouteSettings,
        "own_pose": OwnPoseSettings,
    },
    check_team,
    "own-sensing",
)
