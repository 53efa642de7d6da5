"""The job of a swarm: bring an object to one target after another. No ROS, no clock.

Robots may come, leave and die meanwhile: whoever is seen and does as it is told takes part.
"""

import math
from collections.abc import Generator, Mapping, Sequence

import numpy as np

from push_model.arrays import Array
from push_model.drives import HolonomicDrive
from push_model.jobs import JobError, JobPhase
from push_model.object_way import NoObjectWay
from push_model.occupancy import OccupancyGrid
from push_model.specs import ObjectSpec, RobotSpec
from swarm_push.arrival import Arrival, pose_errors
from swarm_push.contacts import find_contacts
from swarm_push.feasibility import Assessment, Feasibility, Strength, least_contacts, too_few
from swarm_push.job_settings import SwarmJobSettings
from swarm_push.law import Scene, SwarmPhase, SwarmStep
from swarm_push.laws import LawSections, make_law
from swarm_push.liveness import LivenessCheck
from swarm_push.object_track import ObjectTrack, TrackSettings
from swarm_push.progress import Progress, TargetQueue
from swarm_push.spacing import keep_apart
from swarm_push.walls import Walls

__all__ = ["SwarmJob", "SwarmJobSettings"]
_STATES = {
    SwarmPhase.GATHER: (JobPhase.POSITIONING, "robots gather at the object"),
    SwarmPhase.GO_ROUND: (JobPhase.POSITIONING, "robots go around the object"),
    SwarmPhase.REALIGN: (JobPhase.APPROACH, "robots move to where they can push"),
    SwarmPhase.PUSH: (JobPhase.PUSHING, "robots push"),
}


