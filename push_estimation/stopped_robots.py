"""Which robots the object stops: they are commanded towards it and come no closer.

In a window of time, the commands of a robot say where it would get to in the object's frame, and
the poses say where it got to. A robot that was to move by some millimetres, towards the object or
along it, and did not, with no other body in front of it, touches the object. So does one that
slides along the object and does not get closer, although it was to.

A robot that pushes the object may move just as it was commanded to. If the object moves and no
robot is at its estimated outline, the robots that move along with it are those that touch it.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.settings import bounded, settings

_BESIDE = 0.1  # cosine of the angle to the way that was commanded up to which a body is beside it
_OUTWARD = 0.3  # cosine of the angle to the outward normal of a way on which the object may stop it
_LONGEST = 0.2  # [s] between frames of one window
_FORCE = 0.2  # [s] of pose time for which a command is in force, the default of the bridges


@settings
class StoppedSettings:
    """What counts as stopped by the object."""

    window: float = bounded(
        0.5,
        low=0.05,
        high=10.0,
        doc="Length of the time window in which the outline estimator compares the commanded and "
        "the measured motion of a robot (s)",
    )
    wanted: float = bounded(
        8e-3,
        low=1e-4,
        high=1.0,
        doc="Distance by which a robot must be commanded to move, or to come closer to the object, "
        "within the time 'window' before it can count as stopped by the object (m)",
    )
    share: float = bounded(
        0.3,
        low=0.0,
        high=1.0,
        doc="Greatest ratio of the measured to the commanded motion at which a robot counts as "
        "stopped by the object (dimensionless)",
    )
    reach: float = bounded(
        0.1,
        low=0.0,
        high=10.0,
        doc="Greatest distance of a robot from the estimated line of contact (the line of the "
        "centres of touching robots) at which the object may have stopped the robot (m)",
    )
    gap: float = bounded(
        8e-3,
        low=0.0,
        high=1.0,
        doc="Greatest gap between two robots at which one of them may have stopped the other (m)",
    )


class Line(Protocol):
    """The estimated line of contact."""

    def depth(self, points: Array) -> Array:
        """``(n,)`` [m] by which ``(n, 2)`` lie inside of it, negative outside."""
        ...

    def outward(self, point: Array) -> Array:
        """``(2,)`` its unit normal near a point ``(2,)`` [m]."""
        ...


@dataclass(frozen=True)
class Stop:
    """The object stopped a robot at ``place (2,)`` [m] in the object's frame. on_its_way: whether
    the robot did not move at all; it was on the way ``way (2,)``, a unit vector, then."""

    place: Array
    way: Array
    on_its_way: bool


@dataclass
class _Watch:
    """Of one robot since a time [s]: the pose of the object then; how far the commands would have
    taken the robot, and where it was in all frames, in the object's frame."""

    since: float
    item: Array
    wanted: Array = field(default_factory=lambda: np.zeros(2))
    points: list[Array] = field(default_factory=list)

    @property
    def place(self) -> Array:
        """``(2,)`` [m] where it was on average."""
        mean: Array = np.mean(self.points, axis=0)
        return mean

    @property
    def moved(self) -> Array:
        """``(2,)`` [m] how far it has moved, from the means of the first and the last frames."""
        part = max(1, len(self.points) // 4)
        way: Array = np.mean(self.points[-part:], axis=0) - np.mean(self.points[:part], axis=0)
        return way


class StoppedRobots:
    """Watches all robots of a team at one object."""

    def __init__(self, radius: float, settings: StoppedSettings | None = None) -> None:
        """radius: [m] of the robots."""
        self.settings, self._radius = settings or StoppedSettings(), radius
        self._commands: dict[str, tuple[float, float, float, bool]] = {}
        self._watches: dict[str, _Watch] = {}
        self._last: tuple[float, Array, dict[str, Array]] | None = None

    def command(self, name: str, stamp: float, vx: float, vy: float, world: bool) -> None:
        """A velocity [m/s], in the robot's own frame or that of the world, that answers the poses
        of a time [s]. It is in force for ``_FORCE`` seconds; then the robot stands."""
        if name in self._commands and stamp < self._commands[name][0] and (vx or vy):
            return  # the bridges refuse it
        self._commands[name] = (stamp, vx, vy, world)

    def reset(self) -> None:
        """The stream was interrupted."""
        self._watches.clear()
        self._commands.clear()
        self._last = None

    def frame(
        self,
        stamp: float,
        item: Array,
        robots: Mapping[str, Array],
        others: Array,
        line: Line,
        unsure: Collection[str] = (),
    ) -> list[Stop]:
        """Robots that the object has just stopped.

        item: pose ``(3,)`` of the object's frame; robots: likewise by name. others: ``(k, 2)`` [m]
        of other bodies of about a robot's size. line: as it is estimated. unsure: robots that
        something else may have stopped, such as a wall.
        """
        last, self._last = self._last, (stamp, item, {n: p.copy() for n, p in robots.items()})
        if last is None or not 0.0 < stamp - last[0] < _LONGEST:
            self._watches.clear()
            return []
        then, item_then, robots_then = last
        now, back = se2.inverse(item), se2.inverse(item_then)
        places = {n: se2.transform(now, p[None, :2])[0] for n, p in robots.items()}
        bodies = np.vstack([*places.values(), se2.transform(now, others)])
        found = []
        for name, place in places.items():
            if name not in robots_then or not self._told(name, stamp):
                self._watches.pop(name, None)
                continue
            before = robots_then[name]
            ahead = before[:2] + (stamp - then) * self._velocity(name, before)
            start, end = se2.transform(back, before[None, :2]), se2.transform(now, ahead[None])
            watch = self._watches.setdefault(name, _Watch(then, item_then))
            watch.wanted = watch.wanted + (end - start)[0]
            watch.points.append(place)
            if stamp - watch.since >= self.settings.window:
                del self._watches[name]
                if name in unsure or line.depth(place[None])[0] < -self.settings.reach:
                    continue
                stop = self._stopped(watch, bodies, line.outward(place))
                if stop is None:
                    stop = self._pushing(watch, item, bodies[: len(places)], bodies, line)
                if stop is not None:
                    found.append(stop)
        return found

    def _told(self, name: str, now: float) -> bool:
        """Whether a command to a robot is in force."""
        return name in self._commands and now - self._commands[name][0] <= _FORCE

    def _velocity(self, name: str, pose: Array) -> Array:
        _, vx, vy, world = self._commands[name]
        if world:
            return np.array([vx, vy])
        c, s = np.cos(pose[2]), np.sin(pose[2])
        return np.array([c * vx - s * vy, s * vx + c * vy])

    def _stopped(self, watch: _Watch, bodies: Array, outward: Array) -> Stop | None:
        """bodies: ``(m, 2)`` [m] of all, the robot's own among them."""
        s, wanted = self.settings, float(np.hypot(*watch.wanted))
        moved = watch.moved
        # Held back on its way, or only on the part of it that leads inward.
        ways = np.stack([watch.wanted / max(wanted, 1e-9), -outward])
        far = np.array([wanted, -float(watch.wanted @ outward)])
        held = (far > s.wanted) & (ways @ moved < s.share * far)
        held[0] &= far[1] > -_OUTWARD * wanted
        if not held.any() or self._behind(watch.points[-1], ways, bodies):
            return None
        return Stop(watch.place, ways[0], bool(held[0]))

    def _pushing(
        self, watch: _Watch, item: Array, robots: Array, bodies: Array, line: Line
    ) -> Stop | None:
        """Whether the object moves along with the robot although no robot is at its outline."""
        s, place = self.settings, watch.place
        inward, at = -line.outward(place), place[None]
        there = se2.transform(se2.inverse(watch.item), se2.transform(item, at))
        moved = (there - at)[0]
        far = float(moved @ inward)
        if far < s.wanted or float(np.hypot(*watch.moved)) > s.share * far:
            return None
        way = moved / float(np.hypot(*moved))
        if self._behind(watch.points[-1], np.stack([way, inward]), bodies):
            return None
        at_line = robots[line.depth(robots) > -s.gap]
        if any(float(line.outward(r) @ way) < 0.0 for r in at_line):
            return None
        return Stop(place, way, on_its_way=False)

    def _behind(self, place: Array, ways: Array, bodies: Array) -> bool:
        """Whether a body is in front of a robot on one of its ways, unit vectors ``(k, 2)``."""
        to = bodies - place
        away = np.hypot(*to.T)
        near = (away > 0.0) & (away < 2.0 * self._radius + self.settings.gap)
        ahead = (to @ ways.T > _BESIDE * away[:, None]).any(axis=1)
        return bool((near & ahead).any())
