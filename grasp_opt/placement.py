"""Task-oriented placement of robots round an object (3.2.1): where, and with which forces.

The thesis solves (3.16)-(3.19) by a local method. Here the whole outline is searched. With the
places given, the forces are a convex problem that is solved in a fraction of a millisecond
(tracking_cost.py). Every placement on a grid about the outline is looked at, and the best ones are
refined. The result is the best known placement. ``placement_bound.py`` bounds all others from
below, and ``benchmarks/placement.py`` prints the gap and compares with far finer grids.
"""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grasp_opt.contact_outline import ContactOutline, Contacts
from grasp_opt.grasp_certificate import GraspCertificate
from grasp_opt.object_trajectory import ObjectTrajectory
from grasp_opt.placement_settings import PlacementSettings as PlacementSettings
from grasp_opt.slices import Work, finish
from grasp_opt.tracking_cost import placement_cost
from grasp_opt.wrench_cone import HELD, margin, margins, task_wrenches, wrench_rays
from push_model.arrays import Array, Mask
from push_model.specs import ObjectSpec
from push_model.stick_certificate import ContactBelief

_GRID = {1: 96, 2: 60, 3: 24, 4: 16, 5: 13}  # places about the outline, by the number of robots
_CENTRES = {1: 1, 2: 96, 3: 60, 4: 60, 5: 60}  # of rows of robots side by side
_ROWS = (1.0, 1.2, 1.5, 2.0, 2.7)  # times the least distance between them
_PAIRS = 24  # places of two side by side, with the others elsewhere
_REFINED = 12  # of the placements on the grid
_LOOSE, _TIGHT = 1e-4, 1e-7  # relative gaps of costs, on the grid and after it
_COARSE, _FINEST = 4e-3, 2e-4  # [m] of the refinement, of all and of the best of them
_WORTH, _FINALLY = 1e-3, 1e-6  # of the cost that a step must save, likewise
_LAST = 3  # refined to the end
_HELD_AGAINST = 4000  # of the cheapest candidates, to find some that hold the task
_GOLDEN = 0.6180339887498949
_SLICE = 100  # placements that are looked at in one slice of the work
_SLOWEST = 0.05  # of the greatest pace: at rest no force would move anything


class NoPlacement(Exception):
    """Raised when robots find no room beside each other, or hold the task nowhere."""


@dataclass(frozen=True)
class Placement:
    """Where robots push and what it costs.

    way ``(n,)`` [m] along the outline, in its order; contacts; cost of (3.16); forces ``(N, n, 2)``
    [N] in the object's frame; errors ``(N, 3)`` of the pose that remain; margin: of the grasp-task
    compatibility test.
    """

    way: Array
    contacts: Contacts
    cost: float
    forces: Array
    errors: Array
    margin: float


