"""Whether a swarm can bring an object to a target, before it tries. No ROS, no clock.

Refused is only what is shown to be impossible: an object that no placement of the robots at hand
can keep sliding (``rim_capacity.py``), a target that no way leads to, robots that walls keep from
the object. What is accepted may still fail.

In a large room with walls this takes half a second. ``slices`` therefore does it in parts between
which a node goes on with its other work; ``assess`` does it at once.
"""

import math
from collections.abc import Generator, Mapping
from copy import copy
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.free_space import FreeSpace, Obstacles
from push_model.jobs import JobError
from push_model.object_way import NoObjectWay
from push_model.occupancy import OccupancyGrid
from push_model.specs import ObjectSpec, RobotSpec
from swarm_push.arrival import pose_errors
from swarm_push.object_track import ObjectTrack
from swarm_push.rim_capacity import RimCapacity

_SAMPLES = 5  # headings between start and target at which a motion is looked at
_LATTICE = 0.05  # [m] of places that robots can go to
_SPARE = 0.01  # [m] that ways of robots keep from walls
_NEAR = 0.2  # [m] from a robot within which it joins the lattice
_PACE = 0.7  # mean speed of a push over the robots' greatest speed, as measured
_AMPLE = 1.8  # force at best over what is needed from which swarms arrive, as measured
_SLICE = 500  # poses of the object that are checked, about, before an assessment can be interrupted
_PER_PLACE = 10  # places that a flood reaches in the time of one such check
_PER_SLICE = 5  # robots for which a place to join the lattice is looked for, likewise
_TRIED = 8  # places that are tried
_PROGRAMME = 1000  # checks that take as long as a linear programme
_GATHER = 1.5  # ways of robots round each other and the object over straight ones, likewise
_T = TypeVar("_T")


@dataclass(frozen=True)
class Assessment:
    """What is known of a target beforehand.

    code, reason: why it is refused; NONE and empty where it is accepted. robots: how many of those
    seen can get to the object; needed: how many it takes at least, None where no number will do.
    force: [N] that the motion takes, its torque divided by the limit surface's radius; available:
    [N] that these robots can make at best. way: [m] of the object, turns by its greatest radius.
    seconds: that the job takes, roughly.
    """

    code: JobError
    reason: str
    robots: int
    needed: int | None
    force: float
    available: float
    way: float
    seconds: float

    @property
    def accepted(self) -> bool:
        """Whether nothing is known against it."""
        return self.code is JobError.NONE

    @property
    def margin(self) -> float:
        """[N] of force that the robots have to spare at best; negative: that they lack."""
        return self.available - self.force


@dataclass(frozen=True)
class Strength:
    """force: [N] that a motion takes; available: [N] that the robots can make of it at best;
    too_heavy: why they cannot, None where they may."""

    force: float
    available: float
    too_heavy: str | None

    @property
    def thin(self) -> bool:
        """Whether robots that are not placed as well as can be may fail to move the object."""
        return self.available < _AMPLE * self.force

    def __str__(self) -> str:
        return _forces(self.force, self.available)


