"""The swarm as a method: the adapter between ``SwarmJob`` and whatever hosts methods."""

import math
from collections.abc import Generator, Mapping
from typing import Any

import numpy as np

from push_job.method import (
    Arena,
    Certificate,
    Command,
    MethodSpec,
    Refusal,
    Seen,
    Task,
    Told,
    Unsuited,
)
from push_job.report import Drawable, Figure, Report, Status, discs, ellipses, polygon
from push_model.arrays import Array
from push_model.belief import Belief
from push_model.bumpers import RingBumper
from push_model.drives import HolonomicDrive, SpeedDrive
from push_model.jobs import JobError, JobPhase
from push_model.settings import SettingsError
from push_model.specs import ObjectSpec, RobotSpec
from swarm_push.agent import AgentSettings
from swarm_push.coverage import Coverage
from swarm_push.crescent_law import CrescentLawSettings
from swarm_push.feasibility import at_once
from swarm_push.laws import LawSections, LawSettings
from swarm_push.object_track import TrackSettings
from swarm_push.region import covered_region, is_open
from swarm_push.swarm_job import SwarmJob, SwarmJobSettings
from swarm_push.thesis_law import ThesisLawSettings

SECTIONS: dict[str, type[Any]] = {
    "": SwarmJobSettings,
    "law": LawSettings,
    "crescent": CrescentLawSettings,
    "thesis": ThesisLawSettings,
    "track": TrackSettings,
    "agents": AgentSettings,
}
_MOST_CELLS = 200  # robots up to which a report shows cells


def swarm_job(arena: Arena) -> SwarmJob:
    """The job for an arena, with its compiled parts loaded.

    Raises
    ------
    Unsuited: the map has no room for a robot, or the law cannot work on it.
    """
    region = covered_region(arena.grid, arena.robot.footprint_radius)
    laws = LawSections(
        arena.section("law", LawSettings),
        arena.section("crescent", CrescentLawSettings),
        arena.section("thesis", ThesisLawSettings),
    )
    if region is None:
        raise Unsuited("the map has no room for a robot")
    if not is_open(arena.grid) and laws.law.law == "thesis":
        raise Unsuited(
            "the map has obstacles; the printed law does not take obstacles into account"
        )
    settings = arena.section("", SwarmJobSettings)
    track = arena.section("track", TrackSettings)
    job = SwarmJob(region, arena.item, arena.robot, settings, laws, arena.grid, track)
    job.warm_up()
    return job


