"""The last touch of a plan: gentler bends where they cost hardly anything.

The cheapest push bends as tightly as it may. If the friction at the bumper is lower than believed,
the object slips on such a bend. A push with wider bends is often only slightly longer, and then the
object sticks with much less friction, too.

The poses at which the side changes are moved first, by a search near the poses of the plan with
smaller curvature limits. Then every push takes the widest bends that cost at most so much more.
"""

from collections.abc import Generator, Sequence

import numpy as np

from push_model.arrays import Array
from push_model.push_segment import PushSegment
from push_planner.candidate_poses import nearby
from push_planner.push_curve import PushCurve, shortest_push_curve
from push_planner.push_graph import PushGraph, PushStep, SearchStatistics
from push_planner.push_search import PushSearch
from push_planner.scene import PushScene

_SEARCHED = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
"""Parts of the trusted curvatures, in the search for other poses."""
_TRIED = tuple(0.05 * k for k in range(4, 20))  # of them, for a single push
_POSES = 80  # about each one
_SIZES = (0.3, 0.2, 0.15, 0.1, 0.05, 0.025)  # [m] that they are away
_SAMPLES = 321  # along a curve
_FIRST = 0.1  # by which the first poses that are found may cost more


def gentler(
    scene: PushScene,
    segments: Sequence[PushSegment],
    cost: float,
    robot: Array | None,
    random: np.random.Generator,
    statistics: SearchStatistics,
    on_side: int | None = None,
) -> Generator[None, None, tuple[PushStep, ...] | None]:
    """Search in slices for pushes from the same start to the same goal with wider bends.

    Parameters
    ----------
    segments: the pushes of a plan. cost: [s] of it. robot: ``(3,)`` pose of the robot, or None.
    on_side: index of the side on which the robot pushes at the start; None if it does not.

    The result costs at most the part ``easing`` more. It is None if nothing gentler was found.
    """
    given = [_step(scene, segment) for segment in segments]
    steps: Sequence[PushStep] = given
    limit = (1.0 + scene.settings.easing) * cost
    for part in _SEARCHED:
        narrow = scene.bending_less(part)
        found = yield from _near(narrow, steps, limit, robot, random, statistics, on_side)
        if found is not None:
            steps, cost = found
            break
    result = []
    left = limit / cost  # of what a push may take longer
    for number, step in enumerate(steps):
        leaving = scene.leaving(step.object_start) if number == 0 else np.inf
        result.append(_widest(scene, step, left * step.time, leaving, statistics))
        yield
    changed = any(new is not old for new, old in zip(result, given, strict=False))
    return tuple(result) if changed else None


def _step(scene: PushScene, segment: PushSegment) -> PushStep:
    """The push that a segment was made of, see ``PushPlanner.segment``."""
    s, item = segment, scene.item
    side = next(side for side in scene.sides if side.index == s.side)
    curve = PushCurve(s.robot_start, s.robot_end, s.k_start, s.k_end, s.length)
    start, end = item.mass_pose(s.object_start), item.mass_pose(s.object_end)
    return PushStep(side, curve, start, end, s.clearance, scene.time.of_push(curve))


def _near(
    scene: PushScene,
    steps: Sequence[PushStep],
    limit: float,
    robot: Array | None,
    random: np.random.Generator,
    statistics: SearchStatistics,
    on_side: int | None,
) -> Generator[None, None, tuple[tuple[PushStep, ...], float] | None]:
    """The cheapest pushes by way of poses near those of a plan, below a cost [s]."""
    found, cost = None, (1.0 + _FIRST) * limit
    start, goal = steps[0].object_start, steps[-1].object_end
    between = [step.object_end for step in steps[:-1]]
    for size in _SIZES if between else ():
        poses = nearby(np.array(between), _POSES, size, random).free(scene)
        graph = PushGraph(scene, start, goal, poses, np.inf, robot, on_side=on_side)
        yield
        search = PushSearch(graph, cost, 1.0, scene.settings.max_expansions)
        yield from search.run(statistics)
        if search.solution is not None:
            found, cost = search.solution, search.cost
            between = [step.object_end for step in found[:-1]]
            if not between:
                break
    return None if found is None or cost > limit else (found, cost)


def _widest(
    scene: PushScene, step: PushStep, longest: float, leaving: float, statistics: SearchStatistics
) -> PushStep:
    """The same push on the curve with the widest bends that takes no longer than so much [s].

    leaving: [m] clearance that will do over the first centimetres, see ``PushScene.kept``.
    """
    limits = next(s.trusted for s in scene.sides if s.index == step.side.index)
    _, _, bends = step.curve.sample(_SAMPLES)
    for part in _TRIED:
        narrow = limits.scaled(part)
        if narrow.minimum <= bends.min() and bends.max() <= narrow.maximum:
            break  # it has no tighter ones
        statistics.solved += 1
        curve = shortest_push_curve(
            step.curve.start, step.curve.end, narrow.minimum, narrow.maximum
        )
        if curve is None or (time := scene.time.of_push(curve)) > longest:
            continue
        clearance = scene.kept(curve, step.side, leaving)
        if clearance is not None:
            statistics.feasible += 1
            return PushStep(step.side, curve, step.object_start, step.object_end, clearance, time)
    return step
