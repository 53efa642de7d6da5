"""One request for a plan: among the bodies that stand around now, direct or pre-emptive."""

from collections.abc import Iterator

from push_model.arrays import Array
from push_model.traction import too_heavy
from push_planner.bodies import with_bodies
from push_planner.planner import PushPlanner
from push_planner.preemptive import plan_after_preemptive_push
from push_planner.push_plan import Progress


class TooHeavy(Exception):
    """The robot cannot push the object; the text says what it needs and what there is."""


def planner_among(planner: PushPlanner, start: Array, circles: Array) -> PushPlanner:
    """A planner on the map with other bodies on it, see ``with_bodies``."""
    if not len(circles):
        return planner
    scene, settings = planner.scene, planner.settings
    margin = settings.safety_distance
    grid = with_bodies(scene.field.grid, circles, scene.item.outline, start, margin)
    return PushPlanner(settings, grid, scene.robot, scene.item, scene.believed)


def plan_among_bodies(
    planner: PushPlanner,
    start: Array,
    goal: Array,
    circles: Array,
    preemptive: int = 0,
    robot: Array | None = None,
    on_side: int | None = None,
) -> Iterator[Progress]:
    """The work on a request, in slices as of ``PushPlanner.plan``.

    Parameters
    ----------
    start, goal: poses ``(3,)`` of the object's geometric frame.
    circles: ``(n, 3)`` [m] x, y, radius of other bodies.
    preemptive: 0 for a direct plan; else the number of this request for a pre-emptive push, since
        each draws others.
    robot: pose ``(3,)`` of the robot, from which it must have a way to the first side; None if
        unknown.
    on_side: index of the side on which the robot pushes when the plan begins; None if on none.

    Raises
    ------
    TooHeavy: at once. PlanningFailed: see ``PushPlanner.plan``.
    """
    scene, settings = planner.scene, planner.settings
    problem = too_heavy(scene.robot, scene.item)
    if problem is not None:
        raise TooHeavy(problem)
    planner = planner_among(planner, start, circles)
    if preemptive:
        return plan_after_preemptive_push(planner, start, goal, settings.seed + preemptive, robot)
    return planner.plan(start, goal, robot=robot, on_side=on_side)
