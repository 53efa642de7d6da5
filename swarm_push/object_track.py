"""The path of an object round walls, and the pose on it that the object heads for.

The path is searched in slices, one per control tick, so that no tick is long. Three clearances are
tried, the widest first.
"""

import math
from collections.abc import Iterator

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.distance_field import DistanceField
from push_model.free_space import FreeSpace, Obstacles
from push_model.object_way import NoObjectWay, WayFinder, WaySearch, pieces, warm_up
from push_model.occupancy import OccupancyGrid
from push_model.screws import screw_between, screw_poses
from push_model.settings import bounded, settings

_SAMPLES = 60  # poses of a piece among which an object's place on it is looked for
_PLAN_AGAIN = 2.0  # [s] between searches for a way back onto which the object does not come
_FITS = 16  # headings in which it is tried whether an object fits somewhere


@settings
class TrackSettings:
    """How the object is led round walls and robots that do not move."""

    wide: float = bounded(
        0.2,
        low=0.0,
        high=10.0,
        doc="Preferred clearance of the object's path from walls, in addition to the diameter of a "
        "robot (m). If there is no such path, 'room' is tried next",
    )
    room: float = bounded(
        0.02,
        low=0.0,
        high=1.0,
        doc="Clearance of the object's path from walls, in addition to the diameter of a robot, if "
        "there is no path with the clearance 'wide' (m). If there is no path with this clearance "
        "either, 'least_room' is tried",
    )
    least_room: float = bounded(
        2e-3,
        low=0.0,
        high=1.0,
        doc="Minimum clearance of the object's path from walls, in addition to the diameter of a "
        "robot (m). Without such a path the job fails",
    )
    ahead: float = bounded(
        0.25,
        low=0.01,
        high=10.0,
        doc="Look-ahead distance along the object's path to the pose towards which the swarm "
        "pushes the object (m). A turn counts by the distance that the farthest point of the "
        "object moves",
    )
    corner: float = bounded(
        0.03,
        low=1e-3,
        high=1.0,
        doc="Distance from the end of a piece of the path within which the object continues with "
        "the next piece (m)",
    )
    off: float = bounded(
        0.06,
        low=5e-3,
        high=10.0,
        doc="Distance of the object from its path above which a new path is planned (m)",
    )
    budget: int = bounded(
        2500,
        low=100,
        high=1_000_000,
        doc="Number of poses of the object that are checked per control tick while a path is "
        "planned. One check takes 1 to 3 microseconds, so this number bounds the duration of a "
        "tick; with a greater number the path is found in fewer ticks",
    )