class Placer:
    """Searches the places of ``count`` round robots of a radius [m] for one task.

    Polar angles theta are the thesis's coordinates; ways along the outline are used here, and
    ``ContactOutline`` converts. steps ``(N, 3)`` [m, m, rad] of the task; turn ``(N, 3)``: cosine
    and sine of its headings times the pace [m], and the pace; weights ``(3,)``, force_weight: Q and
    R; scale ``(3,)``: motion at unit pace that the components of a wrench make; size: of lambdas,
    roughly; cone: sine and cosine of the friction's angle.
    """

    def __init__(
        self,
        item: ObjectSpec,
        trajectory: ObjectTrajectory,
        count: int,
        radius: float,
        settings: PlacementSettings | None = None,
        free: Callable[[Array], Mask] | None = None,
        candidates: Array | None = None,
        believed: ContactBelief | None = None,
    ) -> None:
        """free: tells of ways ``(n,)`` along the outline where a robot has room. candidates
        ``(k, n)``: those of another task of as many robots in the same room, where they are known.
        believed: what the task must be held for, if not only for the values of ``item``.

        Raises ValueError for a number of robots that is not 1 to 5."""
        if count not in _GRID:
            raise ValueError(f"1 to 5 robots can be placed, not {count}")
        self.settings = settings or PlacementSettings()
        self.item, self.count, self.radius = item, count, radius
        self._free = free or (lambda way: np.ones(len(way), dtype=np.bool_))
        self._candidates = candidates
        self.outline = ContactOutline(item.geometry)
        s, surface = self.settings, item.limit_surface()
        self._surface = surface
        twists = trajectory.body_twists
        size = np.linalg.norm(twists, axis=1)
        self._moving = _different(twists[size > 0.0] / size[size > 0.0, None])
        self._wrenches = task_wrenches(self._moving, surface, surface.radius)
        self._certificate = believed and GraspCertificate(item, believed, self._moving)
        at = np.linspace(0.0, trajectory.duration, s.steps + 1)
        poses = np.array([trajectory.sample(t) for t in at])
        self.steps = np.diff(poses, axis=0)
        heading = 0.5 * (poses[1:, 2] + poses[:-1, 2])
        self.weights = np.array([s.position_weight, s.position_weight, s.orientation_weight])
        self.force_weight = s.force_weight
        c = surface.radius
        if s.model == "printed":
            # Forces move the object by as much as they are, whatever the time: no unit is right.
            pace, self.scale = np.ones(s.steps), np.ones(3)
            self.force_scale, self.size = 1.0, float(np.abs(self.steps).max())
        else:
            # However fast, the floor takes its greatest force: lambda = 1 at the task's pace.
            pace = np.linalg.norm(self.steps * [1.0, 1.0, c], axis=1)
            pace = np.maximum(pace, _SLOWEST * pace.max())
            self.scale = np.array([1.0, 1.0, 1.0 / c**2])
            self.force_scale, self.size = surface.max_force, 1.0 / count
        self.turn = np.column_stack([pace * np.cos(heading), pace * np.sin(heading), pace])
        angle = math.atan(item.contact_friction)
        self.cone = math.sin(angle), math.cos(angle)
        m = 2 * count
        self._room = tuple(np.empty((s.steps, m)) for _ in range(3))
        self._work = np.empty((4, s.steps, 9))
        self._columns, self._contacts = np.empty((3, m)), np.empty((count, 4))

    def cost(self, way: Array, tolerance: float = _TIGHT) -> float:
        """(3.16) of a placement ``(n,)`` [m] along the outline, over all forces."""
        u, z, new = self._room
        return float(
            placement_cost(
                way, *self.outline.arrays, *self.cone, self.scale, self.turn, self.steps,
                self.weights, self.force_weight, self.size, tolerance, self._contacts,
                self._columns, u, z, new, self._work,
            )
        )  # fmt: skip

    def allowed(self, ways: Array) -> Mask:
        """Of placements ``(k, n)``, whether robots have room there, keep apart and off corners."""
        s, flat = self.settings, ways.ravel()
        good = (self.outline.from_corner(flat) >= s.corner) & self._free(flat)
        allowed: Mask = np.all(good.reshape(ways.shape), axis=1)
        centres = self.outline.at(flat).centres(self.radius).reshape(*ways.shape, 2)
        for i, j in itertools.combinations(range(ways.shape[1]), 2):
            away = np.hypot(*(centres[:, i] - centres[:, j]).T)
            allowed &= away >= 2.0 * self.radius + s.gap
        return allowed

    def holds(self, way: Array) -> bool:
        """Whether a placement has the margin, and asks no robot for more force than it has."""
        s = self.settings
        if s.only_pushing and not self.pushes(way):
            return False
        contacts = self.outline.at(way)
        if s.least_margin > -1.0 and self.margin(contacts) < s.least_margin - HELD:
            return False
        if self._certificate and self._certificate.margin(contacts) < 0.0:
            return False
        if s.most_force >= 1e6:
            return True
        self.cost(way, _LOOSE)
        u, (sine, cosine) = self._room[0], self.cone
        a, b = u[:, 0::2], u[:, 1::2]
        square = a**2 + b**2 + 2.0 * a * b * (cosine**2 - sine**2)
        return bool(self.force_scale**2 * square.max() <= s.most_force**2)

    def pushes(self, way: Array) -> bool:
        """Whether every contact moves towards the object all along: who goes ahead of it does not
        push, but holds it back."""
        return bool(self._pushing(np.asarray(way)[None])[0])

    def _pushing(self, ways: Array) -> Mask:
        """``pushes`` of many placements ``(k, n)``."""
        contacts = self.outline.at(ways.ravel())
        (x, y), (nx, ny), (vx, vy, omega) = contacts.points.T, contacts.normals.T, self._moving.T
        towards = np.outer(vx, nx) + np.outer(vy, ny) + np.outer(omega, x * ny - y * nx)
        pushing: Mask = np.all((towards > 0.0).reshape(-1, *ways.shape), axis=(0, 2))
        return pushing

    def margin(self, contacts: Contacts) -> float:
        """The margin of the grasp-task compatibility test."""
        mu, c = self.item.contact_friction, self._surface.radius
        return margin(wrench_rays(contacts.points, contacts.normals, mu, c), self._wrenches)

    def grid(self, points: int, count: int = 0) -> NDArray[np.float64]:
        """``(k, n)`` [m] all allowed placements on so many points evenly about the outline.

        count: of robots; all when it is 0.
        """
        count = count or self.count
        at = (np.arange(points) + 0.5) / points * self.outline.length
        at = at[(self.outline.from_corner(at) >= self.settings.corner) & self._free(at)]
        centres = self.outline.at(at).centres(self.radius)
        away = np.hypot(*(centres[:, None] - centres[None]).transpose(2, 0, 1))
        free = away >= 2.0 * self.radius + self.settings.gap
        chosen = [
            pick
            for pick in itertools.combinations(range(len(at)), count)
            if all(free[i, j] for i, j in itertools.combinations(pick, 2))
        ]
        return at[np.array(chosen, dtype=np.int64).reshape(-1, count)]

    def candidates(self) -> Work[Array]:
        """``(k, n)`` [m] placements from which the best is refined, in slices.

        Those of a coarse grid; rows of robots side by side, for which a side may have just enough
        room; and for three robots or more, two side by side with the others on the grid.
        """
        if self._candidates is not None:
            return self._candidates
        n, total = self.count, self.outline.length
        found = [self.grid(_GRID[n])]
        yield
        pitch = (2.0 * self.radius + self.settings.gap) * (1.0 + 1e-9)
        centres = np.arange(_CENTRES[n]) / _CENTRES[n] * total
        row = np.arange(n) - 0.5 * (n - 1)
        rows = [c + f * pitch * row for f in _ROWS for c in centres]
        if n >= 3:
            others = self.grid(_GRID[n], n - 2)
            pairs = np.arange(_PAIRS)[:, None] / _PAIRS * total + pitch * np.array([[-0.5, 0.5]])
            rows += [np.concatenate([pair, other]) for pair in pairs for other in others]
        for k in range(0, len(rows), _SLICE):
            some = np.array(rows[k : k + _SLICE])
            found.append(some[self.allowed(some)])
            yield
        self._candidates = np.mod(np.vstack(found), total)
        return self._candidates

    def existing(self) -> Work[bool]:
        """Whether any of the candidates holds the task, in slices."""
        candidates = yield from self.candidates()
        # Those far apart first: neighbours hold or fail together.
        order = np.argsort(np.mod(np.arange(len(candidates)) * _GOLDEN, 1.0))
        for k in range(0, len(order), _SLICE):
            for way in self._screened(candidates[order[k : k + _SLICE]]):
                if self.holds(way):
                    return True
            yield
        return False

    def _screened(self, ways: Array) -> Array:
        """Those of the placements ``(k, n)`` that push and have the margin: what ``holds`` asks
        for first, of many at once, without their costs."""
        if self.settings.only_pushing:
            ways = ways[self._pushing(ways)]
        if self.settings.least_margin > -1.0:
            ways = ways[self._margins(ways) >= self.settings.least_margin - HELD]
        return ways

    def _margins(self, ways: Array) -> Array:
        """``margin`` of placements ``(k, n)``."""
        if not len(ways):
            return np.zeros(0)
        contacts, shape = self.outline.at(ways.ravel()), (*ways.shape, 2)
        points, normals = contacts.points.reshape(shape), contacts.normals.reshape(shape)
        mu, c = self.item.contact_friction, self._surface.radius
        return margins(wrench_rays(points, normals, mu, c), self._wrenches)

    def best(self, points: int = 0, refined: int = _REFINED) -> Placement:
        """The best of all candidates, refined; or of a grid of so many points; see ``search``."""
        return finish(self.search(points, refined))

    def search(self, points: int = 0, refined: int = _REFINED) -> Work[Placement]:
        """``best``, in slices.

        Raises
        ------
        NoPlacement: so many robots do not fit beside each other anywhere, or none of the cheapest
            thousands of placements holds the task as it should.
        """
        candidates = self.grid(points) if points else (yield from self.candidates())
        if not len(candidates):
            raise NoPlacement(
                f"{self.count} robots of {1e3 * self.radius:.0f} mm find no room around the object"
            )
        screened = []
        for k in range(0, len(candidates), _SLICE):
            screened.append(self._screened(candidates[k : k + _SLICE]))
            yield
        candidates = np.vstack(screened)
        costs = np.empty(len(candidates))
        for k, way in enumerate(candidates):
            costs[k] = self.cost(way, _LOOSE)
            if k % _SLICE == _SLICE - 1:
                yield
        step = 0.5 * self.outline.length / (points or _GRID[self.count])
        order = []
        for tried, k in enumerate(np.argsort(costs, kind="stable")[:_HELD_AGAINST]):
            if self.holds(candidates[k]):
                order.append(k)
            if tried % _SLICE == _SLICE - 1:
                yield
        if not order:
            raise NoPlacement(
                f"no placement of {self.count} robots supports the task with a margin of "
                f"{self.settings.least_margin:g} and {self.settings.most_force:g} N a robot"
            )
        found = []
        for k in order[:refined]:
            found.append((yield from self.refine(candidates[k], step, _COARSE, _WORTH)))
        found.sort(key=lambda pair: pair[0])
        last = []
        for _, way in found[:_LAST]:
            last.append((yield from self.refine(way, _COARSE, _FINEST, _FINALLY)))
        return self.placement(min(last, key=lambda pair: pair[0])[1])

    def refine(
        self, way: Array, step: float, finest: float = _FINEST, worth: float = _FINALLY
    ) -> Work[tuple[float, Array]]:
        """Cost and places that robots do not better by moving a little: a compass search, in
        slices.

        One at a time, all together, and all apart or together; by steps [m] until ``finest``, as
        long as they save the part ``worth`` of the cost.
        """
        way = np.array(way, dtype=np.float64)
        order = np.argsort(np.argsort(way)) - 0.5 * (self.count - 1)
        moves = np.vstack([np.eye(self.count), np.ones(self.count), order])
        moves = np.kron(moves, np.array([[1.0], [-1.0]]))
        cost = self.cost(way)
        while step > finest:
            better, allowed = False, self.allowed(way + step * moves)
            for number, move in enumerate(moves):
                if not allowed[number]:
                    continue
                trial = way + step * move
                other = self.cost(trial)
                if other < cost * (1.0 - worth) and self.holds(trial):
                    cost, way, better = other, trial, True
                    allowed = self.allowed(way + step * moves)
            if not better:
                step *= 0.5
            yield
        return cost, np.mod(way, self.outline.length)

    def placement(self, way: Array) -> Placement:
        """A placement, from the arc lengths ``(n,)`` [m] of its robots along the outline."""
        way = np.sort(np.mod(np.asarray(way, dtype=np.float64), self.outline.length))
        cost = self.cost(way)
        u = self._room[0].copy()
        contacts = self.outline.at(way)
        sine, cosine = self.cone
        normals = contacts.normals
        across = np.column_stack([-normals[:, 1], normals[:, 0]])
        right, left = cosine * normals - sine * across, cosine * normals + sine * across
        forces = u[:, 0::2, None] * right + u[:, 1::2, None] * left
        moved = np.einsum("ij,kj->ki", self._columns, u)
        c, s, p = self.turn.T
        world = np.column_stack(
            [c * moved[:, 0] - s * moved[:, 1], s * moved[:, 0] + c * moved[:, 1], p * moved[:, 2]]
        )
        return Placement(
            way,
            contacts,
            cost,
            self.force_scale * forces,
            np.cumsum(world - self.steps, axis=0),
            self.margin(contacts),
        )


def _different(rows: Array) -> Array:
    """Rows ``(k, 3)`` without those that are there already: a piece with one twist has one."""
    _, first = np.unique(np.round(rows, 9), axis=0, return_index=True)
    different: Array = rows[np.sort(first)]
    return different
