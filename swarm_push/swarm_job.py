"""The job of a swarm: bring an object to one target after another. No ROS, no clock.

Robots may come, leave and die meanwhile: whoever is seen and does as it is told takes part.
"""

import math
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from push_model import se2
from push_model.arrays import Array, Mask
from push_model.drives import HolonomicDrive
from push_model.jobs import JobError, JobPhase
from push_model.object_way import NoObjectWay
from push_model.occupancy import OccupancyGrid
from push_model.outlines import distance
from push_model.settings import bounded, settings
from push_model.specs import ObjectSpec, RobotSpec
from swarm_push.law import Scene, SwarmPhase, SwarmStep
from swarm_push.laws import LawSections, make_law
from swarm_push.liveness import LivenessCheck
from swarm_push.object_track import ObjectTrack, TrackSettings
from swarm_push.spacing import keep_apart
from swarm_push.walls import Walls

_STATES = {
    SwarmPhase.GATHER: (JobPhase.POSITIONING, "robots gather at the object"),
    SwarmPhase.GO_ROUND: (JobPhase.POSITIONING, "robots go round the object"),
    SwarmPhase.REALIGN: (JobPhase.APPROACH, "robots look for hold"),
    SwarmPhase.PUSH: (JobPhase.PUSHING, "robots push"),
}
_CLOSER = 5e-3  # [m] that counts as progress
_AT = 0.01  # [m] of a gap to a robot within which something may hold it up


@settings
class SwarmJobSettings:
    """When a target is reached, when a job is given up, and how robots move."""

    position_tolerance: float = bounded(0.02, low=1e-3, high=10.0, doc="[m] of a target")
    orientation_tolerance: float = bounded(0.05, low=1e-3, high=4.0, doc="[rad] likewise")
    orientation: bool = bounded(True, doc="whether headings of goals matter")
    stalled: float = bounded(90.0, low=1.0, high=3600.0, doc="[s] without coming closer: given up")
    alone: float = bounded(10.0, low=0.0, high=3600.0, doc="[s] without any robot: given up")
    dead: float = bounded(2.0, low=0.1, high=60.0, doc="[s] that a robot may not do as told")
    dead_way: float = bounded(0.1, low=1e-3, high=10.0, doc="[m] that it should have gone then")
    jammed: float = bounded(6.0, low=0.1, high=600.0, doc="[s] likewise of one that is touched")
    again: float = bounded(30.0, low=1.0, high=1e6, doc="[s] until such a robot is tried again")
    apart: float = bounded(4e-3, low=0.0, high=1.0, doc="[m] between robots")
    closing: float = bounded(3.0, low=0.01, high=100.0, doc="[1/s] of gaps between robots")
    lead: float = bounded(0.025, low=1e-3, high=1.0, doc="[m] of the controlled point ahead")


