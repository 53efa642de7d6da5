"""Reasons why an object cannot be pushed from start to goal.

A reason that is certain is distinguished from a search that found no plan.

Poses ``(3,)`` are of the object's geometric frame.
"""

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_planner.guide_path import origin_floor
from push_planner.push_graph import PushGraph, SearchStatistics
from push_planner.push_plan import PlanError, PlanningFailed
from push_planner.robot_path import has_way
from push_planner.scene import PushScene

_STUCK = 4.0  # circumradii of the object; if sequences of pushes stay nearer to an end, it is told


def _told(pose: Array) -> str:
    return f"({pose[0]:.3f}, {pose[1]:.3f}, {pose[2]:.3f})"


def check_pose(scene: PushScene, pose: Array, what: str, occupied: PlanError) -> None:
    """Raise PlanningFailed unless the object can stand at the pose."""
    if not np.isfinite(pose).all():
        raise PlanningFailed(PlanError.INVALID_GOAL, f"the {what} pose is not finite: {pose}")
    grid = scene.field.grid
    if not grid.contains(pose[0], pose[1]):
        x0, x1, y0, y1 = grid.extent
        raise PlanningFailed(
            PlanError.OUTSIDE_MAP,
            f"the {what} {_told(pose)} lies outside the map, which covers "
            f"x in [{x0:.2f}, {x1:.2f}] and y in [{y0:.2f}, {y1:.2f}] m",
        )
    if scene.object_clearance(scene.item.mass_pose(pose)) <= 0.0:
        raise PlanningFailed(
            occupied, f"at the {what} {_told(pose)} the object would overlap an obstacle"
        )


def check_room(scene: PushScene, pose: Array, what: str, leaving: bool = False) -> None:
    """Raise PlanningFailed if the robot has no room behind any side of the object at the pose."""
    centre = scene.item.mass_pose(pose)
    needed = scene.leaving(centre) if leaving else scene.settings.safety_distance
    clearance = scene.object_clearance(centre)
    if clearance < needed:
        raise PlanningFailed(
            PlanError.NO_PUSH_SEQUENCE,
            f"the object cannot be {what} {_told(pose)}: it is {1e3 * clearance:.1f} mm from an "
            f"obstacle there, but pushes keep {1e3 * needed:.1f} mm; move the object away from the "
            "obstacle, or lower safety_distance",
        )
    if not scene.sides:
        raise PlanningFailed(
            PlanError.NO_PUSH_SEQUENCE,
            f"no side of the object can be pushed: {scene.why_no_sides()}",
        )
    if not any(scene.has_room(s.robot_pose(centre), s, needed) for s in scene.sides):
        behind = ", ".join(
            f"{1e3 * scene.backs(s)[1]:.0f} mm behind side {s.index}" for s in scene.sides
        )
        around = 1e3 * scene.robot_keeps(needed)
        raise PlanningFailed(
            PlanError.NO_PUSH_SEQUENCE,
            f"no side of the object can be {what} {_told(pose)}: behind each side the robot "
            f"would touch an obstacle. It needs a clearance of {around:.1f} mm and room to back "
            f"off: {behind}. Clear this space, or choose another pose",
        )


def sides_shut_off(scene: PushScene, start: Array, robot: Array | None) -> tuple[int, int]:
    """To how many sides of the object at a pose the robot ``(3,)`` has no way, of how many that
    have room behind them."""
    centre = scene.item.mass_pose(start)
    outline, leaving = se2.transform(centre, scene.shape.outline), scene.leaving(centre)
    begins = [(side.robot_pose(centre), side) for side in scene.sides]
    ends = [scene.standoff(b, s) for b, s in begins if scene.has_room(b, s, leaving)]
    if robot is None:
        return 0, len(ends)
    ways = (scene.field, scene.robot, scene.settings, robot)
    return sum(not has_way(*ways, end, outline) for end in ends), len(ends)


def check_way(scene: PushScene, start: Array, robot: Array | None) -> None:
    """Raise PlanningFailed if the robot ``(3,)`` has no way to any side of the object."""
    shut, sides = sides_shut_off(scene, start, robot)
    if robot is not None and shut == sides:
        passage = 2.0 * (scene.robot.footprint_radius + scene.settings.safety_distance)
        raise PlanningFailed(
            PlanError.NO_PUSH_SEQUENCE,
            f"the robot at {_told(robot)} has no way to any side of the object on which it could "
            f"push; it needs passages of at least {passage:.3f} m",
        )


def why_not(
    scene: PushScene,
    start: Array,
    goal: Array,
    statistics: SearchStatistics,
    ways: tuple[bool, bool],
    poses: int,
    widest: float,
    graph: PushGraph | None,
) -> str:
    """What the searches have found out if they ended without a plan.

    ways: whether any push was found that leaves the start, and any that ends at the goal. poses:
    number of object poses that were tried. widest: [m] clearance of the widest guide path found.
    graph: of the last search; None if it does not try every push that may be part of a plan.
    """
    if graph is not None:
        graph.leave(statistics)  # all pushes, not only the first that is found
    solved, feasible = statistics.solved, statistics.feasible
    tried = f"of {solved} pushes that were tried, {feasible} are free of collisions"
    for found, pose, what in (
        (ways[0], start, "away from the start"),
        (ways[1], goal, "to the goal"),
    ):
        if not found:
            return f"no push {what} {_told(pose)} was found; {tried}; clear the space there"
    reason = (
        f"no sequence of pushes from start to goal was found among {poses} poses of the object; "
        f"{tried}"
    )
    stuck = "" if graph is None else _stuck(graph, start, goal)
    if stuck:
        return f"{reason}; {stuck}; clear the space there"
    needed = 2e3 * (origin_floor(scene.shape) + scene.settings.safety_distance)
    return (
        f"{reason}; the widest way that was searched is {2e3 * widest:.0f} mm wide at its "
        f"narrowest place, and the object needs at least {needed:.0f} mm"
    )


def _stuck(graph: PushGraph, start: Array, goal: Array) -> str:
    """That all sequences of pushes from an end stay beside it, if so."""
    for at_goal, pose, what in (
        (False, start, "the pushes found to leave the start {} lead no farther than {:.0f} mm"),
        (True, goal, "the pushes found to lead to the goal {} begin no farther than {:.0f} mm"),
    ):
        joined, end = graph.joined(at_goal), graph.poses[-1 if at_goal else 0, :2]
        farthest = float(np.hypot(*(graph.poses[joined, :2] - end).T).max(initial=0.0))
        if len(joined) and farthest < _STUCK * graph.scene.shape.circumradius:
            return f"{what.format(_told(pose), 1e3 * farthest)} from it"
    return ""
