"""A few robots that push together as a method: the adapter between ``GroupJob`` and its host."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from grasp_opt.contact_outline import convex
from grasp_opt.group_control import GroupControlSettings
from grasp_opt.group_job import GroupJob, GroupJobSettings
from grasp_opt.group_push import GroupPushSettings
from grasp_opt.job_state import Request
from grasp_opt.moves import MoveSettings
from grasp_opt.object_trajectory import ObjectTrajectory, sampled
from grasp_opt.plan_source import InlinePlans, PlanFailed, PlanSource
from push_job.method import Arena, Certificate, MethodSpec, Refusal, Seen, Task, Told
from push_job.report import Drawable, Figure, Report, Status, arrows, discs, polyline
from push_model import se2
from push_model.arrays import Array
from push_model.belief import POSES, Belief
from push_model.bumpers import RingBumper
from push_model.drives import SpeedDrive
from push_model.free_space import FreeSpace, Obstacles
from push_model.jobs import JobError, JobPhase
from push_model.object_way import WayFinder
from push_model.settings import SettingsError
from push_model.specs import ObjectSpec, RobotSpec
from push_model.stick_certificate import ContactBelief
from push_model.traction import lift_share, push_force, standing_traction

MOST = 5
"""Robots of a group at most."""
SECTIONS: dict[str, type[Any]] = {
    "": GroupJobSettings,
    "push": GroupPushSettings,
    "control": GroupControlSettings,
    "moves": MoveSettings,
}
PATIENCE = 10.0
"""Time [s] without poses of a robot after which a task ends, as without those of the object."""
_PER_NEWTON = 0.12  # [m] that an arrow is long


class GroupMethod:
    """Two to five robots about one convex object (section 3.2)."""

    def __init__(self, arena: Arena) -> None:
        """partners of the arena: a PlanSource; without one it plans in this process."""
        self._arena, self._item = arena, arena.item
        self._names = tuple(arena.robots)
        source = arena.partners
        self._plans: PlanSource = (
            InlinePlans(arena.grid, arena.object, self._names[0]) if source is None else source
        )
        self._asked: Request | None = None
        self._complete = math.inf  # [s] of the last frame with all robots
        self._finder = WayFinder(FreeSpace(arena.grid), arena.item.geometry.outline, 0.0)
        control = arena.section("control", GroupControlSettings)
        self._delay = control.pose_delay
        self.job = GroupJob(
            arena.item,
            arena.robot,
            len(self._names),
            arena.section("", GroupJobSettings),
            arena.section("push", GroupPushSettings),
            control,
            arena.section("moves", MoveSettings),
        )

    @property
    def status(self) -> Status:
        """See Method."""
        job = self.job
        pieces = job.pushes + max(0, job.left - (job.state is JobPhase.PUSHING))
        return Status(
            int(job.state),
            job.state.name,
            job.reason,
            int(job.error),
            float(not job.busy) if not pieces else min(1.0, job.pushes / pieces),
            max(0, job.pushes - 1),
            pieces,
            job.replans,
            job.pushes,
        )

    def assess(self, task: Task, belief: Belief, seen: Seen | None) -> Certificate | Refusal:
        """See Method: whether the object fits at the goal; a trajectory begins at the object."""
        if not self.job.busy:
            self._take_up(belief)
        item = convex(belief.object(self._arena.object))
        if task.times:
            try:
                trajectory = _trajectory(task, item)
            except ValueError as error:
                return Refusal(JobError.INVALID_GOAL, str(error))
            if trajectory.still:
                return Refusal(JobError.INVALID_GOAL, "the trajectory does not move the object")
            heavy = self._too_heavy(item, belief)
            return heavy or self._begins_here(trajectory, item, seen)
        if len(task.targets) > 1:
            text = "a group takes one goal at a time, or a trajectory with times"
            return Refusal(JobError.INVALID_GOAL, text)
        if math.isnan(task.goal[2]):
            return Refusal(JobError.INVALID_GOAL, "the goal of a group needs a heading")
        if self._finder.clearance(item.mass_pose(task.goal), Obstacles())[0] <= 0.0:
            text = "the object would overlap an obstacle at the goal"
            return Refusal(JobError.GOAL_OCCUPIED, text)
        return self._too_heavy(item, belief) or Certificate(robots=self._fewest(item, belief))

    def _too_heavy(self, item: ObjectSpec, belief: Belief) -> Refusal | None:
        """Whether all robots together cannot move the object, however they stand."""
        force, count = self._force(item, belief), min(MOST, len(self._names))
        needed = push_force(item)
        if needed <= count * force:
            return None
        text = f"too heavy: needs {needed:.2f} N, {count} robots have {count * force:.2f} N"
        return Refusal(JobError.TOO_HEAVY, text)

    def _fewest(self, item: ObjectSpec, belief: Belief) -> int:
        return max(2, math.ceil(push_force(item) / self._force(item, belief)))

    def _force(self, item: ObjectSpec, belief: Belief) -> float:
        """[N] with which a robot can push at most."""
        robot = belief.robot(self._names[0])
        return standing_traction(robot, lift_share(robot, item))

    def _begins_here(
        self, trajectory: ObjectTrajectory, item: ObjectSpec, seen: Seen | None
    ) -> Certificate | Refusal:
        if seen is None:
            return Certificate(robots=2, seconds=trajectory.duration)
        off = se2.between(trajectory.pose[0], item.mass_pose(seen.object))
        away, turned = float(np.hypot(off[0], off[1])), abs(float(off[2]))
        s = self.job.settings
        if away > 4.0 * s.position_tolerance or turned > 4.0 * s.orientation_tolerance:
            error = f"{1e3 * away:.0f} mm and {turned:.2f} rad"
            text = f"the object is {error} from where the trajectory begins"
            return Refusal(JobError.INVALID_GOAL, text)
        return Certificate(robots=2, seconds=trajectory.duration)

    def begin(self, task: Task, belief: Belief) -> None:
        """See Method."""
        self._take_up(belief)
        self._complete = math.inf
        if task.times:
            self.job.begin_along(_trajectory(task, self._item))
        else:
            self.job.begin(self._item.mass_pose(task.goal))

    def step(self, seen: Seen, belief: Belief) -> Told:
        """See Method: robots stand while one of them is not seen."""
        self._take_up(belief)
        if missing := [n for n in self._names if n not in seen.robots]:
            self.job.rest(seen.time)
            self._complete = min(self._complete, seen.time)
            if seen.time - self._complete > PATIENCE:
                self.end(JobError.POSES_STALE, f"no poses of '{missing[0]}'")
            return Told()
        self._complete = seen.time
        planning = self._see_to_plans(seen, belief)
        pose = self._item.mass_pose(seen.object)
        robots = np.array([seen.robots[n] for n in self._names])
        twists = self.job.step(seen.time, pose, robots)
        commands = zip(self._names, twists, strict=True)
        return Told({n: (float(v), float(w)) for n, (v, w) in commands}, planning)

    def _see_to_plans(self, seen: Seen, belief: Belief) -> float:
        """Request the step that the job needs and pass it the answer; the planning time [s]."""
        request = self.job.request
        if request is None:
            if self._asked is not None:
                self._asked = None
                self._plans.forget()
            return 0.0
        if request is not self._asked:
            self._asked = request
            self._plans.ask(request, seen, belief)
        try:
            plan = self._plans.answer(seen)
        except PlanFailed as failure:
            if failure.code is JobError.NODE_LOST:
                self.job.end(failure.code, str(failure))
            else:
                self.job.failed(failure.code, str(failure))
            return self._plans.cost
        if plan is None:
            return 0.0
        self.job.planned(plan)
        return self._plans.cost

    def report(self, seen: Seen) -> Report | None:
        """See Method: forces in their cones, the wrench, margins, the planned way."""
        job, step, plan = self.job, self.job.last, self.job.plan
        dead = [self._names[i] for i in job.dead]
        figures = [Figure("not moving", float(len(dead)), limit=0.5)]
        shapes: list[Drawable] = []
        lost = [seen.robots[n][:2] for n in dead if n in seen.robots]
        if lost:
            shapes.append(discs("not moving", np.array(lost), self._arena.robot.footprint_radius))
        if plan is not None and job.busy:
            shapes.append(polyline("way", plan.trajectory.pose[:, :2]))
        if step is None or plan is None:
            return Report(job.state.name.lower(), tuple(figures), tuple(shapes))
        pose = self._item.mass_pose(seen.object)
        off = se2.between(plan.trajectory.sample(step.time), pose)
        figures[:0] = [
            Figure("position error", float(np.hypot(off[0], off[1])), "m"),
            Figure("heading error", abs(float(off[2])), "rad"),
            Figure("grasp margin", float(plan.placement.margin), "", 0.0),
        ]
        if job.watch is not None and job.watch.certified is not None:
            figures.insert(3, Figure("certified margin", job.watch.certified, "", 0.0))
        if math.isfinite(job.slip_in):
            figures.insert(3, Figure("slip expected in", job.slip_in, "s"))
        command = step.command
        if command is not None:
            turn = se2.rotation_matrix(float(pose[2]))
            points = se2.transform(pose, command.contacts.points)
            forces = command.forces @ turn.T
            figures.insert(3, Figure("missing part of the wrench", float(command.lacking), "", 0.5))
            for i, force in zip(plan.pushers, forces, strict=True):
                figures.append(Figure(f"force of {self._names[i]}", math.hypot(*force), "N"))
            shapes += self._cones(points, command.contacts.normals @ turn.T)
            shapes.append(arrows("forces", points, _PER_NEWTON * forces))
            wrench = turn @ command.wrench[:2]
            shapes.append(arrows("wrench", pose[None, :2], _PER_NEWTON * wrench[None]))
        return Report(step.phase.value, tuple(figures), tuple(shapes))

    def _cones(self, points: Array, normals: Array) -> list[Drawable]:
        half = math.atan(self._item.contact_friction)
        cones = []
        for point, normal in zip(points, normals, strict=True):
            left, right = (se2.rotation_matrix(a) @ normal for a in (half, -half))
            corners = point + 0.5 * _PER_NEWTON * np.array([left, [0.0, 0.0], right])
            cones.append(polyline("friction cones", corners))
        return cones

    def end(self, code: JobError, reason: str) -> None:
        """See Method."""
        self.job.end(code, reason)
        self._asked = None
        self._plans.forget()

    def revive(self) -> None:
        """See Method."""
        self.job.revive()

    def release(self) -> frozenset[str]:
        """See Method: all when no task is under way; in a push those that do not push."""
        job = self.job
        if not job.busy:
            return frozenset(self._names)
        if job.plan is None or job.state is not JobPhase.PUSHING:
            return frozenset()
        pushing = {self._names[i] for i in job.plan.pushers}
        return frozenset(self._names) - pushing

    def errors(self, seen: Seen) -> tuple[float, float]:
        """See Method."""
        if self.job.goal is None:
            return math.inf, math.inf
        off = se2.between(self.job.goal, self._item.mass_pose(seen.object))
        return float(np.hypot(off[0], off[1])), abs(float(off[2]))

    def facts(self) -> Mapping[str, Any]:
        """See Method."""
        job = self.job
        return {
            "pushes": job.pushes,
            "replans": job.replans,
            "robots that do not move": " ".join(self._names[i] for i in job.dead),
        }

    def _take_up(self, belief: Belief) -> None:
        """Go on with what is believed of the object and the robots now."""
        item = convex(belief.object(self._arena.object))
        robot = belief.robot(self._names[0])
        if item.shape != self._item.shape or item.com != self._item.com:
            space = FreeSpace(self._arena.grid)
            self._finder = WayFinder(space, item.geometry.outline, 0.0)
        self._item = item
        self.job.believe(item, robot, ContactBelief.of(belief, self._arena.object))
        told = (POSES, "latency") in belief.values
        delay = belief.latency.value if told else self._delay
        if delay != self.job.pose_delay:
            self.job.pose_delay = delay


def _trajectory(task: Task, item: ObjectSpec) -> ObjectTrajectory:
    """The trajectory of the centre of mass. Raises ValueError."""
    pose = np.array(task.targets)
    centres = np.array([item.mass_pose(p)[:2] for p in pose])
    return sampled(np.array(task.times), np.column_stack([centres, pose[:, 2]]))


def check_team(robots: Mapping[str, RobotSpec], item: ObjectSpec) -> None:
    """Raise SettingsError unless there are two to five round robots of one type on wheels, and a
    convex object."""
    types, count = list(robots.values()), len(robots)
    if any(t != types[0] for t in types):
        raise SettingsError("has robots of several types; a group needs robots of one type")
    if not isinstance(types[0].bumper, RingBumper) or not isinstance(types[0].drive, SpeedDrive):
        raise SettingsError(
            "has robots without a ring bumper and speed-controlled wheels, which a group needs"
        )
    if not 2 <= count <= MOST:
        raise SettingsError(f"has {count} robots; a group needs 2 to {MOST}")
    if not item.geometry.convex:
        raise SettingsError(
            "pushes an object whose outline is not convex; a group needs a convex one"
        )


GROUP = MethodSpec("group", GroupMethod, SECTIONS, check_team, "group-ellipse")