class Feasibility:
    """Feasibility of tasks with one object and robots of one type, on a map or in an open room."""

    def __init__(
        self,
        item: ObjectSpec,
        robot: RobotSpec,
        grid: OccupancyGrid | None = None,
        track: ObjectTrack | None = None,
    ) -> None:
        """track: the planner of the object's way on the map; it is left as it is."""
        self.capacity = RimCapacity(item, robot)
        self._radius, self._speed = robot.footprint_radius, robot.max_speed
        self._lever = float(np.hypot(*item.geometry.outline.T).max())
        self._grid, self._track = grid, track
        known = None if track is None else track.field
        self._space = None if grid is None else FreeSpace(known or grid, _LATTICE)

    def assess(self, target: Array, pose: Array, robots: Mapping[str, Array]) -> Assessment:
        """Assess a target ``(3,)``, whose heading is nan if any will do. The object is at a pose
        ``(3,)``, both of the centre of mass, and robots at poses ``(3,)`` by name."""
        return at_once(self.slices(target, pose, robots))

    def slices(
        self, target: Array, pose: Array, robots: Mapping[str, Array]
    ) -> Generator[int, None, Assessment]:
        """``assess`` in slices: yields what each has cost, in poses of the object that could have
        been checked in its time (1 to 3 microseconds each); returns the assessment."""
        refusal, least = self._no_place(target), least_contacts(target)
        way, aim = self._straight(pose, target), target
        able = yield from self._able(pose, robots)
        if refusal is None and self._track is not None:
            track = copy(self._track)  # so that the way that is under way stays
            try:
                track.begin(pose, target, np.zeros((0, 3)))
                while not track.search(_SLICE):
                    yield _SLICE
                way, (aim, _) = track.left(pose), track.aim(pose)
            except NoObjectWay as error:
                refusal = JobError.PLANNING_FAILED, str(error)
        twists = self._twists(pose, aim)
        needed = yield from self._needed(twists, least)
        force = max((self.capacity.needed_force(t) for t in twists), default=0.0)
        available = yield from self._available(twists, len(able))
        if refusal is None:
            refusal = _too_few(force, available, needed, least, len(able), len(robots))
        code, reason = refusal or (JobError.NONE, "")
        seconds = self._gathering(pose, able) + way / (_PACE * self._speed)
        return Assessment(code, reason, len(able), needed, force, available, way, seconds)

    def strength(self, pose: Array, target: Array, robots: int) -> Strength:
        """Strength of so many robots that push an object at a pose ``(3,)`` straight to a target
        ``(3,)``."""
        twists = self._twists(pose, target)[:1]
        force = max((self.capacity.needed_force(t) for t in twists), default=0.0)
        available = at_once(self._available(twists, robots))
        if available >= force:
            return Strength(force, available, None)
        needed = at_once(self._needed(twists, least_contacts(target)))
        return Strength(force, available, _heavy(force, available, needed))

    def _needed(self, twists: list[Array], least: int) -> Generator[int, None, int | None]:
        """The fewest robots that may do for all of some twists ``(3,)`` in the object's frame; None
        where no number of them does."""
        most = least if twists else 0
        for twist in twists:
            count = self.capacity.least_robots(twist)
            yield 4 * _PROGRAMME
            if count is None:
                return None
            most = max(most, count)
        return most

    def _available(self, twists: list[Array], robots: int) -> Generator[int, None, float]:
        """[N] for the twist for which least is available of what it takes."""
        parts = []
        for twist in twists:
            made = self.capacity.available_force(twist, robots)
            parts.append((made, self.capacity.needed_force(twist)))
            yield _PROGRAMME
        if not parts:
            return 0.0
        part = min(a / f for a, f in parts)
        return part * max(f for _, f in parts)

    def _twists(self, pose: Array, target: Array) -> list[Array]:
        """In the object's frame, as it goes straight and turns as it goes; none where it is there.
        That of the beginning alone where any heading will do: it may turn on its way."""
        away, turned = pose_errors(pose, target)
        if away + self._lever * turned < 1e-6:
            return []
        way = target[:2] - pose[:2]
        turn = 0.0 if math.isnan(target[2]) else se2.wrap(float(target[2] - pose[2]))
        parts = [0.0] if turn == 0.0 else np.linspace(0.0, 1.0, _SAMPLES).tolist()
        return [np.array([*(se2.rotation_matrix(pose[2] + p * turn).T @ way), turn]) for p in parts]

    def _straight(self, pose: Array, target: Array) -> float:
        away, turned = pose_errors(pose, target)
        return away + self._lever * turned

    def _no_place(self, target: Array) -> tuple[JobError, str] | None:
        grid, track = self._grid, self._track
        if grid is not None and not grid.contains(float(target[0]), float(target[1])):
            return JobError.OUTSIDE_MAP, "the target is outside the map"
        if track is not None and not track.fits(target):
            return JobError.GOAL_OCCUPIED, "the object does not fit at the target"
        return None

    def _able(self, pose: Array, robots: Mapping[str, Array]) -> Generator[int, None, list[Array]]:
        """Places ``(2,)`` of the robots that can get to the object."""
        points = [p[:2] for p in robots.values()]
        space, among = self._space, Obstacles()
        if space is None or not points:
            return points
        reach = space.from_here(pose[:2], self._radius + _SPARE, among)
        while not reach.settle(_SLICE * _PER_PLACE):
            yield _SLICE
        reached = reach.reached
        found = []
        for count, point in enumerate(points):
            near = space.near(point, _NEAR)
            near = near[reached[near]][:_TRIED]
            ends = space.at(near)
            if any(space.line_keeps(point, end, self._radius, among) for end in ends):
                found.append(point)
            if count % _PER_SLICE == 0:
                yield _SLICE
        return found

    def _gathering(self, pose: Array, points: list[Array]) -> float:
        """[s] until most robots are at the object, roughly."""
        if not points:
            return 0.0
        away = np.hypot(*(np.array(points) - pose[:2]).T) - self._lever
        way = max(0.0, float(np.median(away))) + 0.5 * math.pi * self._lever
        return _GATHER * way / self._speed


def at_once(work: Generator[int, None, _T]) -> _T:
    """What a work in slices comes to, done to its end."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            found: _T = end.value
            return found


def _too_few(
    force: float, available: float, needed: int | None, least: int, able: int, seen: int
) -> tuple[JobError, str] | None:
    if force <= 0.0:
        return None
    if not able:
        text = f"none of {seen} robots can get to the object" if seen else "no robot is seen"
        return JobError.POSITIONING_FAILED, text
    if available < force:
        return JobError.TOO_HEAVY, _heavy(force, available, needed)
    return (JobError.POSITIONING_FAILED, too_few(able, least)) if able < least else None


def _heavy(force: float, available: float, needed: int | None) -> str:
    """The refusal, with its numbers."""
    text = f"too heavy: {_forces(force, available)}"
    if needed is None:
        return f"{text}, and no more robots find room behind the object"
    return f"{text}; at least {counted(needed)} are needed"


def counted(robots: int) -> str:
    """So many robots, in words."""
    return "1 robot" if robots == 1 else f"{robots} robots"


def least_contacts(target: Array) -> int:
    """How many robots a target ``(3,)`` takes whatever the object weighs. What is left to do at a
    pose is a turn on the spot, which takes a couple: two forces. A position takes one."""
    return 1 if math.isnan(target[2]) else 2


def _forces(force: float, available: float) -> str:
    """As a traction check of one robot says it; never as much as is needed by rounding."""
    return f"needs {force:.2f} N, has {math.floor(100.0 * available) / 100.0:.2f} N at best"


def too_few(robots: int, least: int) -> str:
    """Why fewer robots than contacts that a target takes will not do."""
    return (
        f"{counted(robots)} cannot turn the object to a heading: a turn needs a couple of forces, "
        f"so at least {least} robots; a goal without a heading needs only one"
    )
