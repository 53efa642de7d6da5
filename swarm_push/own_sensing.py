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
from collections.abc import Hashable, Sequence
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
        self._names: tuple[str, ...] = ()
        self._robots: dict[Hashable, LocalLaw] = {}  # by name
        self._last: dict[Hashable, float] = {}  # [s] of the last reading, by name
        self._errors = np.random.default_rng([room.seed, 8])  # of what robots are told
        self._route: MapRoute | None = None

    def left(self, pose: Array) -> float:
        """See WalledLaw."""
        if self._guides is None:
            return math.hypot(*(pose[:2] - self._room.target))
        return math.inf if self._route is None else self._route.left(pose[:2])

    def meet(self, names: tuple[str, ...]) -> None:
        """See NamedLaw."""
        self._names = names

    def velocities(self, time: float, pose: Array, robots: Array) -> Array:
        """See VelocityLaw."""
        names: Sequence[Hashable] = self._names or range(len(robots))
        for name, robot in zip(names, robots, strict=True):
            if name not in self._robots:
                self._robots[name] = self._made(pose, robot)
        readings = self._sensor.look(pose, robots, self._room.target, names)
        told = [
            self._robots[name].step(reading, time - self._last.get(name, time))
            for name, reading in zip(names, readings, strict=True)
        ]
        self._last.update(dict.fromkeys(names, time))
        own = np.array(told).reshape(-1, 2)
        c, s = np.cos(robots[:, 2]), np.sin(robots[:, 2])
        return np.column_stack([c * own[:, 0] - s * own[:, 1], s * own[:, 0] + c * own[:, 1]])

    def _made(self, pose: Array, robot: Array) -> LocalLaw:
        """That of a robot at ``(3,)``, which is told what it has to know; once for a target."""
        room, guides = self._room, self._guides
        guide, discs = None, None
        if guides is not None:
            discs = _discs(room.item.geometry.outline)
            if self._route is None:
                self._route = guides.route(room.item, pose[:2], room.target)
            guide = guides.made(self._route, robot, self._errors)
        seed = room.seed, 9, len(self._robots)
        return LocalLaw(room.radius, room.speed, self._law, seed, guide, discs)


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

    def made(self, route: MapRoute, robot: Array, errors: np.random.Generator) -> MapGuide:
        """robot ``(3,)``: its pose at the start, which it is told with errors."""
        s = self._own
        deviations = np.array([s.start_position, s.start_position, s.start_heading])
        told = robot + errors.normal(size=3) * deviations
        own = OwnPose(self.sides, told, self._sensor.odometry_error, s)
        return MapGuide(self._space, route, own, self._radius)


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
