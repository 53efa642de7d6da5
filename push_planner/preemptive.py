"""Pushes to try when no plan was found: section 2.5, state S2.

The thesis draws one random curvature. Here several curvatures are drawn, a straight push is added,
and every side and length is tried. The result thus depends less on the random draw. Last come
pushes on a corner, which turn the object where no stable push leads away (``turning_push.py``).
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.kinematics import unicycle_step
from push_model.push_segment import PushSegment
from push_planner.planner import PushPlanner
from push_planner.push_curve import shortest_push_curve
from push_planner.push_graph import PushStep
from push_planner.push_plan import PlanError, PlanningFailed, Progress, PushPlan
from push_planner.refusal import check_way
from push_planner.robot_path import has_way
from push_planner.turning_push import turning_search


def preemptive_pushes(
    planner: PushPlanner,
    start: Array,
    goal: Array,
    seed: int,
    lengths: tuple[float, ...] = (0.15, 0.3, 0.5, 0.8, 1.1, 1.4),
    curvatures: int = 3,
    robot: Array | None = None,
) -> list[PushSegment]:
    """Constant-curvature pushes of the object from ``start`` ``(3,)`` that collide with nothing.

    Parameters
    ----------
    robot: ``(3,)`` pose of the robot, from which it must have a way to the side; None if unknown.

    Returns
    -------
    Sorted by the distance of the object's end pose to the goal ``(3,)``.
    """
    random = np.random.default_rng(seed)
    scene = planner.scene
    start, goal = scene.item.mass_pose(start), scene.item.mass_pose(goal)
    leaving, safe = scene.leaving(start), scene.settings.safety_distance
    outline = se2.transform(start, scene.shape.outline)
    found: list[tuple[float, PushSegment]] = []
    for side in scene.sides:
        drawn = random.uniform(0.95 * side.trusted.minimum, 0.95 * side.trusted.maximum, curvatures)
        begin = side.robot_pose(start)
        if not scene.has_room(begin, side, leaving):
            continue
        there = scene.standoff(begin, side)
        if robot is not None and not has_way(
            scene.field, scene.robot, scene.settings, robot, there, outline
        ):
            continue
        for curvature in [0.0, *drawn]:
            for length in lengths:
                end = unicycle_step(begin, length, length * curvature, 1.0)
                curve = shortest_push_curve(begin, end, side.trusted.minimum, side.trusted.maximum)
                if curve is None or not scene.has_room(end, side):
                    continue
                after = se2.compose(end, side.grasp)
                clearance = scene.kept(curve, side, leaving)
                if clearance is None or scene.object_clearance(after) < safe:
                    continue
                gap = float(np.hypot(*(after - goal)[:2]))
                step = PushStep(side, curve, start, after, clearance, scene.time.of_push(curve))
                found.append((gap, planner.segment(step)))
    found.sort(key=lambda pair: pair[0])
    return [segment for _, segment in found]


def plan_after_preemptive_push(
    planner: PushPlanner, start: Array, goal: Array, seed: int, robot: Array | None = None
) -> Iterator[Progress]:
    """Plan in slices like ``PushPlanner.plan``, with a pre-emptive push first.

    The pre-emptive pushes are tried one after the other. The plans that are reported begin with the
    first of them from whose end a plan is found.

    robot: see ``preemptive_pushes``.

    Raises
    ------
    PlanningFailed: no plan was found after any of them; raised by the last ``next``.
    """
    planner.check(start, "start", PlanError.START_OCCUPIED)
    planner.check(goal, "goal", PlanError.GOAL_OCCUPIED)
    offers = preemptive_pushes(planner, start, goal, seed, robot=robot)
    offers = offers[: planner.settings.max_preemptive]
    settings, centre = planner.settings, planner.scene.item.mass_pose(start)
    most = settings.max_turning if settings.planner == "lazy" else 0  # not in the thesis
    offers += yield from turning_search(planner.scene, centre, robot, most)
    if not offers:
        check_way(planner.scene, start, robot)
        raise PlanningFailed(
            PlanError.NO_PUSH_SEQUENCE,
            "the object is stuck at the start: no stable push leads away from there"
            + (", and no push on a corner turns it" if most else "")
            + "; clear the space around it",
        )
    yield Progress("pre-emptive pushes", None)
    least = planner.lower_bound(start, goal)
    failure = ""
    for number, offer in enumerate(offers, 1):
        stage = f"after pre-emptive push {number} of {len(offers)}"
        rest: PushPlan | None = None
        whole: PushPlan | None = None
        try:
            back = np.array([-planner.settings.standoff, 0.0, 0.0])
            after = se2.compose(offer.robot_end, back)
            plans = planner.plan(offer.object_end, goal, thorough=False, robot=after)
            for progress in plans:
                if progress.best is not None and (
                    rest is None or progress.best.segments is not rest.segments
                ):
                    rest = progress.best
                    whole = _preceded(planner, offer, rest, least)
                yield Progress(f"{stage}: {progress.stage}", whole)
            return
        except PlanningFailed as error:
            failure = f"planning after the last of them failed: {error}"
    raise PlanningFailed(
        PlanError.NO_PUSH_SEQUENCE,
        f"none of {len(offers)} pre-emptive pushes opens a way to the goal; {failure}",
    )


def _preceded(planner: PushPlanner, first: PushSegment, plan: PushPlan, least: float) -> PushPlan:
    """A plan with a push before it, at the cost that the search would give it. least: [s] bound on
    the cost of any plan of stable pushes; it says nothing of a push on a corner."""
    clearance = min(first.clearance, plan.clearance)
    segments = (first, *plan.segments)
    cost = planner.scene.time.of_plan(segments)
    bound = 0.0 if first.turns else least
    return replace(plan, segments=segments, cost=cost, cost_bound=bound, clearance=clearance)
