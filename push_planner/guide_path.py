"""Layer 1: a path for the object over R^2 by RRT*, cost (2.1).

(2.1) adds the length to the reciprocal of the least clearance, a bottleneck: costs of edges do not
add up to it. The sweep below asks RRT* for the shortest path at several least clearances and takes
the best by (2.1), which is exact in the limit of many thresholds.

The widest path over the lattice of the distance field gives the largest clearance to ask for, and
tells whether there is a path at all. If RRT* finds no path, or a much longer one than the lattice
search, the path of the lattice search is the guide path.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import ompl.base as ob
import ompl.geometric as og
import ompl.util as ou

from push_model.arrays import Array
from push_model.distance_field import DistanceField
from push_model.grid_search import shortest_way
from push_model.room import room_at, segment_keeps, slack_at, straightened
from push_model.shapes import Shape
from push_model.widest_way import escape_radius, widest_clearance
from push_planner.settings import PlannerSettings

_NO_CIRCLES: Array = np.zeros((0, 5))
_NO_ENDS: Array = np.zeros((0, 4))
_LONGER = 1.05  # times the way on the lattice: a path of samples that long has missed that way
_NARROWER = 0.98  # of the widest clearance, to leave samples some room
_GAIN = 0.01  # of the cost: a wider level that can save no more than this is not tried

ou.setLogLevel(ou.LogLevel.LOG_NONE)


@dataclass(frozen=True)
class GuidePath:
    """points ``(n, 2)`` [m]; cost (2.1); length [m]; clearance [m] of the points from obstacles."""

    points: Array
    cost: float
    length: float
    clearance: float


class NoGuidePath(Exception):
    """Raised when no path is wide enough; widest: [m] clearance of the widest, 0 without any."""

    def __init__(self, widest: float) -> None:
        super().__init__(f"the widest path has a clearance of {widest:.3f} m")
        self.widest = widest


class _Validity(ob.StateValidityChecker):
    def __init__(
        self, information: ob.SpaceInformation, field: DistanceField, ends: Array, least: float
    ):
        super().__init__(information)
        self._field = field
        self._ends = ends
        self._least = least * field.args[2]

    def isValid(self, state: ob.State) -> bool:  # noqa: N802 (OMPL's name)
        ox, oy, scale = self._field.args
        u, v = (state[0] - ox) * scale, (state[1] - oy) * scale
        room = room_at(self._field.values, _NO_CIRCLES, 0.0, u, v)
        return bool(room >= self._least - slack_at(self._ends, u, v))


class _Motion(ob.MotionValidator):
    def __init__(
        self, information: ob.SpaceInformation, field: DistanceField, ends: Array, least: float
    ):
        super().__init__(information)
        self._field = field
        self._ends = ends
        self._least = least * field.args[2]

    def checkMotion(self, a: ob.State, b: ob.State, last: object = None) -> bool:  # noqa: N802
        ox, oy, scale = self._field.args
        return bool(
            segment_keeps(
                self._field.values,
                _NO_CIRCLES,
                0.0,
                self._ends,
                self._least,
                (a[0] - ox) * scale,
                (a[1] - oy) * scale,
                (b[0] - ox) * scale,
                (b[1] - oy) * scale,
            )
        )


def shortest_path(
    field: DistanceField,
    start: Array,
    goal: Array,
    clearance: float,
    iterations: int,
    extension: float,
    seed: int,
    ends: Array = _NO_ENDS,
) -> Array | None:
    """RRT* over R^2: points ``(n, 2)`` [m] whose segments keep a clearance [m], or None.

    ends: ``(n, 4)`` where less will do, see ``relieved_ends``.
    """
    x0, x1, y0, y1 = field.grid.extent
    space = ob.RealVectorStateSpace(2)
    bounds = ob.RealVectorBounds(2)
    for axis, (low, high) in enumerate(((x0, x1), (y0, y1))):
        bounds.setLow(axis, low)
        bounds.setHigh(axis, high)
    space.setBounds(bounds)
    # Every generator that OMPL makes from here on is seeded in turn from this number.
    ou.RNG.setSeed(seed)
    setup = og.SimpleSetup(space)
    information = setup.getSpaceInformation()
    validity = _Validity(information, field, ends, clearance)
    motion = _Motion(information, field, ends, clearance)
    setup.setStateValidityChecker(validity)
    information.setMotionValidator(motion)
    first, last = space.allocState(), space.allocState()
    first[0], first[1] = float(start[0]), float(start[1])
    last[0], last[1] = float(goal[0]), float(goal[1])
    setup.setStartAndGoalStates(first, last)
    planner = og.RRTstar(information)
    planner.setRange(extension)
    setup.setPlanner(planner)
    ending = ob.PlannerTerminationCondition(lambda: bool(planner.numIterations() >= iterations))
    setup.solve(ending)
    if not setup.haveExactSolutionPath():
        return None
    states = setup.getSolutionPath().getStates()
    points = np.array([[s[0], s[1]] for s in states])
    return _shortcut(field, points, clearance, ends)


def lattice_path(
    field: DistanceField, start: Array, goal: Array, clearance: float, ends: Array = _NO_ENDS
) -> Array | None:
    """As ``shortest_path``, over the lattice of the field: never misses what its points connect."""
    level = clearance * field.args[2] * (1.0 - 1e-9)
    tips = field.lattice(start[:2]), field.lattice(goal[:2])
    way = shortest_way(field.values, _NO_CIRCLES, 0.0, *tips, ends, level, exact=True)
    if not len(way):
        return None
    points = way * field.spacing + field.args[:2]
    points[0], points[-1] = start[:2], goal[:2]
    return _shortcut(field, points, clearance, ends)


def _shortcut(field: DistanceField, points: Array, clearance: float, ends: Array) -> Array:
    """Leave out points as long as the straight way keeps the clearance."""
    level = clearance * field.args[2]
    kept = straightened(field.values, _NO_CIRCLES, 0.0, ends, level, field.lattice(points))
    result: Array = kept * field.spacing + field.args[:2]
    result[0], result[-1] = points[0], points[-1]
    return result


def relieved_ends(
    field: DistanceField, start: Array, goal: Array, least: float, floor: float
) -> Array:
    """Where a path may have less clearance than ``least`` [m], because its end has less.

    Within the least radius about the end from which a way with ``floor`` [m] leads to a place that
    has enough.

    Returns
    -------
    ``(2, 4)``: x, y, radius, and how much less, in spacings of the field's lattice.
    """
    ends = np.zeros((2, 4))
    scale = field.args[2]
    for k, tip in enumerate((start, goal)):
        there = field.at(tip[0], tip[1])
        ends[k, :2] = field.lattice(tip[:2])
        if there >= least:
            continue
        lowest = min(floor, there) * scale - 1e-9
        # A point that lies between those of the lattice may have more room than any of them.
        for low in (lowest, lowest - 0.75):
            radius = escape_radius(field.values, _NO_CIRCLES, 0.0, ends[k, :2], least * scale, low)
            if math.isfinite(radius):
                ends[k, 2:] = radius, least * scale - low
                break
    return ends


def path_cost(
    field: DistanceField, points: Array, settings: PlannerSettings, ends: Array = _NO_ENDS
) -> GuidePath:
    """(2.1) of a path ``(n, 2)``; its clearance does not count where ``ends`` allow less.

    All paths have the ends in common: what they lack there tells none from another.
    """
    length = float(np.hypot(*np.diff(points, axis=0).T).sum())
    pieces = [
        p for a, b in zip(points[:-1], points[1:], strict=True) for p in _cut(field, a, b, ends)
    ]
    counted = [(a, b) for a, b, relieved in pieces if not relieved]
    clearance = min(field.segment(a, b) for a, b in counted or [p[:2] for p in pieces])
    cost = settings.length_weight * length + settings.clearance_weight / max(clearance, 1e-6)
    return GuidePath(points, cost, length, clearance)


def _cut(field: DistanceField, a: Array, b: Array, ends: Array) -> list[tuple[Array, Array, bool]]:
    """A segment cut where it enters or leaves the discs about relieved ends, and what is inside."""
    along = b - a
    square = float(along @ along)
    cuts = [0.0, 1.0]
    for u, v, radius, _ in ends[ends[:, 3] > 0.0] if square > 0.0 else _NO_ENDS:
        out = a - (np.array([u, v]) * field.spacing + field.args[:2])
        half = float(along @ out) / square
        root = half**2 - (float(out @ out) - (radius * field.spacing) ** 2) / square
        if root > 0.0:
            cuts += [t for t in (-half - math.sqrt(root), -half + math.sqrt(root)) if 0.0 < t < 1.0]
    cuts.sort()
    result = []
    for t0, t1 in zip(cuts[:-1], cuts[1:], strict=True):
        middle = field.lattice(a + 0.5 * (t0 + t1) * along)
        result.append((a + t0 * along, a + t1 * along, slack_at(ends, *middle) > 0.0))
    return result


def origin_floor(shape: Shape) -> float:
    """[m] that a shape's origin keeps from obstacles wherever the shape can stand.

    Its least distance to the outline, which is half the width of a box; 0 if it lies outside.
    """
    x, y = shape.outline.T
    x1, y1 = np.roll(x, -1), np.roll(y, -1)
    crosses = (y > 0.0) != (y1 > 0.0)
    at = x[crosses] - y[crosses] * (x1 - x)[crosses] / (y1 - y)[crosses]
    return shape.inradius if np.count_nonzero(at > 0.0) % 2 else 0.0


def guide_paths(
    field: DistanceField,
    start: Array,
    goal: Array,
    least: float,
    settings: PlannerSettings,
    seed: int,
    easy: float = 0.0,
    floor: float = 0.0,
) -> Iterator[GuidePath]:
    """The sweep: a path for each clearance threshold, in the order that their ways on the lattice
    have by (2.1): RRT* is asked for the next only when the one before it has been taken.

    Parameters
    ----------
    least: [m] clearance without which the object fits in no orientation.
    easy: [m] clearance with which it fits in every orientation. Paths with less come last, and only
        where there are no others or (2.1) prefers them.
    floor: [m] of the object's origin from obstacles that it has wherever it can stand.

    Raises
    ------
    NoGuidePath: no way is as wide as ``least``; from the first ``next``.
    """
    easy = max(least, easy)
    ends = relieved_ends(field, start, goal, least, floor)
    tight = min(field.at(start[0], start[1]), field.at(goal[0], goal[1]))
    # However wide, a path saves no more than the bottleneck's term of (2.1).
    shortest = settings.length_weight * float(np.hypot(*(goal[:2] - start[:2])))
    wide = settings.clearance_weight / max(_GAIN * shortest, 1e-9)
    cap = max(easy, min(_NARROWER * tight, wide))
    scale = field.args[2]
    tips = field.lattice(start[:2]), field.lattice(goal[:2])
    widest = widest_clearance(field.values, *tips, ends, least * scale, cap * scale) / scale
    # A way between the points of the lattice may be wider than theirs by so much.
    if widest + math.sqrt(0.5) * field.spacing < least or widest == 0.0:
        raise NoGuidePath(widest)
    top = cap if widest >= cap else _NARROWER * widest
    low = min(easy, top)
    count = settings.clearance_levels if top > 1.05 * low else 1
    levels = [float(level) for level in np.geomspace(top, low, count)]
    offers = [_on_lattice(field, start, goal, level, settings, ends) for level in levels]
    best = min((cost for cost, _, _ in offers), default=math.inf)
    if least < low:
        narrow = _on_lattice(field, start, goal, least, settings, ends)
        if narrow[0] < best:
            offers.append(narrow)
    found: list[GuidePath] = []
    for _, level, known in sorted(offers, key=lambda offer: offer[0]):
        path = _path_at(field, start, goal, level, known, settings, seed, ends)
        if path is None or any(np.array_equal(path.points, other.points) for other in found):
            continue
        found.append(path)
        yield path
        if len(path.points) == 2 and level >= low:  # straight on: no other level can be better
            break


def _on_lattice(
    field: DistanceField,
    start: Array,
    goal: Array,
    level: float,
    settings: PlannerSettings,
    ends: Array,
) -> tuple[float, float, GuidePath | None]:
    """Cost, clearance asked for [m], and the lattice's path with it; infinite cost without one."""
    points = lattice_path(field, start, goal, level, ends)
    path = None if points is None else path_cost(field, points, settings, ends)
    return math.inf if path is None else path.cost, level, path