class SwarmJob:
    """One job at a time of robots of one type.

    state, reason, error: as in JobState. targets: of the job, poses ``(3,)`` of the centre of mass,
    headings nan where any will do; index: of the one under way; times: [s] that each took. last:
    what the last tick came from, and taking_part: the robots that it is about. region: as given.
    holonomic: whether robots go in any direction.
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
        walls, self._walls, self.track = None, None, None
        if grid is not None:
            walls = Walls(grid, self._radius)
            self._walls = None if walls.open else walls
            track = track or TrackSettings()
            self.track = ObjectTrack(walls.space.field, item.geometry.outline, self._radius, track)
        self._make_law = partial(
            make_law,
            laws or LawSections(),
            region,
            radius=self._radius,
            speed=self._speed,
            walls=walls,
        )
        self._law = self._make_law(item)
        self._outline = item.geometry.outline
        self._lever = float(np.hypot(*self._outline.T).max())
        self.state, self.reason, self.error = JobPhase.IDLE, "waiting for a goal", JobError.NONE
        self.targets: tuple[Array, ...] = ()
        self.index = 0
        self.times: list[float] = []
        self.last: SwarmStep | None = None
        self.taking_part: tuple[str, ...] = ()
        s, wheels = self.settings, not self.holonomic
        self._liveness = LivenessCheck(s.dead, s.dead_way, s.jammed, s.again, wheels)
        self._begun: float | None = None
        self._nearest = math.inf
        self._progress = self._seen = 0.0

    def warm_up(self) -> None:
        """Load what is compiled, so that the first command does not wait."""
        middle = self.region.mean(axis=0)
        if self._walls is not None:
            middle = self._walls.into_room(middle[None])[0]
        robots = {str(i): np.array([*(middle + [0.3 * i - 0.6, 0.0]), 0.0]) for i in range(3)}
        self.begin([np.array([*(middle + 0.1), 0.0])])
        self.step(0.0, np.array([*middle, 0.0]), robots, np.array([[*middle, 0.01]]))
        self.end(JobError.NONE, "waiting for a goal")
        self.targets, self.taking_part = (), ()
        self._new_way()

    @property
    def busy(self) -> bool:
        """Whether a job is under way."""
        return self.state is not JobPhase.IDLE

    @property
    def dead(self) -> frozenset[str]:
        """Robots that do not do as they are told."""
        return frozenset(self._liveness.dead)

    @property
    def target(self) -> Array | None:
        """``(3,)`` that is pursued, or was last."""
        return self.targets[min(self.index, len(self.targets) - 1)] if self.targets else None

    def begin(self, targets: Sequence[Array]) -> None:
        """Take targets, at least one; no job is under way."""
        self.targets = tuple(np.array(t, dtype=np.float64) for t in targets)
        self.error, self.index, self.times = JobError.NONE, 0, []
        self._begun = None
        self.revive()
        self._new_way()
        self.state, self.reason = JobPhase.POSITIONING, "robots gather at the object"

    def retarget(self, target: Array) -> None:
        """The target that is pursued was moved."""
        moved = np.array(target, dtype=np.float64)
        self.targets = (*self.targets[: self.index], moved, *self.targets[self.index + 1 :])
        self._nearest = math.inf
        if self.track is not None:
            self.track.clear()

    def _new_way(self) -> None:
        self._law.reset()
        if self.track is not None:
            self.track.clear()

    def end(self, code: JobError, message: str) -> None:
        """End the job under way."""
        if self.busy:
            self.error, self.last = code, None
            self.state, self.reason = JobPhase.IDLE, message

    def revive(self) -> None:
        """Believe in all robots again: a new job, a reset world, or somebody saw to them."""
        self._liveness.revive()

    def believe(self, item: ObjectSpec) -> None:
        """Go on with another object than before: the law is made anew for it, and the way where
        its outline is another one."""
        outline = item.geometry.outline
        if not np.array_equal(outline, self._outline):
            self._outline = outline
            self._lever = float(np.hypot(*outline.T).max())
            if self.track is not None:
                track = self.track
                self.track = ObjectTrack(track.field, outline, self._radius, track.settings)
        self._law = self._make_law(item)

    def errors(self, pose: Array) -> tuple[float, float]:
        """[m], [rad] from the target that is pursued; no heading counts as none off."""
        target = self.target
        if target is None:
            return math.inf, math.inf
        turn = 0.0 if math.isnan(target[2]) else abs(se2.wrap(float(pose[2] - target[2])))
        return math.hypot(pose[0] - target[0], pose[1] - target[1]), turn

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
        if self._begun is None:
            self._begun = self._progress = self._seen = now
            self._nearest = math.inf
        if self._reached(now, pose) or self._given_up(now, pose, robots):
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
        twists, moved = velocities, np.column_stack([velocities, np.zeros(len(velocities))])
        if self._drive is not None:
            twists = moved = self._drive.follow(velocities, poses[:, 2], self.settings.lead)
        touched = self._touched(pose, poses[:, :2], fixed)
        tested = self._liveness.step(now, names, poses, moved, touched)
        twists = tested if self._drive is not None else twists
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
                self._nearest = math.inf
            return target
        try:
            aim, fresh = track.follow(now, pose, target, fixed, self._walls is not None)
        except NoObjectWay as error:
            self.end(JobError.PLANNING_FAILED, str(error))
            return None
        if fresh:
            self._nearest = max(self._nearest, track.left(pose))
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

    def _reached(self, now: float, pose: Array) -> bool:
        """Whether the job is over; a target that is reached makes room for the next."""
        s = self.settings
        while True:
            away, turned = self.errors(pose)
            if away > s.position_tolerance or turned > s.orientation_tolerance:
                return False
            assert self._begun is not None
            self.times.append(now - self._begun - sum(self.times))
            self.index += 1
            self._nearest, self._progress = math.inf, now
            self._new_way()
            if self.index >= len(self.targets):
                self.end(JobError.NONE, f"at the goal: {1e3 * away:.1f} mm, {turned:.3f} rad")
                return True

    def _given_up(self, now: float, pose: Array, robots: Mapping[str, Array]) -> bool:
        s = self.settings
        alive = [n for n in robots if n not in self._liveness.dead]
        if alive:
            self._seen = now
        elif now - self._seen > s.alone:
            text = "no robot does as it is told" if robots else "there is no robot"
            self.end(JobError.POSITIONING_FAILED, text)
            return True
        away, turned = self.errors(pose)
        left = away + self._lever * turned
        if self.track is not None and self.track.under_way:
            left = self.track.left(pose)
        if left < self._nearest - _CLOSER:
            self._nearest, self._progress = left, now
        if now - self._progress > s.stalled:
            text = f"the object has come no closer than {1e3 * away:.0f} mm and {turned:.2f} rad"
            self.end(JobError.EXECUTION_FAILED, f"{text} for {s.stalled:g} s")
            return True
        return False

    def _touched(self, pose: Array, points: Array, fixed: Array) -> Mask:
        """Which robots something is at, so that they may be held up whatever they are told."""
        near = self._radius + _AT
        radii = np.concatenate([np.full(len(points), self._radius), fixed[:, 2]])
        tree = cKDTree(points)
        touched = np.zeros(len(points), dtype=np.bool_)
        for i, j in tree.query_pairs(near + self._radius):
            touched[[i, j]] = True
        if len(fixed):
            away = np.hypot(*(points[:, None] - fixed[None, :, :2]).transpose(2, 0, 1))
            touched |= (away < near + radii[len(points) :]).any(axis=1)
        local = se2.transform(se2.inverse(pose), points)
        close = np.hypot(*local.T) < self._lever + near
        touched[close] |= distance(self._outline, local[close]) < near
        return touched


def _limited(velocities: Array, speed: float) -> Array:
    """Velocities ``(n, 2)``, none of them faster than a speed [m/s]."""
    fast = np.hypot(*velocities.T) / speed
    slowed: Array = velocities / np.maximum(fast, 1.0)[:, None]
    return slowed
