"""Which robot goes to which place around an object, in which order, and along which path.

The least sum of ways says who takes which place. One after the other they go round everything and
each other; those whose ways keep apart go at the same time.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from grasp_opt.slices import Work
from push_model.arrays import Array, Mask
from push_model.free_space import FreeSpace, Obstacles

_SLANT = 0.25  # cosine between normal and way, of the most slanting robot
_BACKS = (1.0, 0.6, 0.3)  # of the way back from a place, where there is less room behind it
LEAST_BACK = _BACKS[-1]
"""The least of them."""


class NoStep(Exception):
    """Raised when a group can do nothing; says why."""


@dataclass(frozen=True)
class Move:
    """A robot's way: points ``(n, 2)`` [m] with straight lines between, then a heading [rad]; None:
    any."""

    robot: int
    points: Array
    heading: float | None


def standoffs(normals: Array, ahead: Array, away: float) -> Array:
    """``(n, 1)`` [m] before their places at which robots stop: so far [m] from the object, however
    slanting they come to it, by directions ``(n, 2)`` ahead and normals of the contacts."""
    slant = np.clip((normals * ahead).sum(axis=1), _SLANT, 1.0)
    back: Array = away / slant[:, None]
    return back


class Sequencer:
    """Finds who goes where, in which order and how."""

    def __init__(
        self,
        space: FreeSpace,
        radius: float,
        clearance: float,
        back: float,
        walls: Obstacles,
        robots: Array,
        alive: list[int],
    ) -> None:
        """radius, clearance: [m] of the robots, and from everything; back: [m] straight on at the
        end of a way to a place. walls: what stands still; alive: who can move."""
        self._space, self._radius, self._clearance, self._back = space, radius, clearance, back
        self._walls, self._alive = walls, alive
        self._at = {i: np.array(robots[i, :2]) for i in alive}
        self._need = radius + clearance
        self._moves: list[Move] = []
        self._asides: dict[int, int] = {}  # how often a robot went aside

    def _among(self, robot: int) -> Obstacles:
        """What stands in a robot's way: everything, and the others where they are by then."""
        discs = [[*self._at[i], self._radius] for i in self._alive if i != robot]
        return Obstacles(
            self._walls.outlines, np.vstack([self._walls.discs, np.reshape(discs, (-1, 3))])
        )

    def assign(self, places: Array) -> Work[tuple[int, ...]]:
        """Which robot takes each place, in slices: those with the least sum of ways."""
        cost = np.full((len(self._alive), len(places)), 1e3)
        for k, robot in enumerate(self._alive):
            yield
            reach = self._space.from_here(self._at[robot], self._need, self._walls)
            for j, place in enumerate(places):
                way = reach.way_to(self._before(place, self._back))
                if way is not None:
                    cost[k, j] = float(np.hypot(*np.diff(way, axis=0).T).sum())
        rows, columns = linear_sum_assignment(cost)
        chosen = dict(zip(columns.tolist(), rows.tolist(), strict=True))
        return tuple(self._alive[chosen[j]] for j in range(len(places)))

    @staticmethod
    def _before(place: Array, back: float) -> Array:
        """``(2,)`` so far straight behind a place ``(3,)``."""
        return np.array(place[:2]) - back * np.array([math.cos(place[2]), math.sin(place[2])])

    def clear(self, pushers: tuple[int, ...], outlines: list[Array], swept: Array) -> Work[None]:
        """Send robots that do not push out of the way of object and pushers, in slices.

        Raises
        ------
        NoStep: one would be run over, and has nowhere to go.
        """
        for robot in self._alive:
            if robot in pushers:
                continue
            yield
            here = self._at[robot][None]
            if self._out_of_the_way(here, outlines, swept)[0]:
                continue
            if self._park(robot, outlines, swept):
                continue
            away = self._space.room(here, Obstacles(tuple(outlines)))[0]
            others = np.hypot(*(swept - here).T).min()
            if away < self._need or others < self._need + self._radius:
                raise NoStep("a robot that does not push stands in the way and cannot leave")

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

    def send(self, pushers: tuple[int, ...], places: Array) -> Work[None]:
        """Ways to the places, one after the other, in slices. A robot that stands in the way of all
        others goes aside first.

        Raises
        ------
        NoStep: somebody has no way.
        """
        to_go = dict(zip(pushers, places, strict=True))
        asides = 2 * len(to_go)
        while to_go:
            gone = []
            for robot, place in to_go.items():
                if self._try(robot, place):
                    gone.append(robot)
                yield
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
            before = self._before(place, part * self._back)
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
        return bool(gap >= 2.0 * self._radius + 2.0 * self._clearance)


def _dense(points: Array) -> Array:
    parts = [points[:1]]
    for a, b in zip(points[:-1], points[1:], strict=True):
        steps = max(2, math.ceil(float(np.hypot(*(b - a))) / 0.02) + 1)
        parts.append(a + np.linspace(0.0, 1.0, steps)[1:, None] * (b - a))
    return np.vstack(parts)