class ObjectTrack:
    """The path of one object, with room for robots of one radius [m].

    under_way: whether there is a way. searching: whether a search is going on. holds: whether the
    object has to wait for its first way. field: distance field of the map.
    """

    def __init__(
        self,
        grid: OccupancyGrid | DistanceField,
        outline: Array,
        radius: float,
        settings: TrackSettings,
    ) -> None:
        """outline: ``(k, 2)`` [m] about the centre of mass."""
        warm_up()
        self.settings, self._space, self._diameter = settings, FreeSpace(grid), 2.0 * radius
        self.field = self._space.field
        self.believe(outline)
        self._target = np.zeros(3)
        self._pieces: list[tuple[Array, Array]] = []
        self._part = 0.0
        self._searches: Iterator[WaySearch] = iter(())
        self._search: WaySearch | None = None
        self._wanted = np.zeros(3)
        self._planned = -math.inf  # [s] when a way was looked for last
        self._others = 0  # that the way leads round, or through if it must
        self._through = self._astray = False

    def believe(self, outline: Array) -> None:
        """Search further ways for another outline ``(k, 2)`` [m] about the centre of mass."""
        self._outline = outline
        self._latest: WayFinder | None = None
        self._lever = float(np.hypot(*outline.T).max())

    @property
    def _finder(self) -> WayFinder:
        """Made when it is first needed: that takes about 10 ms."""
        if self._latest is None:
            self._latest = WayFinder(self._space, self._outline, 0.0)
        return self._latest

    @property
    def under_way(self) -> bool:
        """See the class."""
        return bool(self._pieces)

    @property
    def searching(self) -> bool:
        """See the class."""
        return self._search is not None

    @property
    def holds(self) -> bool:
        """See the class."""
        return self._search is not None and not self._pieces

    def clear(self) -> None:
        """Forget the way, and look for none."""
        self._pieces, self._search = [], None

    def follow(
        self, now: float, pose: Array, target: Array, others: Array, walled: bool
    ) -> tuple[Array, bool]:
        """The pose ``(3,)`` that the object heads for next, and whether its way has just changed.

        A way is searched if there is none, if the object is off its way, or if the number of other
        bodies has changed. Each call does one slice of the search. Until the first way is known the
        target is returned, and ``holds`` is true. If no way leads round all other bodies, they are
        ignored; in a room without walls the straight way is taken.

        Parameters
        ----------
        now: [s]. pose, target: ``(3,)`` of the object; the target's heading may be nan. others:
            ``(k, 3)`` x, y, radius [m] of bodies that stand in the room. walled: whether there are
            walls inside the room.

        Raises
        ------
        NoObjectWay: walls separate the object from its target.
        """
        fresh = False
        if self._search is None:
            anew = not self._pieces or len(others) != self._others
            strayed = not anew and self.aim(pose)[1] > self.settings.off
            if anew or (strayed and now - self._planned > _PLAN_AGAIN):
                self._others, self._planned, self._astray = len(others), now, strayed
                self._through = False
                self.begin(pose, target, others)
        if self._search is not None:
            try:
                fresh = self.search()
            except NoObjectWay:
                if not self._astray:  # else back to the way that there is
                    if walled and (self._through or not self._others):
                        raise
                    fresh = self._make_do(pose, target, walled)
        return (self.aim(pose)[0] if self._pieces else np.array(target)), fresh

    def _make_do(self, pose: Array, target: Array, walled: bool) -> bool:
        """Called if no way leads round all other bodies; returns whether there is a way now."""
        if not walled:  # straight on, and against whoever stands there
            self.go_straight(pose, target)
            return True
        self._through = True
        self.begin(pose, target, np.zeros((0, 3)))
        return False

    def fits(self, pose: Array) -> bool:
        """Whether an object at ``(3,)`` touches no wall; with a heading of nan, in any."""
        headings = np.arange(_FITS) * 2.0 * math.pi / _FITS if math.isnan(pose[2]) else pose[2:]
        poses = np.array([[*pose[:2], h] for h in headings])
        room = self._finder.clearance(poses, Obstacles())
        return bool(room.max() > 0.0)

    def begin(self, pose: Array, target: Array, others: Array) -> None:
        """Begin to search a way from one pose ``(3,)`` to another, whose heading may be nan.

        It leads round bodies ``(k, 3)`` x, y, radius [m]. Call ``search`` to go on. The present way
        stays until the search succeeds.
        """
        s, among = self.settings, Obstacles(discs=np.array(others))
        start, self._wanted = np.array(pose), np.array(target)
        rooms = [self._diameter + spare for spare in (s.wide, s.room, s.least_room)]
        self._searches = (
            self._finder.with_room(room).search(start, self._wanted, among) for room in rooms
        )
        self._search = next(self._searches)

    def search(self, budget: int | None = None) -> bool:
        """Check ``budget`` poses, by default those of one tick; whether the search has succeeded.

        Raises
        ------
        NoObjectWay: there is none. The present way stays.
        """
        assert self._search is not None
        if not self._search.step(budget or self.settings.budget):
            return False
        try:
            way = self._search.way
        except NoObjectWay:
            self._search = next(self._searches, None)
            if self._search is None:
                raise
            return False
        self._search = None
        self._pieces, self._part, self._target = pieces(way), 0.0, self._wanted
        return True

    def plan(self, pose: Array, target: Array, others: Array) -> None:
        """``begin``, and ``search`` to its end, at once.

        Raises
        ------
        NoObjectWay
        """
        self.begin(pose, target, others)
        while not self.search(1 << 20):
            pass

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
