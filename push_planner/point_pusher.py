"""Bring an object to a pose with a disc: which pushes, and each of them under control. No ROS.

*Planning.* Pushes start beside the outline, at any of many places, in a few directions and lengths.
All of them are simulated (``push_model.point_push``); the best ones are each followed by a second
push, and the disc's way to the start of the first counts. *Control.* While it pushes, the disc's
next target is chosen anew at every frame from a fan of targets, by the same model: a predictive
controller by enumeration. A push ends when no target brings the object nearer.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.free_space import FreeSpace, Obstacles
from push_model.occupancy import OccupancyGrid
from push_model.point_push import Disc, Pushed, body, gap, placed, push
from push_model.se2 import transform
from push_model.settings import bounded, settings


@settings
class PointPushSettings:
    """Lengths, and costs, which are lengths, are in radii of the disc."""

    spacing: float = bounded(
        0.4, low=0.05, high=5.0, doc="Distance between places of pushes (radii)."
    )
    start_gap: float = bounded(
        0.2,
        low=0.01,
        high=2.0,
        doc="Distance of the disc from the object when a push starts (radii).",
    )
    directions: tuple[float, ...] = bounded(
        (-0.6, -0.25, 0.0, 0.25, 0.6),
        low=-1.5,
        high=1.5,
        doc="Angles of planned pushes from the normal of the outline (rad).",
    )
    lengths: tuple[float, ...] = bounded(
        (0.07, 0.2, 0.47, 0.93, 1.87, 3.3, 5.3),
        low=0.01,
        high=100.0,
        doc="Lengths of pushes (radii).",
    )
    fan: tuple[float, ...] = bounded(
        (-0.8, -0.4, -0.2, 0.0, 0.2, 0.4, 0.8),
        low=-1.5,
        high=1.5,
        doc="Angles of the targets of a push under way from its direction (rad).",
    )
    reaches: tuple[float, ...] = bounded(
        (0.04, 0.08, 0.13, 0.27, 0.47, 0.73, 1.07, 1.6, 2.4, 3.7, 5.3),
        low=0.01,
        high=100.0,
        doc="Distances of these targets behind the point of contact (radii).",
    )
    followed: int = bounded(24, low=1, high=1000, doc="First pushes that are looked at closely.")
    near: float = bounded(
        0.4, low=0.0, high=100.0, doc="Cost below which no second push is looked for (radii)."
    )
    way_cost: float = bounded(
        0.012,
        low=0.0,
        high=1.0,
        doc="Cost of the disc's way to a push, as a fraction of its length (dimensionless).",
    )
    horizon: int = bounded(70, low=1, high=1000, doc="Steps of a push that is planned.")
    control_horizon: int = bounded(50, low=1, high=1000, doc="Steps of a push under control.")
    least_gain: float = bounded(
        0.017, low=0.0, high=10.0, doc="Progress of the object without which a push ends (radii)."
    )


@dataclass(frozen=True)
class PointTask:
    """A task in one frame, that of the room.

    outline ``(n, 2)`` [m] of the object about its centre of mass, counter-clockwise; gyration: [m],
    see ``push_model.point_push.body``; goal ``(3,)`` [m, m, rad] of the centre of mass; room: least
    and greatest x and y [m] of the disc's centre; period: steps of the disc between two frames.
    """

    outline: Array
    gyration: float
    goal: Array
    room: tuple[float, float]
    period: int


_ARRIVED, _SLOW = 0.13, 4.0  # radii from the start of a push; radii a second there
_PATIENCE, _LONGEST = 25, 14  # frames on the way to a push; frames of a push
_AVOID = 0.5  # radii about the start of a push in vain
_COAST = 25  # steps for which a target on the way must be free of contact
_KEEP = 1.1  # radii that the disc's centre keeps from the object on its ways
_CELL, _PLACES = 0.25, 0.5  # radii of a cell of the map; between places of the search
_WAY_SPACING = 0.8  # radii between targets on a way
_OUTSIDE = 3.0  # cost of a corner outside the room, of how far it is
_NEVER = 1e6
_WALL = 0.25  # radii that corners keep from the walls
_ROUNDS = 12  # changes of what it is about, in one frame


class PointPusher:
    """Chooses the disc's next target, frame by frame."""

    def __init__(self, task: PointTask, disc: Disc, options: PointPushSettings | None = None):
        self._task, self._disc = task, disc
        self._options = options or PointPushSettings()
        self._item = body(task.outline, task.gyration)
        self._space = self._free_space()
        self._starts, self._ends = self._candidates()
        self._do: Callable[[Array, Array], Array | None] = self._plan  # what it is about
        self._start = self._target = np.zeros(2)  # of the push that it is about
        self._frames = 0  # on the way, or of the push
        self._before = math.inf  # cost when the push under way began
        self._vain: list[Array] = []  # starts, in the object's frame, of pushes that gained nothing

    def target(self, pose: Array, disc: Array) -> Array:
        """The disc's next target ``(2,)`` [m]. pose ``(3,)`` of the object's centre of mass; disc
        ``(4,)``: place [m] and velocity [m/s]."""
        for _ in range(_ROUNDS):
            told = self._do(pose, disc)
            if told is not None:
                return told
        return np.array(disc[:2])

    def _free_space(self) -> FreeSpace:
        """Where the disc's centre may be, without the object: nothing is in the room."""
        r, (low, high) = self._disc.radius, self._task.room
        cell, margin = _CELL * r, _KEEP * r  # the edge of a map is a wall
        count = math.ceil((high - low + 2.0 * margin) / cell)
        free = np.zeros((count, count), dtype=np.bool_)
        corner = np.full(2, low - margin)
        return FreeSpace(OccupancyGrid(free, cell, corner), _PLACES * r)

    def cost(self, poses: Array) -> Array:
        """``(n,)`` [m] distances of poses ``(n, 3+)`` from the goal, a turn counted by the radius
        of gyration, with a charge for corners outside the room."""
        goal, lever = self._task.goal, self._task.gyration
        away = (poses[:, 0] - goal[0]) ** 2 + (poses[:, 1] - goal[1]) ** 2
        value = np.sqrt(away + 2.0 * lever**2 * (1.0 - np.cos(poses[:, 2] - goal[2])))
        c, s = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
        x, y = self._item.corners.T
        low, high = self._task.room
        margin = _WALL * self._disc.radius
        for world in (poses[:, :1] + c * x - s * y, poses[:, 1:2] + s * x + c * y):
            out = np.maximum(low + margin - world, world - high + margin)
            value = value + _OUTSIDE * np.maximum(out, 0.0).sum(axis=1)
        return np.asarray(value)

    def _candidates(self) -> tuple[Array, Array]:
        """Starts and targets ``(n, 2)`` of pushes, in the object's frame."""
        o, r, i = self._options, self._disc.radius, self._item
        away = r * (1.0 + o.start_gap)
        starts, ends = [], []
        for a, b in zip(self._task.outline, np.roll(self._task.outline, -1, axis=0), strict=True):
            length = float(np.hypot(*(b - a)))
            normal = np.array([b[1] - a[1], a[0] - b[0]]) / length
            count = max(2, int(length / (o.spacing * r)))
            for t in (np.arange(count) + 0.5) / count:
                start = a + t * (b - a) + away * normal
                if gap(start[0], start[1], i.corners, i.first, i.count)[0] < away - 1e-3 * r:
                    continue
                for angle in o.directions:
                    c, s = math.cos(angle), math.sin(angle)
                    ahead = -np.array(
                        [c * normal[0] - s * normal[1], s * normal[0] + c * normal[1]]
                    )
                    for reach in o.lengths:
                        starts.append(start)
                        ends.append(start + (reach + o.start_gap) * r * ahead)
        return np.array(starts), np.array(ends)

    def _pushes(self, pose: Array) -> tuple[Array, Array, Array, Array]:
        """Starts, targets, poses after them and their costs, of all pushes from a pose."""
        starts, ends = transform(pose[:3], self._starts), transform(pose[:3], self._ends)
        n = len(starts)
        poses = np.zeros((n, 6))
        poses[:, :3] = pose[:3]
        discs = np.column_stack([starts, np.zeros((n, 2))])
        after = push(self._item, self._disc, poses, discs, ends, self._options.horizon)
        low, high = self._task.room
        off = ((starts < low) | (starts > high) | (ends < low) | (ends > high)).any(axis=1)
        costs = self.cost(after.poses) + _NEVER * off
        return starts, ends, after.poses, costs

    def _plan(self, pose: Array, disc: Array) -> Array | None:
        """Choose a push, and be on the way to it."""
        o, r = self._options, self._disc.radius
        starts, ends, after, costs = self._pushes(pose)
        for place in self._vain:
            here = transform(pose[:3], place[None])[0]
            costs = costs + _NEVER * (np.hypot(*(starts - here).T) < _AVOID * r)
        straight = np.hypot(*(starts - disc[:2]).T)
        order = np.argsort(costs + o.way_cost * straight, kind="stable")[: o.followed]
        near = 0.0 if self._vain else o.near * r
        here = Obstacles((transform(pose[:3], self._task.outline),))
        reach = self._space.from_here(disc[:2], _KEEP * r, here)
        best, value = -1, math.inf
        for k in order:
            worth = float(costs[k])
            if worth > near:
                second = float(self._pushes(after[k])[3].min())
                worth = min(worth, 0.7 * second + 0.3 * worth)
            way = reach.way_to(starts[k])
            if way is None:
                continue
            worth += o.way_cost * float(np.hypot(*np.diff(way, axis=0).T).sum())
            if worth < value:
                best, value = int(k), worth
        if best < 0 or costs[best] >= _NEVER:
            self._vain.clear()
            return None
        self._start, self._target = starts[best], ends[best]
        self._frames, self._do = 0, self._along
        return None

    def _along(self, pose: Array, disc: Array) -> Array | None:
        """The farthest target on the way to the push that lets the disc touch nothing; None where
        it has arrived, or cannot go on."""
        r = self._disc.radius
        self._frames += 1
        slow = np.hypot(disc[2], disc[3]) < _SLOW * r
        if slow and np.hypot(*(disc[:2] - self._start)) < _ARRIVED * r:
            self._frames, self._before, self._do = 0, self._now(pose), self._press
            return None
        here = Obstacles((transform(pose[:3], self._task.outline),))
        way = self._space.from_here(disc[:2], _KEEP * r, here).way_to(self._start)
        if way is None or self._frames > _PATIENCE:
            self._do = self._plan
            return None
        points = []
        for a, b in zip(way[:-1], way[1:], strict=True):
            parts = max(1, int(np.hypot(*(b - a)) / (_WAY_SPACING * r)))
            points += [a + (k + 1) / parts * (b - a) for k in range(parts)]
        targets = np.array(points[::-1])
        after = self._pushed(pose, disc, targets, self._task.period + _COAST)
        free = np.flatnonzero(np.logical_not(after.touched))
        target: Array = targets[free[0]] if len(free) else way[1]
        return target

    def _press(self, pose: Array, disc: Array) -> Array | None:
        """The best target of the fan; None where no one brings the object nearer."""
        o, r, i = self._options, self._disc.radius, self._item
        away, px, py = gap(disc[0], disc[1], placed(i, pose), i.first, i.count)
        d = self._target - disc[:2]
        bases = math.atan2(d[1], d[0]), math.atan2(py - disc[1], px - disc[0])
        angles = np.add.outer(np.array(bases), np.array(o.fan)).ravel()
        reaches = away - r + r * np.array(o.reaches)
        fan = np.stack([np.cos(angles), np.sin(angles)], axis=-1)[:, None] * reaches[:, None]
        low, high = self._task.room
        targets = np.vstack([self._target, disc[:2] + fan.reshape(-1, 2)])
        targets = np.clip(targets, low + 0.05 * r, high - 0.05 * r)
        costs = self.cost(self._pushed(pose, disc, targets, o.control_horizon).poses)
        now, k = self._now(pose), int(costs.argmin())
        self._frames += 1
        if costs[k] > now - max(o.least_gain * r, 0.02 * now) or self._frames > _LONGEST:
            self._remember(pose)
            self._do = self._plan
            return None
        self._target = targets[k]
        return self._target

    def _pushed(self, pose: Array, disc: Array, targets: Array, steps: int) -> Pushed:
        """After steps of the disc towards each of the targets ``(n, 2)`` [m]."""
        n = len(targets)
        poses = np.zeros((n, 6))
        poses[:, :3] = pose
        return push(self._item, self._disc, poses, np.tile(disc, (n, 1)), targets, steps)

    def _now(self, pose: Array) -> float:
        return float(self.cost(pose[None, :3])[0])

    def _remember(self, pose: Array) -> None:
        """Do not begin again where a push has gained nothing, until another one has gained."""
        if self._now(pose) < self._before - self._options.least_gain * self._disc.radius:
            self._vain.clear()
        else:
            self._vain.append(transform(se2.inverse(pose[:3]), self._start[None])[0])
