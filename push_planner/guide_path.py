"""Layer 1: a path for the object over R^2 by RRT*, cost (2.1).

(2.1) adds the length to the reciprocal of the least clearance, a bottleneck: costs of edges do not
add up to it. The sweep below asks RRT* for the shortest path at several least clearances and takes
the best by (2.1), which is exact in the limit of many thresholds.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import ompl.base as ob
import ompl.geometric as og
import ompl.util as ou

from push_model.arrays import Array
from push_planner.distance_field import DistanceField
from push_planner.settings import PlannerSettings

ou.setLogLevel(ou.LogLevel.LOG_NONE)


@dataclass(frozen=True)
class GuidePath:
    """points ``(n, 2)`` [m]; cost (2.1); length [m]; clearance [m] of the points from obstacles."""

    points: Array
    cost: float
    length: float
    clearance: float


class _Validity(ob.StateValidityChecker):  # type: ignore[misc]
    def __init__(self, information: ob.SpaceInformation, field: DistanceField, least: float):
        super().__init__(information)
        self._at = field.at
        self._least = least

    def isValid(self, state: ob.State) -> bool:  # noqa: N802 (OMPL's name)
        return bool(self._at(state[0], state[1]) >= self._least)


class _Motion(ob.MotionValidator):  # type: ignore[misc]
    def __init__(self, information: ob.SpaceInformation, field: DistanceField, least: float):
        super().__init__(information)
        self._field = field
        self._least = least

    def checkMotion(self, a: ob.State, b: ob.State, last: object = None) -> bool:  # noqa: N802
        return bool(self._field.segment((a[0], a[1]), (b[0], b[1]), self._least) >= self._least)


def shortest_path(
    field: DistanceField,
    start: Array,
    goal: Array,
    clearance: float,
    iterations: int,
    extension: float,
    seed: int,
) -> Array | None:
    """RRT* over R^2: points ``(n, 2)`` [m] whose segments keep a clearance [m], or None."""
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
    validity = _Validity(information, field, clearance)
    motion = _Motion(information, field, clearance)
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
    return _shortcut(field, points, clearance)


def _shortcut(field: DistanceField, points: Array, clearance: float) -> Array:
    """Leave out points as long as the straight way keeps the clearance."""
    kept = [points[0]]
    i = 0
    while i < len(points) - 1:
        j = len(points) - 1
        while j > i + 1 and field.segment(points[i], points[j], clearance) < clearance:
            j -= 1
        kept.append(points[j])
        i = j
    return np.array(kept)


def path_cost(field: DistanceField, points: Array, settings: PlannerSettings) -> GuidePath:
    """(2.1) of a path ``(n, 2)``."""
    length = float(np.hypot(*np.diff(points, axis=0).T).sum())
    clearance = min(field.segment(a, b) for a, b in zip(points[:-1], points[1:], strict=True))
    cost = settings.length_weight * length + settings.clearance_weight / max(clearance, 1e-6)
    return GuidePath(points, cost, length, clearance)


def guide_paths(
    field: DistanceField,
    start: Array,
    goal: Array,
    least: float,
    settings: PlannerSettings,
    seed: int,
) -> Iterator[GuidePath]:
    """The sweep: a path for each clearance threshold, from the widest down.

    Parameters
    ----------
    least: [m] clearance that every path must keep, from the object's footprint.
    """
    widest = min(field.at(start[0], start[1]), field.at(goal[0], goal[1]))
    top = max(least, 0.98 * widest)
    levels = np.geomspace(top, least, settings.clearance_levels) if top > least else [least]
    for level in levels:
        # A wide level is tried even where only a narrow one can work: it fails fast.
        points = shortest_path(
            field, start, goal, float(level), settings.rrt_iterations, settings.rrt_range, seed
        )
        if points is not None:
            yield path_cost(field, points, settings)


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
