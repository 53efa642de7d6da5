"""What a group does next: a piece of the object's way, who pushes where, and who goes there how.

Planned anew after each piece, from where everybody is: nothing has to go as it was planned before.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from grasp_opt.contact_outline import ContactOutline
from grasp_opt.free_space import FreeSpace, Obstacles
from grasp_opt.group_control import rigid
from grasp_opt.object_trajectory import ObjectTrajectory, screw, screw_poses
from grasp_opt.object_way import NoObjectWay, WayFinder, pieces
from grasp_opt.placement import NoPlacement, Placement, PlacementSettings, robust_placement
from push_model import se2
from push_model.arrays import Array, Mask
from push_model.occupancy import OccupancyGrid
from push_model.settings import bounded, settings
from push_model.specs import ObjectSpec, RobotSpec
from push_model.traction import lift_share, push_force, standing_traction

_MOST = 5  # robots that are placed at once
_ROOMS = (1.0, 0.5, 0.1)  # of the room round the object, one after another
_LOOKED_AT = 6  # poses of a piece at which places are looked at
_BACKS = (1.0, 0.6, 0.3)  # of the way back from a place, where there is less room behind it


@settings
class StepSettings:
    """Room, speeds, and how sure a placement must be."""

    room: float = bounded(0.03, low=0.0, high=1.0, doc="[m] about the object beside a robot's size")
    clearance: float = bounded(0.01, low=0.0, high=1.0, doc="[m] of robots from everything")
    standoff: float = bounded(0.012, low=1e-3, high=0.5, doc="[m] from a place to where it is met")
    back: float = bounded(0.05, low=0.0, high=1.0, doc="[m] straight on at the end of a way there")
    speed: float = bounded(0.05, low=1e-3, high=5.0, doc="[m/s] of the object's farthest point")
    acceleration: float = bounded(0.05, low=1e-3, high=50.0, doc="[m/s^2] likewise")
    force_share: float = bounded(0.85, low=0.1, high=1.0, doc="of its traction that a robot gives")
    margin: float = bounded(0.1, low=0.0, high=1.0, doc="of the compatibility test that is enough")
    longest: float = bounded(1.5, low=0.05, high=100.0, doc="[m] of a piece; then all look again")


class NoStep(Exception):
    """Raised when a group can do nothing; says why."""


class TooFew(NoStep):
    """Raised when so many robots have not the force."""


@dataclass(frozen=True)
class Move:
    """A robot's way: points ``(n, 2)`` [m] with straight lines between, then a heading [rad]; None:
    any."""

    robot: int
    points: Array
    heading: float | None


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
        """item, robot: as believed. placement: weights; a piece is one wrench, so few steps do."""
        self.settings = s = settings or StepSettings()
        self._placement = placement or PlacementSettings(steps=8)
        self._space, self._item, self._robot = FreeSpace(grid), item, robot
        self._outline = ContactOutline(item.geometry)
        self._shape = item.geometry.outline
        self._radius = robot.footprint_radius
        room = 2.0 * self._radius + s.room
        self._finders = [WayFinder(self._space, self._shape, part * room) for part in _ROOMS]
        self._reach = float(np.hypot(*self._shape.T).max())

    @property
    def force(self) -> float:
        """[N] that a robot gives."""
        lift = lift_share(self._robot, self._item)
        return self.settings.force_share * standing_traction(self._robot, lift)

    def check_goal(self, goal: Array) -> None:
        """Raise NoStep for a pose ``(3,)`` of the centre of mass where the object has no room."""
        if float(self._finders[0].clearance(goal, Obstacles())[0]) <= self.settings.clearance:
            raise NoStep("the object does not fit there")

    def plan(
        self, pose: Array, goal: Array, robots: Array, dead: tuple[int, ...], others: Array
    ) -> GroupPlan:
        """The next step towards a goal.

        Parameters
        ----------
        pose, goal ``(3,)``: of the centre of mass. robots ``(n, 3)``: all of them; dead: indices of
            those that stand for ever. others ``(k, 3)``: x, y, radius [m] of further bodies.

        Raises
        ------
        NoStep
        """
        alive = [i for i in range(len(robots)) if i not in dead]
        needed = push_force(self._item)
        if needed > self.force * min(len(alive), _MOST):
            raise TooFew(
                f"the object needs {needed:.2f} N, {len(alive)} robots of "
                f"{self.force:.2f} N have {self.force * len(alive):.2f} N"
            )
        standing = [[*robots[i, :2], self._radius] for i in dead]
        still = np.vstack([np.reshape(standing, (-1, 3)), np.reshape(others, (-1, 3))])
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
        raise why

    def _first(
        self, pose: Array, motion: Array, finder: WayFinder, among: Obstacles
    ) -> list[Array]:
        """The first piece, not too long; else only its translation, only its turn."""
        length = float(np.hypot(*motion[:2]) + self._reach * abs(motion[2]))
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
        poses = screw_poses(pose, motion, np.linspace(0.0, 1.0, _LOOKED_AT))
        twist = motion / np.linalg.norm(motion)
        walls = Obstacles(discs=still)

        def free(way: Array) -> Mask:
            contacts = self._outline.at(way)
            centres = contacts.centres(self._radius)
            ahead = rigid(twist, centres)
            ahead /= np.maximum(1e-9, np.hypot(*ahead.T))[:, None]
            met = se2.transform(pose, centres - (s.standoff + _BACKS[-1] * s.back) * ahead)
            points = np.vstack([met, *(se2.transform(p, centres) for p in poses)])
            room = self._space.room(points, walls).reshape(len(poses) + 1, -1)
            enough: Mask = np.all(room >= self._radius + 0.5 * s.clearance, axis=0)
            return enough

        why: Exception = NoStep("no robots")
        fewest = math.ceil(push_force(self._item) / self.force)
        for count in range(fewest, min(_MOST, len(alive)) + 1):
            try:
                placement = robust_placement(
                    self._item, trajectory, count, self._radius, self.force, self._placement, free
                )
                if placement.margin < s.margin - 1e-9 and count < min(_MOST, len(alive)):
                    why = NoStep("too little margin")
                    continue
                return self._with_moves(
                    pose, placement, trajectory, poses, robots, alive, still, left
                )
            except NoPlacement as error:
                why = NoStep(str(error))
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
        moving = int(np.argmax(np.linalg.norm(trajectory.body_twists, axis=1) > 0.0))
        ahead = rigid(trajectory.body_twists[moving], centres)
        ahead /= np.hypot(*ahead.T)[:, None]
        met = se2.transform(pose, centres - s.standoff * ahead)
        headings = pose[2] + np.arctan2(ahead[:, 1], ahead[:, 0])
        places = np.column_stack([met, headings])
        outline = se2.transform(pose, self._shape)
        walls = Obstacles((outline,), still)
        marshal = _Marshal(self._space, self._radius, s, walls, robots, alive)
        pushers = marshal.assign(places)
        swept = np.vstack([se2.transform(p, centres) for p in poses])
        marshal.clear(pushers, [se2.transform(p, self._shape) for p in poses], swept)
        marshal.send(pushers, places)
        return GroupPlan(pushers, placement, trajectory, marshal.batches(), left)


class _Marshal:
    """Finds who goes where, in which order and how."""

    def __init__(
        self,
        space: FreeSpace,
        radius: float,
        settings: StepSettings,
        walls: Obstacles,
        robots: Array,
        alive: list[int],
    ) -> None:
        self._space, self._radius, self._settings = space, radius, settings
        self._walls, self._alive = walls, alive
        self._at = {i: np.array(robots[i, :2]) for i in alive}
        self._need = radius + settings.clearance
        self._moves: list[Move] = []
        self._asides: dict[int, int] = {}  # how often a robot went aside

    def _among(self, robot: int) -> Obstacles:
        """What stands in a robot's way: everything, and the others where they are by then."""
        discs = [[*self._at[i], self._radius] for i in self._alive if i != robot]
        return Obstacles(
            self._walls.outlines, np.vstack([self._walls.discs, np.reshape(discs, (-1, 3))])
        )

    def assign(self, places: Array) -> tuple[int, ...]:
        """Which robot takes each place: the least sum of ways round what stands still."""
        cost = np.full((len(self._alive), len(places)), 1e3)
        for k, robot in enumerate(self._alive):
            reach = self._space.from_here(self._at[robot], self._need, self._walls)
            for j, place in enumerate(places):
                way = reach.way_to(self._before(place, self._settings.back))
                if way is not None:
                    cost[k, j] = float(np.hypot(*np.diff(way, axis=0).T).sum())
        rows, columns = linear_sum_assignment(cost)
        chosen = dict(zip(columns.tolist(), rows.tolist(), strict=True))
        return tuple(self._alive[chosen[j]] for j in range(len(places)))

    @staticmethod
    def _before(place: Array, back: float) -> Array:
        """``(2,)`` so far straight behind a place ``(3,)``."""
        return np.array(place[:2]) - back * np.array([math.cos(place[2]), math.sin(place[2])])

    def clear(self, pushers: tuple[int, ...], outlines: list[Array], swept: Array) -> None:
        """Send those who do not push out of the way of object and pushers, if they are in it."""
        for robot in self._alive:
            if robot in pushers:
                continue
            here = self._at[robot][None]
            if self._out_of_the_way(here, outlines, swept)[0]:
                continue
            self._park(robot, outlines, swept)

    def _out_of_the_way(self, points: Array, outlines: list[Array], swept: Array) -> Mask:
        away = self._space.room(points, Obstacles(tuple(outlines)))
        others = np.min([np.hypot(*(points - p).T) for p in swept], axis=0)
        clear: Mask = (away >= 3.0 * self._need) & (others >= 4.0 * self._need)
        return clear

    def _park(self, robot: int, outlines: list[Array], swept: Array) -> bool:
        reach = self._space.from_here(self._at[robot], self._need, self._among(robot))
        good = np.isfinite(reach.lengths)
        good[good] = self._out_of_the_way(self._space.places[good], outlines, swept)
        if not good.any():
            return False
        place = int(np.argmin(np.where(good, reach.lengths, np.inf)))
        self._go(Move(robot, reach.way_to_place(place), None))
        return True

    def _go(self, move: Move) -> None:
        self._moves.append(move)
        self._at[move.robot] = move.points[-1]

    def send(self, pushers: tuple[int, ...], places: Array) -> None:
        """Ways to the places, one after the other; who stands in the way of all others goes aside.

        Raises
        ------
        NoStep: somebody has no way.
        """
        to_go = dict(zip(pushers, places, strict=True))
        asides = 2 * len(to_go)
        while to_go:
            gone = [robot for robot, place in to_go.items() if self._try(robot, place)]
            for robot in gone:
                del to_go[robot]
            if gone:
                continue
            asides -= 1
            blockers = sorted(to_go, key=lambda r: self._asides.get(r, 0))
            outline = list(self._walls.outlines)
            if asides < 0 or not any(
                self._park(r, outline, np.array([p[:2] for p in places])) for r in blockers[:1]
            ):
                raise NoStep("robots stand in each other's way to their places")
            self._asides[blockers[0]] = self._asides.get(blockers[0], 0) + 1

    def _try(self, robot: int, place: Array) -> bool:
        among = self._among(robot)
        reach = self._space.from_here(self._at[robot], self._need, among)
        for part in _BACKS:
            before = self._before(place, part * self._settings.back)
            last = self._space.line_keeps(before, place[:2], self._radius + 2e-3, among)
            room = float(self._space.room(np.array([before, place[:2]]), among).min())
            if not last or room < self._radius + 1e-3:
                continue
            way = reach.way_to(before)
            if way is not None:
                self._go(Move(robot, np.vstack([way, place[:2]]), float(place[2])))
                return True
        return False

    def batches(self) -> tuple[tuple[Move, ...], ...]:
        """Moves one after the other, or together where they keep clear of each other."""
        found: list[list[Move]] = []
        for move in self._moves:
            together = found and all(self._apart(move, other) for other in found[-1])
            if together:
                found[-1].append(move)
            else:
                found.append([move])
        return tuple(tuple(batch) for batch in found)

    def _apart(self, first: Move, second: Move) -> bool:
        if first.robot == second.robot:
            return False
        a, b = _dense(first.points), _dense(second.points)
        gap = np.hypot(a[:, None, 0] - b[None, :, 0], a[:, None, 1] - b[None, :, 1]).min()
        return bool(gap >= 2.0 * self._radius + 2.0 * self._settings.clearance)


def _dense(points: Array) -> Array:
    parts = [points[:1]]
    for a, b in zip(points[:-1], points[1:], strict=True):
        steps = max(2, math.ceil(float(np.hypot(*(b - a))) / 0.02) + 1)
        parts.append(a + np.linspace(0.0, 1.0, steps)[1:, None] * (b - a))
    return np.vstack(parts)
