"""Plans one step of a group: a piece of the object's path, the placement, and the robots' paths.

Each step is planned from the present poses, so it does not depend on the success of the last one.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from grasp_opt.contact_outline import ContactOutline
from grasp_opt.detours import Detours, Holding, size
from grasp_opt.grasp_certificate import GraspCertificate
from grasp_opt.object_trajectory import ObjectTrajectory, screw
from grasp_opt.placement import (
    NoPlacement,
    Placement,
    PlacementSettings,
    Placer,
)
from grasp_opt.robust_placement import robust_search
from grasp_opt.sequencing import LEAST_BACK, Move, NoStep, Sequencer, standoffs
from grasp_opt.slices import Work, finish
from grasp_opt.step_settings import StepSettings
from push_model import se2
from push_model.arrays import Array, Mask
from push_model.free_space import FreeSpace, Obstacles
from push_model.object_way import NoObjectWay, WayFinder, pieces
from push_model.occupancy import OccupancyGrid
from push_model.screws import point_velocities, screw_poses
from push_model.specs import ObjectSpec, RobotSpec
from push_model.stick_certificate import ContactBelief
from push_model.traction import lift_share, push_force, standing_traction

_MOST = 5  # robots that are placed at once
_ROOMS = (1.0, 0.5, 0.1)  # of the room round the object, one after another
_POSES = 20_000  # that a slice of the search for the object's way checks, 20 to 60 ms
_STILL = 1e-9  # [m] of a motion that is none
_LOOKED_AT = 0.04  # [m] between poses of a piece at which places are looked at
_PARTS = (1.0, 0.75, 0.5, 0.35, 0.25, 0.15, 0.08)  # of a trajectory that no placement holds whole


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


@dataclass(frozen=True)
class Scene:
    """Where everybody is when a step is planned.

    pose ``(3,)``: of the object's centre of mass. robots ``(n, 3)``: all of them. dead: indices of
    those that do not move. others ``(k, 3)``: x, y, radius [m] of further bodies. fewest: robots
    that must push at least, as far as there are so many.
    """

    pose: Array
    robots: Array
    dead: tuple[int, ...]
    others: Array
    fewest: int = 0

    @property
    def alive(self) -> list[int]:
        """Indices of robots that move."""
        return [i for i in range(len(self.robots)) if i not in self.dead]

    def still(self, radius: float) -> Array:
        """``(k, 3)`` x, y, radius [m] of everything that stands in the way for ever; radius: of the
        robots."""
        standing = [[*self.robots[i, :2], radius] for i in self.dead]
        return np.vstack([np.reshape(standing, (-1, 3)), np.reshape(self.others, (-1, 3))])


@dataclass(frozen=True)
class _Piece:
    """A push: its trajectory, poses ``(k, 3)`` on it at which room is looked at, and pieces of the
    way, this one included."""

    trajectory: ObjectTrajectory
    poses: Array
    left: int


class StepPlanner:
    """Plans for one object and robots of one type on one map.

    ``planning`` and ``planning_along`` do the work in slices; ``plan`` and ``along`` do it at once.
    """

    def __init__(
        self,
        grid: OccupancyGrid,
        item: ObjectSpec,
        robot: RobotSpec,
        settings: StepSettings | None = None,
        placement: PlacementSettings | None = None,
        believed: ContactBelief | None = None,
    ) -> None:
        """item, robot: as believed. placement: of trajectories that are given; pieces of the way
        to a goal have fewer steps. believed: intervals, if anything uncertain is believed."""
        self.settings = s = settings or StepSettings()
        self._weights = placement or PlacementSettings()
        self._placement = replace(self._weights, steps=s.steps, gap=s.gap)
        self._space, self._item, self._robot = FreeSpace(grid), item, robot
        self._believed = believed
        self._outline = ContactOutline(item.geometry)
        self._shape = item.geometry.outline
        self._radius = robot.footprint_radius
        room = 2.0 * self._radius + s.room
        finder = WayFinder(self._space, self._shape, room)
        self._finders = [finder.with_room(part * room) for part in _ROOMS]
        self._reach = float(np.hypot(*self._shape.T).max())
        holding = Holding(
            item, self._radius, self._reach, s.speed, s.acceleration, self.force, self._placement
        )
        self._detours = Detours(holding)

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
        """``planning`` at once; arguments as of ``Scene``."""
        return finish(self.planning(Scene(pose, robots, dead, others, fewest), goal))

    def along(
        self,
        trajectory: ObjectTrajectory,
        pose: Array,
        robots: Array,
        dead: tuple[int, ...],
        others: Array,
        fewest: int = 0,
    ) -> GroupPlan:
        """``planning_along`` at once; arguments as of ``Scene``."""
        return finish(self.planning_along(Scene(pose, robots, dead, others, fewest), trajectory))

    def planning(self, scene: Scene, goal: Array) -> Work[GroupPlan]:
        """The next step towards a goal ``(3,)`` of the centre of mass, in slices.

        Raises
        ------
        NoStep
        """
        count = len(scene.alive)
        self._least(count)
        still = scene.still(self._radius)
        # What stands beside the object is a little smaller: they may touch.
        thin = np.column_stack([still[:, :2], np.maximum(0.0, still[:, 2] - 8e-3)])
        among = Obstacles(discs=thin)
        why: Exception = NoStep("there is no way for the object")
        for finder in self._finders:
            yield
            search = finder.search(scene.pose, goal, among)
            while not search.step(_POSES):
                yield
            try:
                way = pieces(search.way)
            except NoObjectWay as error:
                why = NoStep(str(error))
                continue
            yield
            for motion in self._first(*way[0], finder, among):
                try:
                    return (yield from self._step(scene, motion, len(way)))
                except NoStep as error:
                    why = error
            detours = yield from self._detours.around(*way[0], finder, among, min(_MOST, count))
            for motion in detours:
                try:
                    return (yield from self._step(scene, motion, len(way) + 1))
                except NoStep as error:
                    why = error
        raise why

    def planning_along(self, scene: Scene, trajectory: ObjectTrajectory) -> Work[GroupPlan]:
        """Places and moves for a push along a trajectory that somebody gives, in slices.

        Where no placement holds all of it, it is of the first part that one holds: there the
        robots change places, and ``left`` is 2.

        Raises
        ------
        NoStep: also when the object does not keep clear of everything on it.
        """
        self._least(len(scene.alive))
        if trajectory.still:
            raise NoStep("the trajectory does not move the object")
        reach = self._reach + self._radius
        count = max(2, math.ceil((trajectory.length + _turned(trajectory) * reach) / _LOOKED_AT))
        times = np.linspace(0.0, trajectory.duration, count)
        poses = np.array([trajectory.sample(t) for t in times])
        room = self._finders[0].clearance(poses, Obstacles(discs=scene.still(self._radius)))
        if room.min() < self.settings.clearance:
            k = int(np.argmin(room))
            raise NoStep(f"the object is too close to an obstacle {times[k]:.1f} s along its way")
        why: Exception = NoStep("the trajectory has no length")
        for part in _PARTS:
            end = part * trajectory.duration
            task = trajectory if part == 1.0 else trajectory.between(0.0, end)
            piece = _Piece(task, poses[times <= end + 1e-9], 1 if part == 1.0 else 2)
            try:
                return (yield from self._push(scene, piece, self._weights))
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
        scene = Scene(pose, robots, (), np.zeros((0, 3)))
        piece = _Piece(trajectory, ends, 1)
        return finish(self._with_moves(scene, piece, placer.placement(way)))

    def _least(self, alive: int) -> int:
        """How many robots have the force together; raises TooFew where so many alive have not."""
        needed = push_force(self._item)
        if needed > self.force * min(alive, _MOST):
            raise TooFew(
                f"the object needs {needed:.2f} N, {alive} robots of "
                f"{self.force:.2f} N have {self.force * alive:.2f} N"
            )
        return math.ceil(needed / self.force)

    def _first(
        self, pose: Array, motion: Array, finder: WayFinder, among: Obstacles
    ) -> list[Array]:
        """The first piece, not too long; else only its translation, only its turn."""
        length = size(motion, self._reach)
        if length <= _STILL:
            raise NoStep("the object is at the goal already")
        motion = motion * min(1.0, self.settings.longest / length)
        end = se2.between(pose, screw_poses(pose, motion, np.ones(1))[0])
        turns = [np.array([0.0, 0.0, end[2]])] if abs(end[2]) > 0.05 else []
        ways = [np.array([end[0], end[1], 0.0])] if np.hypot(*end[:2]) > 0.01 else []
        parts = [*ways, *turns] if turns and ways else []
        parts += [0.5 * motion] if length > 0.2 else []
        return [motion, *(p for p in parts if finder.keeps(pose, p, among))]

    def _step(self, scene: Scene, motion: Array, left: int) -> Work[GroupPlan]:
        """A push by one motion ``(3,)``."""
        s, reach = self.settings, self._reach + self._radius
        trajectory = screw(scene.pose, motion, s.speed, s.acceleration, reach)
        looks = max(2, math.ceil(size(motion, self._reach) / _LOOKED_AT) + 1)
        poses = screw_poses(scene.pose, motion, np.linspace(0.0, 1.0, looks))
        piece = _Piece(trajectory, poses, left)
        return (yield from self._push(scene, piece, self._placement))

    def _push(self, scene: Scene, piece: _Piece, weights: PlacementSettings) -> Work[GroupPlan]:
        """The fewest robots that hold a trajectory well enough, with their places and moves."""
        s, alive = self.settings, len(scene.alive)

        def free(way: Array) -> Mask:
            return self._free(scene, piece, way)

        why: Exception = NoStep("no robots")
        most, least = min(_MOST, alive), self._least(alive)
        fewest = min(most, max(scene.fewest, least))
        doubtful: list[Placement] = []
        for count in (*range(fewest, most + 1), *range(fewest - 1, least - 1, -1)):
            try:
                placement = yield from robust_search(
                    *(self._item, piece.trajectory, count, self._radius, self.force, weights),
                    *(free, self._believed, s.margin),
                )
                if placement.margin < s.margin - 1e-9 and not self._certain(placement, piece):
                    doubtful.append(placement)
                    continue
                return (yield from self._with_moves(scene, piece, placement))
            except NoPlacement as error:
                why = NoStep(str(error))
            except NoStep as error:
                why = error
        for placement in sorted(doubtful, key=lambda p: -p.margin):
            try:
                return (yield from self._with_moves(scene, piece, placement))
            except NoStep as error:
                why = error
        raise NoStep(str(why))

    def _certain(self, placement: Placement, piece: _Piece) -> bool:
        """Whether a placement holds its task for all that is believed."""
        if self._believed is None:
            return False
        certificate = GraspCertificate(self._item, self._believed, piece.trajectory.body_twists)
        return certificate.margin(placement.contacts) >= 0.0

    def _free(self, scene: Scene, piece: _Piece, way: Array) -> Mask:
        """Where along the outline, of ways ``(n,)`` [m], a robot has room all along a push, and on
        the last part of its way to the place."""
        s, contacts = self.settings, self._outline.at(way)
        centres = contacts.centres(self._radius)
        ahead = point_velocities(piece.trajectory.first_twist, centres)
        ahead /= np.maximum(1e-9, np.hypot(*ahead.T))[:, None]
        off = standoffs(contacts.normals, ahead, s.standoff) + LEAST_BACK * s.back
        met = se2.transform(scene.pose, centres - off * ahead)
        points = np.vstack([met, *(se2.transform(p, centres) for p in piece.poses)])
        walls = Obstacles(discs=scene.still(self._radius))
        room = self._space.room(points, walls).reshape(len(piece.poses) + 1, -1)
        enough: Mask = np.all(room >= self._radius + 0.5 * s.clearance, axis=0)
        return enough

    def _with_moves(self, scene: Scene, piece: _Piece, placement: Placement) -> Work[GroupPlan]:
        """The plan of a push from known places: who goes to which of them, and how.

        Robots stop equally far before their places, so that they keep side by side when they come
        to the object; those at slanting contacts need most. Where there is no room for that, each
        stops as near as its contact allows.
        """
        centres, normals = placement.contacts.centres(self._radius), placement.contacts.normals
        ahead = point_velocities(piece.trajectory.first_twist, centres)
        ahead /= np.hypot(*ahead.T)[:, None]
        own = standoffs(normals, ahead, self.settings.standoff)
        try:
            away = np.full_like(own, own.max())
            return (yield from self._moves(scene, piece, placement, ahead, away))
        except NoStep:
            return (yield from self._moves(scene, piece, placement, ahead, own))

    def _moves(
        self, scene: Scene, piece: _Piece, placement: Placement, ahead: Array, away: Array
    ) -> Work[GroupPlan]:
        """``_with_moves`` from so far ``(n, 1)`` [m] before the places, against directions ``(n,
        2)`` ahead in the object's frame."""
        s, pose, centres = self.settings, scene.pose, placement.contacts.centres(self._radius)
        met = se2.transform(pose, centres - away * ahead)
        headings = pose[2] + np.arctan2(ahead[:, 1], ahead[:, 0])
        places = np.column_stack([met, headings])
        outline = se2.transform(pose, self._shape)
        walls = Obstacles((outline,), scene.still(self._radius))
        sequencer = Sequencer(
            self._space, self._radius, s.clearance, s.back, walls, scene.robots, scene.alive
        )
        pushers = yield from sequencer.assign(places)
        swept = np.vstack([se2.transform(p, centres) for p in piece.poses])
        outlines = [se2.transform(p, self._shape) for p in piece.poses]
        yield from sequencer.clear(pushers, outlines, swept)
        yield from sequencer.send(pushers, places)
        batches = sequencer.batches()
        return GroupPlan(pushers, placement, piece.trajectory, batches, piece.left)


def _turned(trajectory: ObjectTrajectory) -> float:
    return float(np.abs(np.diff(trajectory.pose[:, 2])).sum())
