"""What one robot plans: pushes of its object, and its own way to the next one. No ROS, no clock."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from push_job.method import Seen
from push_model.arrays import Array
from push_model.distance_field import DistanceField
from push_model.jobs import JobError
from push_model.push_segment import PushSegment
from push_model.specs import ObjectSpec, RobotSpec
from push_model.stick_certificate import ContactBelief
from push_planner import (
    NoRobotPath,
    PlanError,
    PlannerSettings,
    PlanningFailed,
    Progress,
    PushPlan,
    PushPlanner,
    TooHeavy,
    going_on,
    joined,
    plan_among_bodies,
    plan_robot_path,
    warm_up,
)
from push_supervisor import Surroundings, commands, events, motions, repair

_NO_BODY_MATTERS = (PlanError.INVALID_GOAL, PlanError.OUTSIDE_MAP)


class Plans:
    """Answers MakePlan, Repair and FindPath, one at a time."""

    def __init__(
        self, settings: PlannerSettings, field: DistanceField, robot: RobotSpec, item: ObjectSpec
    ) -> None:
        self._settings, self._field = settings, field
        self._draws = 0  # pre-emptive pushes asked for: each draws others
        self._planner: PushPlanner | None = None
        self._work: Iterator[Progress] | None = None
        self._best: PushPlan | None = None
        self._specs: tuple[RobotSpec, ObjectSpec, ContactBelief | None] = robot, item, None
        try:
            warm_up(settings, robot, item)
        except PlanningFailed:
            pass  # an object that cannot be pushed is refused with its goal

    def planner(
        self, robot: RobotSpec, item: ObjectSpec, believed: ContactBelief | None
    ) -> PushPlanner:
        """For a robot and an object; that at work where they are as is believed."""
        specs = robot, item, believed
        if specs != self._specs:
            return PushPlanner(self._settings, self._field, *specs)
        if self._planner is None:
            self._planner = PushPlanner(self._settings, self._field, *specs)
        return self._planner

    def believe(self, robot: RobotSpec, item: ObjectSpec, believed: ContactBelief | None) -> None:
        """Go on with what is believed; if it has changed, a plan under way is begun anew.

        believed: intervals of friction and centre of mass, where somebody has given some.
        """
        if (robot, item, believed) != self._specs:
            self._specs = robot, item, believed
            self._planner = self._work = None

    def drop(self) -> None:
        """No plan is wanted any more."""
        self._work = None

    def repair(
        self, command: commands.Repair, near: Surroundings, seen: Seen
    ) -> events.Event | None:
        """Do one slice of the work on a plan that begins with the push under way."""
        push = command.segment
        then, robot = replace(seen, object=push.object_end), repair.robot(near, push)
        before = self._best if self._work is not None else None
        event = self.plan(commands.MakePlan(command.goal), robot, then, push.side)
        if event is None and self._best is not None and self._best is not before:
            event = events.PlanFound(self._pushes(self._best), improving=True)
        if isinstance(event, events.PlanFound):
            drive = self._specs[0].differential
            pushes = going_on(push, event.segments, drive, self._settings)
            event = events.PlanFound(pushes, event.improving)
        return event

    def plan(
        self,
        command: commands.MakePlan,
        robot: Array,
        seen: Seen,
        on_side: int | None = None,
        slices: int = 1,
    ) -> events.Event | None:
        """Do some slices of the work on a plan; the plan, or why there is none, after the last."""
        if self._work is None:
            self._draws += command.preemptive
            self._best = None
            self._work = self._begin(command, seen, robot, on_side)
        try:
            for _ in range(slices):
                self._best = next(self._work).best
            return None
        except StopIteration:
            assert self._best is not None
            answer: events.Event = events.PlanFound(self._pushes(self._best))
        except TooHeavy as error:
            answer = events.PlanFailed(JobError.TOO_HEAVY, str(error))
        except PlanningFailed as failure:
            retry = failure.code is PlanError.NO_PUSH_SEQUENCE
            crowded = len(seen.obstacles) > 0 and failure.code not in _NO_BODY_MATTERS
            answer = events.PlanFailed(job_error(failure), str(failure), retry, crowded)
        self._work = None
        return answer

    def _pushes(self, plan: PushPlan) -> tuple[PushSegment, ...]:
        return joined(plan.segments, self._specs[0].differential, self._settings)

    def _begin(
        self, command: commands.MakePlan, seen: Seen, robot: Array, on_side: int | None
    ) -> Iterator[Progress]:
        planner, draw = self.planner(*self._specs), self._draws * command.preemptive
        ends, bodies = (seen.object, command.goal), seen.obstacles
        yield from plan_among_bodies(planner, *ends, bodies, draw, robot, on_side)

    def way(
        self, command: commands.FindPath, robot: Array, seen: Seen, near: Surroundings
    ) -> events.Event:
        """The robot's way to where its next push begins."""
        to = motions.standoff(command.segment, seen.object)
        others = wider(seen.obstacles, self._specs[0].footprint_radius)
        circles = np.vstack([near.on_the_way(seen.object, {}), others])
        try:
            way = plan_robot_path(self._field, self._specs[0], self._settings, robot, to, circles)
        except NoRobotPath as error:
            return events.PathFailed(str(error), crowded=len(others) > 0)
        return events.PathFound(way)


def job_error(failure: PlanningFailed) -> JobError:
    """The job's code of the same name; PLANNING_FAILED where it has none."""
    return JobError.__members__.get(failure.code.name, JobError.PLANNING_FAILED)


def wider(discs: Array, by: float) -> Array:
    """Discs ``(n, 3)`` x, y, radius [m], of greater radii."""
    grown: Array = discs + np.array([0.0, 0.0, by])
    return grown