class SwarmMethod:
    """A swarm under one of its laws (chapter 4, and ours)."""

    def __init__(self, arena: Arena) -> None:
        self._arena, self._item = arena, arena.item
        self._law = arena.section("law", LawSettings).law
        self._coverage: Coverage | None = None
        self.job = swarm_job(arena)

    @property
    def status(self) -> Status:
        """See Method."""
        job = self.job
        count = len(job.targets)
        return Status(
            int(job.state),
            job.state.name,
            job.reason,
            int(job.error),
            job.index / count if count else float(not job.busy),
            min(job.index, max(0, count - 1)),
            count,
            times=tuple(job.times),
        )

    def assess(self, task: Task, belief: Belief, seen: Seen | None) -> Certificate | Refusal:
        """See Method: whether the object fits at every target, a way leads there, and the robots
        that are seen can push it. The margin is the force to spare over the force needed."""
        return at_once(self.assess_in_slices(task, belief, seen))

    def assess_in_slices(
        self, task: Task, belief: Belief, seen: Seen | None
    ) -> Generator[int, None, Certificate | Refusal]:
        """See SlicedMethod."""
        item = belief.object(self._arena.object)
        if item != self._item and not self.job.busy:
            self._take_up(belief)
        targets = [_centre(item, t) for t in task.targets]
        if seen is None:
            track = self.job.track
            if track is not None and not all(track.fits(t) for t in targets):
                return Refusal(
                    JobError.GOAL_OCCUPIED,
                    "at the goal the object needs room for robots all around it",
                )
            return Certificate()
        pose, robots, margin, seconds = item.mass_pose(seen.object), 1, math.inf, 0.0
        for target in targets:
            found = yield from self.job.assess_in_slices(target, pose, seen.robots)
            if not found.accepted:
                return Refusal(found.code, found.reason)
            heading = pose[2] if math.isnan(target[2]) else target[2]
            pose = np.array([target[0], target[1], heading])
            robots = max(robots, found.needed or 0)
            if found.force > 0.0:
                margin = min(margin, found.margin / found.force)
            seconds += found.seconds
        return Certificate(robots, margin, seconds)

    def begin(self, task: Task, belief: Belief) -> None:
        """See Method."""
        self._take_up(belief)
        self.job.begin([_centre(self._item, t) for t in task.targets])

    def step(self, seen: Seen, belief: Belief) -> Told:
        """See Method."""
        self._take_up(belief)
        pose = self._item.mass_pose(seen.object)
        commands: dict[str, Command] = dict(
            self.job.step(seen.time, pose, seen.robots, seen.obstacles)
        )
        for name, turn in self.job.turns.items():
            if name in commands:  # else it is not seen, and stands
                vx, vy, *_ = commands[name]
                commands[name] = (vx, vy, turn)
        return Told(commands)

    def report(self, seen: Seen) -> Report | None:
        """See Method: density, cells and centroids, and how far it is to the target."""
        job, step = self.job, self.job.last
        if step is None or job.target is None:
            return None
        away, turned = job.errors(self._item.mass_pose(seen.object))
        figures = (
            Figure("to the target", away, "m"),
            Figure("heading error", turned, "rad"),
            Figure("target", float(job.index + 1)),
            Figure("targets", float(len(job.targets))),
            Figure("taking part", float(len(job.taking_part))),
            Figure("not moving", float(len(job.dead)), limit=0.5),
        )
        robots = np.array([seen.robots[n][:2] for n in job.taking_part if n in seen.robots])
        shapes: list[Drawable] = [polygon("region", job.region)]
        shapes += ellipses("density", step.density.means, step.density.roots)
        if 0 < len(robots) <= _MOST_CELLS:
            self._coverage = self._coverage or Coverage(job.region)
            shapes += [polygon("cells", cell) for cell in self._coverage.cells(robots)]
        shapes.append(discs("centroids", step.centroids, 5e-3))
        shapes.append(discs("target", job.target[None, :2], 0.02))
        dead = [seen.robots[n][:2] for n in sorted(job.dead) if n in seen.robots]
        if dead:
            shapes.append(discs("not moving", np.array(dead), self._arena.robot.footprint_radius))
        return Report(step.phase.value, figures, tuple(shapes))

    def end(self, code: JobError, reason: str) -> None:
        """See Method."""
        self.job.end(code, reason)

    def revive(self) -> None:
        """See Method."""
        self.job.revive()

    def release(self) -> frozenset[str]:
        """See Method: all robots when no task is under way, the dead at any time."""
        if self.job.state is JobPhase.IDLE:
            return frozenset((*self._arena.robots, *self.job.taking_part))
        return self.job.dead

    def errors(self, seen: Seen) -> tuple[float, float]:
        """See Method."""
        return self.job.errors(self._item.mass_pose(seen.object))

    def facts(self) -> Mapping[str, Any]:
        """See Method."""
        return {"law": self._law, "robots that do not move": " ".join(sorted(self.job.dead))}

    def _take_up(self, belief: Belief) -> None:
        """Go on with what is believed of the object now."""
        item = belief.object(self._arena.object)
        if item != self._item:
            self._item = item
            self.job.believe(item)


def _centre(item: ObjectSpec, target: Array) -> Array:
    """A target ``(3,)`` of the centre of mass. Without a heading the offset of the centre of mass
    has no direction: the target is then taken for its place."""
    return np.array(target) if math.isnan(target[2]) else item.mass_pose(target)


def check_team(robots: Mapping[str, RobotSpec], item: ObjectSpec) -> None:
    """Raise SettingsError unless robots are round, of one type, and of controlled velocity."""
    types = list(robots.values())
    if any(t != types[0] for t in types):
        raise SettingsError("has robots of several types; a swarm needs robots of one type")
    drives = SpeedDrive | HolonomicDrive
    if not isinstance(types[0].bumper, RingBumper) or not isinstance(types[0].drive, drives):
        raise SettingsError(
            "has robots without a ring bumper and a velocity command, which a swarm needs"
        )


SWARM = MethodSpec("swarm", SwarmMethod, SECTIONS, check_team, "swarm-square", open_team=True)
