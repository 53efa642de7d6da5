"""Plans by way of a search over arcs: forward, then backward for less.

Forward, few nodes come close to a goal that only short pushes lead into, and backward, few come
close to a start that only short pushes lead away from. Pushes along a path of arcs are as few push
curves as cost next to nothing more.
"""

import math
from collections.abc import Generator

import numpy as np
from numpy.typing import NDArray

from push_model.arrays import Array
from push_planner.arc_search import ArcSearch
from push_planner.candidate_poses import NOTHING, Candidates
from push_planner.push_graph import PushGraph, PushStep, SearchStatistics
from push_planner.run_ends import RunEnds
from push_planner.scene import PushScene

_SPANS = (1, 2, 3, 5, 8, 13, 21, 34)  # arcs that a push is tried to replace; and all of a run
_EACH = 0.02  # [s] of cost that a push more must save


def pushes_over_arcs(
    scene: PushScene,
    ends: RunEnds,
    bound: float,
    robot: Array | None,
    nodes: int,
    statistics: SearchStatistics,
    on_side: int | None = None,
) -> Generator[None, None, tuple[PushStep, ...] | None]:
    """Search in slices for pushes that cost less than ``bound`` [s]; None if there are none.

    robot: ``(3,)`` pose of the robot, or None. nodes: that each of the two searches may make.
    on_side: index of the side on which the robot pushes at the start; None if it does not.
    """
    graph = PushGraph(scene, ends.start, ends.goal, NOTHING, np.inf, robot, on_side=on_side)
    first = np.array([graph.first_change(side) for side in range(len(scene.sides))])
    begins = np.array([leaves and graph.may_begin(k) for k, leaves in enumerate(ends.leaves)])
    best: tuple[PushStep, ...] | None = None
    for backward in (False, True):
        search = ArcSearch(scene, ends, begins, backward, bound, nodes, first)
        yield from search.run()
        if search.cost < math.inf:
            found = yield from _pushes_along(scene, *search.path(), robot, statistics, on_side)
            if found is not None and found[1] < bound:
                best, bound = found
            yield
    return best


def _pushes_along(
    scene: PushScene,
    poses: Array,
    sides: NDArray[np.int64],
    robot: Array | None,
    statistics: SearchStatistics,
    on_side: int | None = None,
) -> Generator[None, None, tuple[tuple[PushStep, ...], float] | None]:
    """Pushes along a path and their cost [s], in slices; None if one is not possible.

    Parameters
    ----------
    poses: ``(n, 3)`` [m, m, rad] of the object's centre of mass, the start and the goal included.
    sides: ``(n - 1,)`` numbers of the sides on which the object is pushed between them.
    robot, on_side: see ``pushes_over_arcs``.
    """
    between = Candidates(poses[1:-1], np.arange(len(poses) - 2, dtype=np.float64))
    graph = PushGraph(scene, poses[0], poses[-1], between, np.inf, robot, on_side=on_side)
    changes = np.flatnonzero(np.diff(sides)) + 1
    steps: list[PushStep] = []
    cost, first = graph.begin + graph.first_change(int(sides[0])), 0
    if not graph.may_begin(int(sides[0])):
        return None
    for last in (*changes.tolist(), len(poses) - 1):
        side = int(sides[first])
        run = yield from _cheapest(graph, first, last, side, statistics)
        if run is None:
            return None
        steps += run
        cost += sum(step.time for step in run)
        if last < len(sides):
            if not graph.may_change(last, side, int(sides[last])):
                return None
            cost += graph.side_change(last, side, int(sides[last]))
        first = last
    return tuple(steps), cost


def _cheapest(
    graph: PushGraph, first: int, last: int, side: int, statistics: SearchStatistics
) -> Generator[None, None, list[PushStep] | None]:
    """The cheapest pushes on a side from one pose of a path to another one, through some of those
    between them. Yields after the pushes that begin at each of them."""
    count = last - first
    best = np.full(count + 1, math.inf)
    best[0] = 0.0
    into: list[tuple[int, PushStep] | None] = [None] * (count + 1)
    for k in range(count):
        if best[k] == math.inf:
            continue
        for span in {*(s for s in _SPANS if k + s <= count), count - k}:
            step = graph.push(first + k, first + k + span, side, statistics)
            if step is not None and best[k] + step.time + _EACH < best[k + span]:
                best[k + span], into[k + span] = best[k] + step.time + _EACH, (k, step)
        yield
    result: list[PushStep] = []
    k = count
    while k > 0:
        entry = into[k]
        if entry is None:
            return None
        k, step = entry
        result.append(step)
    return result[::-1]