def _path_at(
    field: DistanceField,
    start: Array,
    goal: Array,
    level: float,
    known: GuidePath | None,
    settings: PlannerSettings,
    seed: int,
    ends: Array,
) -> GuidePath | None:
    """RRT*'s path with a clearance [m], unless the one known from the lattice is much shorter."""
    sampled = shortest_path(
        field, start, goal, level, settings.rrt_iterations, settings.rrt_range, seed, ends
    )
    if sampled is None:
        return known
    path = path_cost(field, sampled, settings, ends)
    return known if known is not None and path.length > _LONGER * known.length else path


def waypoints(path: GuidePath, spacing: float) -> tuple[Array, Array, Array]:
    """Points evenly along the path, ends included.

    Returns
    -------
    points ``(n, 2)`` [m], tangent headings ``(n,)`` [rad], way from the start ``(n,)`` [m].
    """
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path.points, axis=0).T))])
    count = max(2, round(way[-1] / spacing) + 1)
    at = np.linspace(0.0, way[-1], count)
    points = np.column_stack([np.interp(at, way, path.points[:, k]) for k in (0, 1)])
    step = 0.5 * spacing  # corners of the path are rounded over one spacing
    ahead = np.column_stack([np.interp(at + step, way, path.points[:, k]) for k in (0, 1)])
    behind = np.column_stack([np.interp(at - step, way, path.points[:, k]) for k in (0, 1)])
    direction = ahead - behind
    return points, np.arctan2(direction[:, 1], direction[:, 0]), at
