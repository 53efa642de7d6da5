"""The way of an object round walls, and where on it the object is to head next."""

import math
from contextlib import suppress

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.free_space import FreeSpace, Obstacles
from push_model.object_way import NoObjectWay, WayFinder, pieces
from push_model.occupancy import OccupancyGrid
from push_model.screws import screw_between, screw_poses
from push_model.settings import bounded, settings

_LATTICE = 0.02  # [m]
_SAMPLES = 60  # poses of a piece that an object's place on it is looked for among


@settings
class TrackSettings:
    """How an object goes round walls."""

    wide: float = bounded(0.2, low=0.0, high=10.0, doc="[m] about it, besides robots' diameters")
    room: float = bounded(0.02, low=0.0, high=1.0, doc="[m] likewise, where there is no more")
    least_room: float = bounded(2e-3, low=0.0, high=1.0, doc="[m] where there is not that either")
    ahead: float = bounded(0.25, low=0.01, high=10.0, doc="[m] on its way that it heads for")
    corner: float = bounded(0.03, low=1e-3, high=1.0, doc="[m] from a corner that is passed")
    off: float = bounded(0.06, low=5e-3, high=10.0, doc="[m] from its way: another is looked for")


class ObjectTrack:
    """For one object and robots of one radius [m]. under_way: whether there is a way."""

    def __init__(
        self, grid: OccupancyGrid, outline: Array, radius: float, settings: TrackSettings
    ) -> None:
        """outline: ``(k, 2)`` [m] about the centre of mass."""
        self.settings = settings
        space = FreeSpace(grid, _LATTICE)
        self._finder, self._diameter = WayFinder(space, outline, 0.0), 2.0 * radius
        self._lever = float(np.hypot(*outline.T).max())
        self._target = np.zeros(3)
        self._pieces: list[tuple[Array, Array]] = []
        self._part = 0.0

    @property
    def under_way(self) -> bool:
        """See the class."""
        return bool(self._pieces)

    def clear(self) -> None:
        """Forget the way."""
        self._pieces = []

    def fits(self, pose: Array) -> bool:
        """Whether an object at ``(3,)`` touches no wall; with a heading of nan, in any."""
        headings = np.arange(16) * math.pi / 8.0 if math.isnan(pose[2]) else pose[2:]
        poses = np.array([[*pose[:2], h] for h in headings])
        room = self._finder.clearance(poses, Obstacles())
        return bool(room.max() > 0.0)

    def plan(self, pose: Array, target: Array, others: Array) -> None:
        """A way from one pose ``(3,)`` to another, whose heading may be nan, round others
        ``(k, 3)`` x, y, radius [m]. Where there is none, that which was stays.

        Raises
        ------
        NoObjectWay
        """
        s, among = self.settings, Obstacles(discs=others)
        for spare in (s.wide, s.room):
            with suppress(NoObjectWay):
                way = self._finder.with_room(self._diameter + spare).way(pose, target, among)
                break
        else:
            way = self._finder.with_room(self._diameter + s.least_room).way(pose, target, among)
        self._pieces, self._part, self._target = pieces(way), 0.0, np.array(target)

    def go_straight(self, pose: Array, target: Array) -> None:
        """Take the straight way, whatever stands in it."""
        heading = pose[2] if math.isnan(target[2]) else target[2]
        end = np.array([*target[:2], heading])
        self._pieces, self._part = [(np.array(pose), screw_between(pose, end))], 0.0
        self._target = np.array(target)

    def aim(self, pose: Array) -> tuple[Array, float]:
        """Pose ``(3,)`` that an object at ``(3,)`` is to head for, and how far [m] it is off its
        way."""
        s = self.settings
        off = self._look(pose)
        while len(self._pieces) > 1 and self._away(pose, self._end(0)) < s.corner:
            self._pieces, self._part = self._pieces[1:], 0.0
            off = self._look(pose)
        start, motion = self._pieces[0]
        part = self._part + s.ahead / max(self._length(motion), 1e-9)
        if part < 1.0:
            return screw_poses(start, motion, np.array([part]))[0], off
        return (self._target if len(self._pieces) == 1 else self._end(0)), off

    def left(self, pose: Array) -> float:
        """[m] of way, turns by the object's greatest radius, that an object at ``(3,)`` has."""
        rest = sum(self._length(motion) for _, motion in self._pieces[1:])
        end = self._target if len(self._pieces) == 1 else self._end(0)
        return rest + self._away(pose, end)

    def _look(self, pose: Array) -> float:
        """Where on the piece under way an object is, not before where it was; how far off [m]."""
        start, motion = self._pieces[0]
        parts = np.linspace(self._part, 1.0, _SAMPLES)
        poses = screw_poses(start, motion, parts)
        away = np.array([self._away(pose, p) for p in poses])
        self._part = float(parts[away.argmin()])
        return float(away.min())

    def _end(self, k: int) -> Array:
        start, motion = self._pieces[k]
        end: Array = screw_poses(start, motion, np.ones(1))[0]
        return end

    def _length(self, motion: Array) -> float:
        return float(np.hypot(*motion[:2])) + self._lever * abs(float(motion[2]))

    def _away(self, pose: Array, there: Array) -> float:
        turn = 0.0 if math.isnan(there[2]) else abs(se2.wrap(float(pose[2] - there[2])))
        return math.hypot(pose[0] - there[0], pose[1] - there[1]) + self._lever * turn
