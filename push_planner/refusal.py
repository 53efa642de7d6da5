"""Why an object cannot be pushed from start to goal: what is known, and what was only not found.

Poses ``(3,)`` are of the object's geometric frame.
"""

import numpy as np

from push_model.arrays import Array
from push_planner.guide_path import origin_floor
from push_planner.push_plan import PlanError, PlanningFailed
from push_planner.push_search import SearchStatistics
from push_planner.scene import PushScene


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
            f"the {what} {_told(pose)} lies outside the map, x in [{x0:.2f}, {x1:.2f}], "
            f"y in [{y0:.2f}, {y1:.2f}] m",
        )
    if scene.object_clearance(scene.item.mass_pose(pose)) <= 0.0:
        raise PlanningFailed(
            occupied, f"at the {what} {_told(pose)} the object would overlap an obstacle"
        )


def check_room(scene: PushScene, pose: Array, what: str, leaving: bool = False) -> None:
    """Raise PlanningFailed when the robot has room at no side of the object at the pose."""
    centre = scene.item.mass_pose(pose)
    needed = scene.leaving(centre) if leaving else scene.settings.safety_distance
    clearance = scene.object_clearance(centre)
    if clearance < needed:
        raise PlanningFailed(
            PlanError.NO_PUSH_SEQUENCE,
            f"the object cannot be {what} {_told(pose)}: it is {1e3 * clearance:.1f} mm from an "
            f"obstacle there, and pushes keep {1e3 * needed:.1f} mm",
        )
    if not scene.sides:
        raise PlanningFailed(
            PlanError.NO_PUSH_SEQUENCE,
            f"no side of the object can be pushed: {scene.why_no_sides()}",
        )
    if not any(scene.has_room(s.robot_pose(centre), s, needed) for s in scene.sides):
        behind = ", ".join(f"{s.index} ({1e3 * scene.backs(s)[1]:.0f} mm)" for s in scene.sides)
        around = 1e3 * scene.robot_keeps(needed)
        raise PlanningFailed(
            PlanError.NO_PUSH_SEQUENCE,
            f"no side of the object can be {what} {_told(pose)}: the robot needs {around:.1f} mm "
            "around it and room to back off, and would touch an obstacle behind each side that "
            f"can be pushed: sides {behind}",
        )


def why_not(
    scene: PushScene,
    start: Array,
    goal: Array,
    statistics: SearchStatistics,
    ways: tuple[bool, bool],
    poses: int,
    widest: float,
) -> str:
    """What searches without a plan have found out, and no more than that.

    ways: whether any push was found that leaves the start, and any that ends at the goal. poses:
    how many of the object were tried. widest: [m] clearance of the widest guide path found.
    """
    tried = f"of {statistics.solved} pushes tried, {statistics.feasible} are free of collisions"
    for found, pose, what in (
        (ways[0], start, "away from the start"),
        (ways[1], goal, "to the goal"),
    ):
        if not found:
            return f"no push {what} {_told(pose)} was found; {tried}"
    needed = 2e3 * (origin_floor(scene.shape) + scene.settings.safety_distance)
    return (
        f"no sequence of pushes from start to goal was found among {poses} poses of the object; "
        f"{tried}; the widest way that was searched is {2e3 * widest:.0f} mm wide at its narrowest "
        f"place, the object needs at least {needed:.0f} mm"
    )
