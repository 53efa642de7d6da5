"""Pushes to try when no plan was found: section 2.5, state S2.

The thesis draws one random curvature; here a few are drawn, straight included, and every side and
length is tried, so that the list is not empty by bad luck.
"""

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.kinematics import unicycle_step
from push_model.push_segment import PushSegment
from push_planner.planner import PushPlanner
from push_planner.push_curve import shortest_push_curve
from push_planner.push_search import PushStep


def preemptive_pushes(
    planner: PushPlanner,
    start: Array,
    goal: Array,
    seed: int,
    lengths: tuple[float, ...] = (0.15, 0.3, 0.5),
    curvatures: int = 3,
) -> list[PushSegment]:
    """Constant-curvature pushes of the object from ``start`` ``(3,)`` that collide with nothing.

    Returns
    -------
    Sorted by the distance of the object's end pose to the goal ``(3,)``.
    """
    random = np.random.default_rng(seed)
    scene = planner.scene
    needed = scene.settings.safety_distance
    found: list[tuple[float, PushSegment]] = []
    for side in scene.sides:
        drawn = random.uniform(0.95 * side.trusted.minimum, 0.95 * side.trusted.maximum, curvatures)
        begin = side.robot_pose(start)
        if not scene.has_room(begin):
            continue
        for curvature in [0.0, *drawn]:
            for length in lengths:
                end = unicycle_step(begin, length, length * curvature, 1.0)
                curve = shortest_push_curve(begin, end, side.trusted.minimum, side.trusted.maximum)
                if curve is None or not scene.has_room(end):
                    continue
                clearance = scene.curve_clearance(curve, side, needed)
                if clearance < needed:
                    continue
                after = se2.compose(end, side.grasp)
                gap = float(np.hypot(*(after - goal)[:2]))
                step = PushStep(side, curve, start, after, clearance)
                found.append((gap, planner.segment(step)))
    found.sort(key=lambda pair: pair[0])
    return [segment for _, segment in found]
