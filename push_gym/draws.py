"""Random states of a room: where object, goal and robots are when an episode begins."""

import math

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.free_space import FreeSpace
from push_model.occupancy import rasterise
from push_model.outlines import overlap
from push_model.settings import SettingsError
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_scenario.scatter import scattered

_TRIES = 5000  # places for the object
_ROBOTS_ROOM = 2.5  # radii of a robot that fit between an object and a wall


class Draws:
    """Of one room. Poses are of bodies' frames."""

    def __init__(self, environment: EnvironmentSpec, robot: RobotSpec, item: ObjectSpec) -> None:
        self._space = FreeSpace(rasterise(environment))
        self._half = 0.5 * np.array(environment.size)
        self._radius, self._item, self._robot = robot.footprint_radius, item, robot
        reach = float(np.hypot(*item.outline.T).max())
        self._around = reach + _ROBOTS_ROOM * self._radius

    def object(self, random: np.random.Generator) -> Array:
        """A pose ``(3,)`` of the object with room for a robot all about it.

        Raises
        ------
        SettingsError: there is no such place.
        """
        for _ in range(_TRIES):
            place = random.uniform(-self._half, self._half)
            if self._space.field.at(*place) > self._around:
                return np.array([*place, random.uniform(-math.pi, math.pi)])
        raise SettingsError("room: the object and a robot beside it fit nowhere; enlarge it")

    def check(self, pose: Array, name: str) -> None:
        """Raise SettingsError if the object touches a wall at a pose ``(3,)``."""
        if self._space.field.clearance(self._item.outline, pose) <= 0.0:
            raise SettingsError(f"options: {name}: the object would touch a wall at {_told(pose)}")

    def check_robots(self, robots: Array, pose: Array) -> None:
        """Raise SettingsError if robots ``(n, 3)`` touch walls, each other or the object."""
        item = se2.transform(pose, self._item.outline)
        bodies = [se2.transform(r, self._robot.outline) for r in robots]
        for i, (robot, body) in enumerate(zip(robots, bodies, strict=True)):
            if self._space.field.clearance(self._robot.outline, robot) <= 0.0:
                raise SettingsError(f"options: robots: robot {i} would touch a wall")
            if overlap(body, item):
                raise SettingsError(f"options: robots: robot {i} would be in the object")
            if any(overlap(body, other) for other in bodies[:i]):
                raise SettingsError(f"options: robots: robot {i} would be in another one")

    def robots(self, random: np.random.Generator, count: int, pose: Array) -> Array:
        """``(count, 3)`` poses, apart from each other, walls and the object at a pose.

        Raises
        ------
        SettingsError: there are not so many places.
        """
        outline = se2.transform(pose, self._item.outline)
        try:
            return scattered(random, count, self._space, outline, self._radius)
        except SettingsError as error:
            raise SettingsError(f"room: {error}") from None


def _told(pose: Array) -> str:
    return f"({pose[0]:g}, {pose[1]:g}, {pose[2]:g})"
