"""What a group does next: a piece of the object's way, who pushes where, and who goes there how.

Planned anew after each piece, from where everybody is: nothing has to go as it was planned before.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from grasp_opt.contact_outline import ContactOutline
from grasp_opt.object_trajectory import ObjectTrajectory, screw
from grasp_opt.placement import (
    NoPlacement,
    Placement,
    PlacementSettings,
    Placer,
    robust_placement,
)
from grasp_opt.sequencing import LEAST_BACK, Move, NoStep, Sequencer, standoffs
from push_model import se2
from push_model.arrays import Array, Mask
from push_model.free_space import FreeSpace, Obstacles
from push_model.object_way import NoObjectWay, WayFinder, pieces
from push_model.occupancy import OccupancyGrid
from push_model.screws import point_velocities, screw_between, screw_poses
from push_model.settings import bounded, settings
from push_model.specs import ObjectSpec, RobotSpec
from push_model.traction import lift_share, push_force, standing_traction

_MOST = 5  # robots that are placed at once
_ROOMS = (1.0, 0.5, 0.1)  # of the room round the object, one after another
_LOOKED_AT = 0.04  # [m] between poses of a piece at which places are looked at
_TWISTS = 60  # that are tried for detours
_LENGTHS = (0.15, 0.3, 0.6, 1.0)  # [m] of their first pieces
_DETOURS = 5  # of which the shortest is taken
_ESCAPES = 12  # motions that are tried when there is none
_SURE = 0.05  # of margin with which a detour must be held
_SEED = 1
_PARTS = (1.0, 0.75, 0.5, 0.35, 0.25, 0.15, 0.08)  # of a trajectory that no placement holds whole


@settings
class StepSettings:
    """Room, speeds, and how sure a placement must be."""

    room: float = bounded(0.03, low=0.0, high=1.0, doc="[m] about the object beside a robot's size")
    clearance: float = bounded(0.01, low=0.0, high=1.0, doc="[m] of robots from everything")
    gap: float = bounded(0.015, low=0.0, high=1.0, doc="[m] between robots that push a piece")
    standoff: float = bounded(0.012, low=1e-3, high=0.5, doc="[m] from a place to where it is met")
    back: float = bounded(0.05, low=0.0, high=1.0, doc="[m] straight on at the end of a way there")
    speed: float = bounded(0.05, low=1e-3, high=5.0, doc="[m/s] of the object's farthest point")
    acceleration: float = bounded(0.05, low=1e-3, high=50.0, doc="[m/s^2] likewise")
    force_share: float = bounded(0.85, low=0.1, high=1.0, doc="of its traction that a robot gives")
    margin: float = bounded(0.1, low=0.0, high=1.0, doc="of the compatibility test that is enough")
    steps: int = bounded(8, low=5, high=1000, doc="N of (3.16) for a piece, which is one wrench")
    longest: float = bounded(1.5, low=0.05, high=100.0, doc="[m] of a piece; then all look again")


class TooFew(NoStep):
    """Raised when so many robots have not the force."""


@dataclass(frozen=True)
class GroupPlan:
    """The next step.

    pushers ``(n,)``: indices of robots in the order of ``way (n,)`` [m] along the outline;
    trajectory: of the centre of mass; placement: of the pushers; batches: moves that are made at
    the same time, one batch after the other; left: pieces of the way, this one included.
    """

    pushers: tuple[int, ...]
    placement: Placement
    trajectory: ObjectTrajectory
    batches: tuple[tuple[Move, ...], ...]
    left: int


class StepPlanner:
    """Plans for one object and robots of one type on one map."""

    def __init__(
        self,
        grid: OccupancyGrid,
        item: ObjectSpec,
        robot: RobotSpec,
        settings: StepSettings | None = None,
        placement: PlacementSettings | None = None,
    ) -> None:
        """item, robot: as believed. placement: of trajectories that are given; pieces of the way
        to a goal have fewer steps."""
        self.settings = s = settings or StepSettings()
        self._weights = placement or PlacementSettings()
        self._placement = replace(self._weights, steps=s.steps, gap=s.gap)
        self._space, self._item, self._robot = FreeSpace(grid), item, robot
        self._outline = ContactOutline(item.geometry)
        self._shape = item.geometry.outline
        self._radius = robot.footprint_radius
        room = 2.0 * self._radius + s.room
        finder = WayFinder(self._space, self._shape, room)
        self._finders = [finder.with_room(part * room) for part in _ROOMS]
        self._reach = float(np.hypot(*self._shape.T).max())
        self._known: dict[int, list[Array]] = {}  # by the number of robots
        self._fewest = 0  # of the plan under way

    @property
    def force(self) -> float:
        """[N] that a robot gives."""
        lift = lift_share(self._robot, self._item)
        return self.settings.force_share * standing_traction(self._robot, lift)

    def plan(
        self,
        pose: Array,
        goal: Array,
        robots: Array,
        dead: tuple[int, ...],
        others: Array,
        fewest: int = 0,
    ) -> GroupPlan:
        """The next step towards a goal.

        Parameters
        ----------
        pose, goal ``(3,)``: of the centre of mass. robots ``(n, 3)``: all of them; dead: indices of
            those that stand for ever. others ``(k, 3)``: x, y, radius [m] of further bodies.
            fewest: robots that push at least, as far as there are so many.

        Raises
        ------
        NoStep
        """
        alive = [i for i in range(len(robots)) if i not in dead]
        self._fewest = fewest
        self._least(len(alive))
        still = self._still(robots, dead, others)
        why: Exception = NoStep("there is no way for the object")
        for finder in self._finders:
            # What stands beside the object is a little smaller: they may touch.
            thin = np.column_stack([still[:, :2], np.maximum(0.0, still[:, 2] - 8e-3)])
            try:
                way = pieces(finder.way(pose, goal, Obstacles(discs=thin)))
            except NoObjectWay as error:
                why = NoStep(str(error))
                continue
            for motion in self._first(*way[0], finder, Obstacles(discs=thin)):
                try:
                    return self._step(pose, motion, robots, alive, still, len(way))
                except NoStep as error:
                    why = error
            for motion in self._detours(*way[0], finder, Obstacles(discs=thin), len(alive)):
                try:
                    return self._step(pose, motion, robots, alive, still, len(way) + 1)
                except NoStep as error:
                    why = error
        raise why

    def along(
        self,
        trajectory: ObjectTrajectory,
        pose: Array,
        robots: Array,
        dead: tuple[int, ...],
        others: Array,
        fewest: int = 0,
    ) -> GroupPlan:
        """Places and moves for a push along a trajectory that somebody gives; see ``plan``.

        Where no placement holds all of it, it is of the first part that one holds: there the
        robots change places, and ``left`` is 2.

        Raises
        ------
        NoStep: also when the object does not keep clear of everything on it.
        """
        alive = [i for i in range(len(robots)) if i not in dead]
        self._fewest = fewest
        self._least(len(alive))
        still = self._still(robots, dead, others)
        reach = self._reach + self._radius
        count = max(2, math.ceil((trajectory.length + _turned(trajectory) * reach) / _LOOKED_AT))
        times = np.linspace(0.0, trajectory.duration, count)
        poses = np.array([trajectory.sample(t) for t in times])
        room = self._finders[0].clearance(poses, Obstacles(discs=still))
        if room.min() < self.settings.clearance:
            k = int(np.argmin(room))
            raise NoStep(f"the object is too close to something {times[k]:.1f} s along its way")
        why: Exception = NoStep("it has no length")
        for part in _PARTS:
            end = part * trajectory.duration
            task = trajectory if part == 1.0 else trajectory.between(0.0, end)
            left = 1 if part == 1.0 else 2
            way = poses[times <= end + 1e-9]
            try:
                return self._push(pose, task, way, self._weights, robots, alive, still, left)
            except NoStep as error:
                why = error if part == 1.0 else why
        raise why

    def taking(
        self, way: Array, trajectory: ObjectTrajectory, pose: Array, robots: Array
    ) -> GroupPlan:
        """Moves to places ``(n,)`` [m] along the outline that somebody has chosen, for a push along
        a trajectory; nobody is dead.

        Raises
        ------
        NoStep: robots do not get there.
        """
        placer = Placer(self._item, trajectory, len(way), self._radius, self._weights)
        ends = np.array([trajectory.pose[0], trajectory.pose[-1]])
        nobody, everybody = np.zeros((0, 3)), list(range(len(robots)))
        placed = placer.placement(way)
        return self._with_moves(pose, placed, trajectory, ends, robots, everybody, nobody, 1)

    def _least(self, alive: int) -> int:
        """How many robots have the force together; raises TooFew where so many alive have not."""
        needed = push_force(self._item)
        if needed > self.force * min(alive, _MOST):
            raise TooFew(
                f"the object needs {needed:.2f} N, {alive} robots of "
                f"{self.force:.2f} N have {self.force * alive:.2f} N"
            )
        return math.ceil(needed / self.force)

    def _still(self, robots: Array, dead: tuple[int, ...], others: Array) -> Array:
        """``(k, 3)`` discs that stand in the way for ever."""
        standing = [[*robots[i, :2], self._radius] for i in dead]
        return np.vstack([np.reshape(standing, (-1, 3)), np.reshape(others, (-1, 3))])

    def _detours(
        self, pose: Array, motion: Array, finder: WayFinder, among: Obstacles, alive: int
    ) -> list[Array]:
        """First motions for a piece that robots cannot hold: those that they can, after which they
        can hold what is left, the shortest first; and then whatever leads nearer to its end."""
        count = min(_MOST, alive)
        end = screw_poses(pose, motion, np.ones(1))[0]
        found: list[tuple[float, Array]] = []
        escapes: list[tuple[float, Array]] = []
        random = np.random.default_rng(_SEED)
        twists = self._holdable(count)
        ways = [length * twist for twist in twists for length in _LENGTHS]
        for k in random.permutation(len(ways)):
            first = ways[k]
            if not finder.keeps(pose, first, among):
                continue
            there = screw_poses(pose, first, np.ones(1))[0]
            rest = screw_between(there, end)
            escapes.append((self._size(rest), first))
            if finder.keeps(there, rest, among) and self._can_hold(rest, count):
                found.append((self._size(first) + self._size(rest), first))
                if len(found) == _DETOURS:
                    break
        tried = [
            [first for _, first in sorted(some, key=lambda pair: pair[0])[:most]]
            for some, most in ((found, _DETOURS), (escapes, _ESCAPES))
        ]
        return [*tried[0], *tried[1]]

    def _size(self, motion: Array) -> float:
        return float(np.hypot(*motion[:2]) + self._reach * abs(motion[2]))

    def _holdable(self, count: int) -> list[Array]:
        """Twists of unit size that so many robots can hold, of many in all directions."""
        if count not in self._known:
            random = np.random.default_rng(_SEED)
            drawn = random.normal(size=(_TWISTS, 3)) / [1.0, 1.0, self._reach]
            twists = [t / self._size(t) for t in drawn]
            self._known[count] = [t for t in twists if self._can_hold(t, count)]
        return self._known[count]

    def _can_hold(self, motion: Array, count: int) -> bool:
        """Whether so many robots hold a motion from somewhere, were there nothing else."""
        s = self.settings
        task = screw(np.zeros(3), motion, s.speed, s.acceleration, self._reach)
        asked = replace(
            self._placement, least_margin=_SURE, only_pushing=True, most_force=self.force
        )
        return Placer(self._item, task, count, self._radius, asked).exists()

    def _first(
        self, pose: Array, motion: Array, finder: WayFinder, among: Obstacles
    ) -> list[Array]:
        """The first piece, not too long; else only its translation, only its turn."""
        length = self._size(motion)
        motion = motion * min(1.0, self.settings.longest / length)
        end = se2.between(pose, screw_poses(pose, motion, np.ones(1))[0])
        turns = [np.array([0.0, 0.0, end[2]])] if abs(end[2]) > 0.05 else []
        ways = [np.array([end[0], end[1], 0.0])] if np.hypot(*end[:2]) > 0.01 else []
        parts = [*ways, *turns] if turns and ways else []
        parts += [0.5 * motion] if length > 0.2 else []
        return [motion, *(p for p in parts if finder.keeps(pose, p, among))]

    def _step(
        self, pose: Array, motion: Array, robots: Array, alive: list[int], still: Array, left: int
    ) -> GroupPlan:
        s = self.settings
        trajectory = screw(pose, motion, s.speed, s.acceleration, self._reach + self._radius)
        looks = max(2, math.ceil(self._size(motion) / _LOOKED_AT) + 1)
        poses = screw_poses(pose, motion, np.linspace(0.0, 1.0, looks))
        return self._push(pose, trajectory, poses, self._placement, robots, alive, still, left)

    def _push(
        self,
        pose: Array,
        trajectory: ObjectTrajectory,
        poses: Array,
        weights: PlacementSettings,
        robots: Array,
        alive: list[int],
        still: Array,
        left: int,
    ) -> GroupPlan:
        """The fewest robots that hold a trajectory well enough, with their places and moves."""
        s, twist = self.settings, trajectory.first_twist
        walls = Obstacles(discs=still)

        def free(way: Array) -> Mask:
            contacts = self._outline.at(way)
            centres = contacts.centres(self._radius)
            ahead = point_velocities(twist, centres)
            ahead /= np.maximum(1e-9, np.hypot(*ahead.T))[:, None]
            off = standoffs(contacts.normals, ahead, s.standoff) + LEAST_BACK * s.back
            met = se2.transform(pose, centres - off * ahead)
            points = np.vstack([met, *(se2.transform(p, centres) for p in poses)])
            room = self._space.room(points, walls).reshape(len(poses) + 1, -1)
            enough: Mask = np.all(room >= self._radius + 0.5 * s.clearance, axis=0)
            return enough

        why: Exception = NoStep("no robots")
        most, least = min(_MOST, len(alive)), self._least(len(alive))
        fewest = min(most, max(self._fewest, least))
        doubtful: list[Placement] = []
        for count in (*range(fewest, most + 1), *range(fewest - 1, least - 1, -1)):
            try:
                placement = robust_placement(
                    self._item, trajectory, count, self._radius, self.force, weights, free
                )
                if placement.margin < s.margin - 1e-9:
                    doubtful.append(placement)
                    continue
                return self._with_moves(
                    pose, placement, trajectory, poses, robots, alive, still, left
                )
            except NoPlacement as error:
                why = NoStep(str(error))
            except NoStep as error:
                why = error
        for placement in sorted(doubtful, key=lambda p: -p.margin):
            try:
                return self._with_moves(
                    pose, placement, trajectory, poses, robots, alive, still, left
                )
            except NoStep as error:
                why = error
        raise NoStep(str(why))

    def _with_moves(
        self,
        pose: Array,
        placement: Placement,
        trajectory: ObjectTrajectory,
        poses: Array,
        robots: Array,
        alive: list[int],
        still: Array,
        left: int,
    ) -> GroupPlan:
        s, centres = self.settings, placement.contacts.centres(self._radius)
        ahead = point_velocities(trajectory.first_twist, centres)
        ahead /= np.hypot(*ahead.T)[:, None]
        normals = placement.contacts.normals
        met = se2.transform(pose, centres - standoffs(normals, ahead, s.standoff) * ahead)
        headings = pose[2] + np.arctan2(ahead[:, 1], ahead[:, 0])
        places = np.column_stack([met, headings])
        outline = se2.transform(pose, self._shape)
        walls = Obstacles((outline,), still)
        sequencer = Sequencer(self._space, self._radius, s.clearance, s.back, walls, robots, alive)
        pushers = sequencer.assign(places)
        swept = np.vstack([se2.transform(p, centres) for p in poses])
        sequencer.clear(pushers, [se2.transform(p, self._shape) for p in poses], swept)
        sequencer.send(pushers, places)
        return GroupPlan(pushers, placement, trajectory, sequencer.batches(), left)


def _turned(trajectory: ObjectTrajectory) -> float:
    return float(np.abs(np.diff(trajectory.pose[:, 2])).sum())