class SwarmJob:
    """One job at a time of robots of one type.

    state, reason, error: as in JobState. last: what the law said at the last tick, and taking_part:
    the robots that it is about. region: as given. holonomic: whether robots move in any direction.
    track: the planner of the object's way among obstacles; None without a map.
    """

    def __init__(
        self,
        region: Array,
        item: ObjectSpec,
        robot: RobotSpec,
        settings: SwarmJobSettings | None = None,
        laws: LawSections | None = None,
        grid: OccupancyGrid | None = None,
        track: TrackSettings | None = None,
    ) -> None:
        """region: ``(m, 2)`` [m] corners, counter-clockwise, of the convex one in which centres of
        robots may be. grid: the map; without it an open room, in which the object does not go
        round anybody; track: how it does."""
        self.settings, self.region = settings or SwarmJobSettings(), region
        self.holonomic = isinstance(robot.drive, HolonomicDrive)
        self._drive = None if self.holonomic else robot.differential
        self._speed, self._radius = robot.max_speed, robot.footprint_radius
        walls, self._walls, self.track, self._grid = None, None, None, grid
        if grid is not None:
            walls = Walls(grid, self._radius)
            self._walls = None if walls.open else walls
            track = track or TrackSettings()
            self.track = ObjectTrack(walls.space.field, item.geometry.outline, self._radius, track)
        self._law = make_law(laws or LawSections(), region, item, self._radius, self._speed, walls)
        self._outline, self._com = item.geometry.outline, item.com
        self._lever = float(np.hypot(*self._outline.T).max())
        self.state, self.reason, self.error = JobPhase.IDLE, "waiting for a goal", JobError.NONE
        self.last: SwarmStep | None = None
        self.taking_part: tuple[str, ...] = ()
        self._queue, self._progress = TargetQueue(), Progress()
        self._liveness = LivenessCheck(self.settings, wheels=not self.holonomic)
        self._arrival = Arrival(self.settings)
        self._robot = robot
        self._feasibility = Feasibility(item, robot, grid, self.track)
        self._strengths: dict[int, Strength] = {}  # of so many robots, for the present target

    def warm_up(self) -> None:
        """Load what is compiled, so that the first command does not wait."""
        middle = self.region.mean(axis=0)
        if self._walls is not None:
            middle = self._walls.into_room(middle[None])[0]
        robots = {str(i): np.array([*(middle + [0.3 * i - 0.6, 0.0]), 0.0]) for i in range(3)}
        self.begin([np.array([*(middle + 0.1), 0.0])])
        self.step(0.0, np.array([*middle, 0.0]), robots, np.array([[*middle, 0.01]]))
        self.end(JobError.NONE, "waiting for a goal")
        self._queue, self.taking_part = TargetQueue(), ()
        self._new_way()

    @property
    def busy(self) -> bool:
        """Whether a job is under way."""
        return self.state is not JobPhase.IDLE

    @property
    def dead(self) -> frozenset[str]:
        """Robots that do not carry out their commands."""
        return frozenset(self._liveness.dead)

    @property
    def turns(self) -> Mapping[str, float]:
        """Turn rates [rad/s], beside the commands of the last step, of robots that move in any
        direction and are tested whether they move at all."""
        return self._liveness.turns if self.busy and self.holonomic else {}

    @property
    def targets(self) -> tuple[Array, ...]:
        """Targets of the job: poses ``(3,)`` of the centre of mass; nan is any heading."""
        return self._queue.poses

    @property
    def index(self) -> int:
        """Index of the target that is pursued; the number of targets if all are reached."""
        return self._queue.index

    @property
    def times(self) -> list[float]:
        """[s] that each target took that was reached."""
        return self._queue.times

    @property
    def target(self) -> Array | None:
        """``(3,)`` that is pursued, or was last."""
        return self._queue.current

    def assess(self, target: Array, pose: Array, robots: Mapping[str, Array]) -> Assessment:
        """Assess a target before it is begun: whether it can be reached, by how many robots, with
        which margin. Arguments as of ``step``; a job that is under way is not touched."""
        return self._feasibility.assess(target, pose, robots)

    def assess_in_slices(
        self, target: Array, pose: Array, robots: Mapping[str, Array]
    ) -> Generator[int, None, Assessment]:
        """``assess`` in slices, see ``Feasibility.slices``."""
        return self._feasibility.slices(target, pose, robots)

    def begin(self, targets: Sequence[Array]) -> None:
        """Take targets, at least one; no job is under way."""
        self._queue, self.error = TargetQueue.of(targets), JobError.NONE
        self.revive()
        self._new_way()
        self.state, self.reason = JobPhase.POSITIONING, "robots gather at the object"

    def retarget(self, target: Array) -> None:
        """The target that is pursued was moved."""
        self._queue.replace_current(target)
        self._changed_target()

    def _changed_target(self) -> None:
        self._arrival.restart()
        self._strengths.clear()
        self._progress.forget()
        if self.track is not None:
            self.track.clear()

    def _new_way(self) -> None:
        self._law.reset()
        self._strengths.clear()
        self._arrival.restart()
        if self.track is not None:
            self.track.clear()

    def end(self, code: JobError, message: str) -> None:
        """End the job under way."""
        if self.busy:
            self.error, self.last = code, None
            self.state, self.reason = JobPhase.IDLE, message

    def revive(self) -> None:
        """Take all robots for alive again, e.g. for a new job or after a reset."""
        self._liveness.revive()

    def believe(self, item: ObjectSpec) -> None:
        """Go on with what is believed of the object now. A way of the object that is under way is
        kept, unless it is that of another centre of mass; the next one is searched for the new
        outline."""
        outline, moved = item.geometry.outline, np.subtract(item.com, self._com)
        self._com = item.com
        if moved.any():
            self._queue.about(moved)
            self._changed_target()
        if not np.array_equal(outline, self._outline):
            self._outline = outline
            self._lever = float(np.hypot(*outline.T).max())
            if self.track is not None:
                self.track.believe(outline)
        self._law.believe(item)
        self._feasibility = Feasibility(item, self._robot, self._grid, self.track)
        self._strengths.clear()

    def errors(self, pose: Array) -> tuple[float, float]:
        """[m], [rad] from the target that is pursued; no heading counts as none off."""
        target = self.target
        return (math.inf, math.inf) if target is None else pose_errors(pose, target)

    def step(
        self,
        now: float,
        pose: Array,
        robots: Mapping[str, Array],
        others: Array,
        mean: Array | None = None,
    ) -> dict[str, tuple[float, float]]:
        """Commands by name: v [m/s], omega [rad/s] of robots on wheels, vx, vy [m/s] in the fixed
        frame of robots that go in any direction (``holonomic``). pose ``(3,)`` of the centre of
        mass; robots: poses by name, of those seen; others ``(k, 3)`` x, y, radius [m] of what else
        stands about. mean ``(2,)`` [m] of all robots, where only some are seen."""
        if not self.busy:
            return dict.fromkeys(robots, (0.0, 0.0))
        if self._queue.begun is None:
            self._queue.begun = now
            self._progress.begin(now)
        self._arrival.see(now, pose)
        whole = mean is None  # else only neighbours are known
        if self._reached(now) or self._given_up(now, pose, robots, whole):
            return dict.fromkeys(robots, (0.0, 0.0))
        tried = self._liveness.try_again(now, robots)
        names = tuple(n for n in robots if n not in self._liveness.dead)
        if not names:
            return {n: tried.get(n, (0.0, 0.0)) for n in robots}
        self.taking_part, poses = names, np.array([robots[n] for n in names])
        still = [[*robots[n][:2], self._radius] for n in robots if n in self._liveness.dead]
        fixed = np.vstack([np.array(still).reshape(-1, 3), others])
        target = self._aim(now, pose, fixed)
        if target is None:
            return dict.fromkeys(robots, (0.0, 0.0))
        scene = Scene(now, pose, poses[:, :2], target, fixed, mean)
        self.last = step = self._law.step(scene)
        self.state, self.reason = _STATES[step.phase]
        velocities = self._spaced(step, poses[:, :2], fixed)
        moved = np.column_stack([velocities, np.zeros(len(velocities))])
        if self._drive is not None:
            moved = self._drive.follow(velocities, poses[:, 2], self.settings.lead)
        contacts = find_contacts(pose, self._outline, poses[:, :2], self._radius, fixed)
        tested = self._liveness.step(now, names, poses, moved, contacts)
        twists = tested[:, :2]
        told = {n: (float(v), float(w)) for n, (v, w) in zip(names, twists, strict=True)}
        told |= tried
        return {n: told.get(n, (0.0, 0.0)) for n in robots}

    def _aim(self, now: float, pose: Array, fixed: Array) -> Array | None:
        """Where the object is to head for: its target, or round walls and what stands about; None
        ends the job."""
        target, track = self.target, self.track
        assert target is not None
        if track is None or (self._walls is None and not len(fixed)):
            if track is not None and track.under_way:
                track.clear()
                self._progress.forget()
            return target
        try:
            aim, fresh = track.follow(now, pose, target, fixed, self._walls is not None)
        except NoObjectWay as error:
            self.end(JobError.PLANNING_FAILED, str(error))
            return None
        if fresh:
            self._progress.allow(track.left(pose))
        return aim

    def _spaced(self, step: SwarmStep, points: Array, fixed: Array) -> Array:
        s, speed = self.settings, self._speed
        bodies = np.vstack([points, fixed[:, :2]])
        radii = np.concatenate([np.full(len(points), self._radius), fixed[:, 2]])
        slowed = _limited(step.velocities, speed)
        if self.track is not None and self.track.holds and step.phase is SwarmPhase.PUSH:
            slowed[:] = 0.0
        bounds = np.column_stack([step.inward, step.most])[None]
        if self._walls is not None:
            walls = self._walls.bounds(points, s.closing, s.apart)
            bounds = np.concatenate([bounds, walls[None]])
        reach = speed / s.closing
        apart = keep_apart(slowed, bodies, radii, s.apart, s.closing, reach, bounds)
        return _limited(apart, speed)

    def _reached(self, now: float) -> bool:
        """Whether the job is over; a target that is reached makes room for the next."""
        while (target := self._queue.current) is not None:
            if not self._arrival.reached(now, target):
                return False
            self._queue.advance(now)
            self._progress.nearest, self._progress.closer = math.inf, now
            self._new_way()
            if self._queue.finished:
                away, turned = pose_errors(self._arrival.estimate, target)
                self.end(JobError.NONE, f"at the goal: {1e3 * away:.1f} mm, {turned:.3f} rad")
                return True
        return False

    def _given_up(self, now: float, pose: Array, robots: Mapping[str, Array], whole: bool) -> bool:
        """Whether the job has ended for want of robots or progress. whole: whether robots are all
        that there are."""
        s, alive = self.settings, sum(n not in self._liveness.dead for n in robots)
        strength = self._strength(pose, alive) if whole and alive else None
        if alive and (strength is None or strength.too_heavy is None):
            self._progress.able = now
        elif now - self._progress.able > s.alone:
            if strength is not None and strength.too_heavy is not None:
                self.end(JobError.TOO_HEAVY, strength.too_heavy)
            else:
                text = "no robot carries out its commands" if robots else "no robot is there"
                self.end(JobError.POSITIONING_FAILED, text)
            return True
        away, turned = self.errors(pose)
        left = away + self._lever * turned
        if self.track is not None and self.track.under_way:
            left = self.track.left(pose)
        self._progress.look(now, left)
        doubt = self._doubt(alive, strength) if whole else ""
        stalled = min(s.stalled, s.doubtful) if doubt else s.stalled
        if now - self._progress.closer > stalled:
            text = f"the object has come no closer than {1e3 * away:.0f} mm and {turned:.2f} rad"
            self.end(JobError.EXECUTION_FAILED, f"{text} for {stalled:g} s{doubt}")
            return True
        return False

    def _doubt(self, robots: int, strength: Strength | None) -> str:
        """The reason why so many robots may fail; empty if there is none."""
        target = self._queue.current
        if target is not None and robots < (least := least_contacts(target)):
            return f"; {too_few(robots, least)}"
        return f"; it {strength}" if strength is not None and strength.thin else ""

    def _strength(self, pose: Array, robots: int) -> Strength:
        """Strength of so many robots; computed once for each number."""
        target = self._queue.current
        assert target is not None
        if robots not in self._strengths:
            self._strengths[robots] = self._feasibility.strength(pose, target, robots)
        return self._strengths[robots]


def _limited(velocities: Array, speed: float) -> Array:
    """Velocities ``(n, 2)``, none of them faster than a speed [m/s]."""
    fast = np.hypot(*velocities.T) / speed
    slowed: Array = velocities / np.maximum(fast, 1.0)[:, None]
    return slowed
