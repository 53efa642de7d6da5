"""Discs that push an object as one rigid formation, without a look at it: the simulation of 3.1.4.

As a method it runs in the graph by the name ``NAME``.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from grasp_opt.contact_outline import Contacts
from grasp_opt.metrics import displacement, energy
from grasp_opt.object_trajectory import ObjectTrajectory, sampled
from push_job.method import Arena, Certificate, Command, MethodSpec, Refusal, Seen, Task, Told
from push_job.report import Figure, Report, Status, polyline
from push_model import se2
from push_model.arrays import Array
from push_model.belief import Belief
from push_model.bumpers import RingBumper
from push_model.drives import HolonomicDrive
from push_model.jobs import JobError, JobPhase
from push_model.outlines import distance, inside
from push_model.settings import SettingsError, bounded, settings
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_scenario.bodies import load_robot
from push_study.given_grasp import task_along
from push_study.graph_run import LockstepRun
from push_study.team_run import Outcome, made_scenario, run_team
from push_study.uncertainty import Uncertainty

NAME = f"{__name__}:METHOD"
"""As ``run_team`` takes it."""
_EXACT = Uncertainty(0.0, 0.0, 50.0, (0.0, 0.0), spread=0.0)
"""Poses as they are, 50 times a second: what is asked is what a grasp does, not who sees what."""
_STRONG = 60.0  # [N] of a pusher's traction: it goes where it is told
_TOUCH = 1e-4  # [m] between pusher and object at the beginning
_KEPT = 2e-3  # [m] up to which a contact counts as kept
_TRANSPORTED = 0.01  # [m] from its trajectory up to which an object counts as transported along it
_MARGIN = 0.8  # [m] about the trajectory
_LIMIT = 400.0  # [s]


@dataclass(frozen=True)
class FormationPush:
    """What became of a push.

    displacement: delta of (3.2), over the length of the trajectory. energy: E of (3.3) [N].
    success: whether every pusher kept its contact, from half a second on, and the object its
    trajectory. widest: [m] greatest gap then. astray: [m] greatest distance from where the object
    was to be. position, orientation: [m], [rad] of it at the end. objects ``(t, 3)``, agents ``(t,
    n, 2)``; forces ``(t - 1, n, 2)`` [N] on the object. outcome: of the run.
    """

    displacement: float
    energy: float
    success: bool
    widest: float
    astray: float
    position: float
    orientation: float
    objects: Array
    agents: Array
    forces: Array
    outcome: Outcome


def pusher(radius: float) -> RobotSpec:
    """A disc of a radius [m] that moves as it is told."""
    disc = load_robot("disc")
    assert isinstance(disc.drive, HolonomicDrive) and isinstance(disc.bumper, RingBumper)
    return replace(
        disc,
        body_radius=min(disc.body_radius, radius),
        bumper=replace(disc.bumper, radius=radius),
        drive=replace(disc.drive, max_force=_STRONG, max_speed=1.0),
    )


@settings
class FormationSettings:
    """Where the discs are about the object's centre of mass, in its frame."""

    x: tuple[float, ...] = bounded(
        (0.0,),
        low=-100.0,
        high=100.0,
        doc="Coordinates x of the discs of the formation in the object's frame (m).",
    )
    y: tuple[float, ...] = bounded(
        (0.0,),
        low=-100.0,
        high=100.0,
        doc="Coordinates y of the discs of the formation in the object's frame (m).",
    )
    tick: float = bounded(
        0.02,
        low=1e-3,
        high=1.0,
        doc="Time from a command until a disc of the formation is at its place (s).",
    )

    def __post_init__(self) -> None:
        if len(self.x) != len(self.y):
            raise SettingsError(
                f"x and y must have the same number of values, got {len(self.x)} and {len(self.y)}"
            )


class Formation:
    """Moves every disc to where its place is at the next frame, were the object on its trajectory.

    began: [s] of the frame at which the last task began; nan before the first one.
    """

    def __init__(self, arena: Arena) -> None:
        self._arena, self._settings = arena, arena.section("", FormationSettings)
        self._places = np.column_stack([self._settings.x, self._settings.y])
        self._trajectory: ObjectTrajectory | None = None
        self._busy, self._code, self._reason = False, JobError.NONE, "waiting for a trajectory"
        self._time = 0.0  # [s] along the trajectory
        self.began = math.nan

    @property
    def status(self) -> Status:
        """See Method."""
        phase = JobPhase.PUSHING if self._busy else JobPhase.IDLE
        whole = 1.0 if self._trajectory is None else self._trajectory.duration
        progress = min(1.0, self._time / whole) if self._busy else 1.0
        return Status(int(phase), phase.name, self._reason, int(self._code), progress)

    def assess(self, task: Task, belief: Belief, seen: Seen | None) -> Certificate | Refusal:
        """See Method: a trajectory for as many discs as there are places."""
        count, places = len(self._arena.robots), len(self._places)
        if not task.times:
            return Refusal(JobError.INVALID_GOAL, "a formation follows a trajectory; give one")
        if count != places:
            text = f"the formation has {places} places for {count} robots"
            return Refusal(JobError.INVALID_GOAL, text)
        return Certificate(robots=count, seconds=task.times[-1])

    def begin(self, task: Task, belief: Belief) -> None:
        """See Method."""
        item, pose = belief.object(self._arena.object), np.array(task.targets)
        centres = np.array([item.mass_pose(p)[:2] for p in pose])
        self._trajectory = sampled(np.array(task.times), np.column_stack([centres, pose[:, 2]]))
        self._busy, self._code, self._reason = True, JobError.NONE, "the formation pushes"
        self.began, self._time = math.nan, 0.0

    def step(self, seen: Seen, belief: Belief) -> Told:
        """See Method."""
        path, names, tick = self._trajectory, tuple(self._arena.robots), self._settings.tick
        if path is None or any(n not in seen.robots for n in names):
            return Told()
        if math.isnan(self.began):
            self.began = seen.time
        self._time = seen.time - self.began
        if self._time >= path.duration - 1e-9:
            self.end(JobError.NONE, "at the end of the trajectory")
            return Told()
        before, after = path.sample(self._time), path.sample(self._time + tick)
        places = se2.transform(after, self._places)
        # A disc that did not turn with the formation would roll along the object's side.
        turn = float(after[2] - before[2]) / tick
        commands: dict[str, Command] = {}
        for name, place in zip(names, places, strict=True):
            vx, vy = (place - seen.robots[name][:2]) / tick
            commands[name] = (float(vx), float(vy), turn)
        return Told(commands)

    def report(self, seen: Seen) -> Report | None:
        """See Method."""
        if self._trajectory is None or not self._busy:
            return None
        here = self._arena.item.mass_pose(seen.object)
        off = se2.between(self._trajectory.sample(self._time), here)
        figure = Figure("position error", float(np.hypot(off[0], off[1])), "m")
        return Report("push", (figure,), (polyline("way", self._trajectory.pose[:, :2]),))

    def end(self, code: JobError, reason: str) -> None:
        """See Method."""
        if self._busy:
            self._busy, self._code, self._reason = False, code, reason

    def revive(self) -> None:
        """See Method: nobody is known to fail."""

    def release(self) -> frozenset[str]:
        """See Method."""
        return frozenset() if self._busy else frozenset(self._arena.robots)

    def errors(self, seen: Seen) -> tuple[float, float]:
        """See Method."""
        if self._trajectory is None:
            return math.inf, math.inf
        off = se2.between(self._trajectory.pose[-1], self._arena.item.mass_pose(seen.object))
        return float(np.hypot(off[0], off[1])), abs(float(off[2]))

    def facts(self) -> Mapping[str, Any]:
        """See Method."""
        return {"places": len(self._places)}


def check_discs(robots: Mapping[str, RobotSpec], item: ObjectSpec) -> None:
    """Raise SettingsError unless all robots move in any direction."""
    if not all(isinstance(r.drive, HolonomicDrive) for r in robots.values()):
        raise SettingsError("has robots on wheels; a formation needs holonomic robots")


METHOD = MethodSpec("formation", Formation, {"": FormationSettings}, check_discs, "group-ellipse")


def push(
    item: ObjectSpec,
    contacts: Contacts,
    trajectory: ObjectTrajectory,
    radius: float,
    world: str = "pybullet",
) -> FormationPush:
    """Push an object along a trajectory with discs at its contacts, in the graph.

    contacts, trajectory: about the centre of mass. radius: [m] of the discs. world: its kind.
    """
    low, high = trajectory.pose[:, :2].min(axis=0), trajectory.pose[:, :2].max(axis=0)
    size = 2.0 * (np.maximum(np.abs(low), np.abs(high)) + _MARGIN)
    room = EnvironmentSpec((float(size[0]), float(size[1])), resolution=0.05)
    places, start = contacts.centres(radius), trajectory.pose[0]
    at_start = se2.transform(start, contacts.centres(radius + _TOUCH))
    starts = np.column_stack([at_start, np.zeros(len(places))])
    own = {"x": places[:, 0].tolist(), "y": places[:, 1].tolist(), "tick": 1.0 / _EXACT.rate}
    begin = item.geometric_pose(start)
    scenario = made_scenario("formation", room, pusher(radius), starts, item, begin, {NAME: own})
    times, tables, methods = [], [], []

    def watch(run: LockstepRun, now: float, poses: Array) -> None:
        methods.append(run.supervisor.method)
        times.append(now)
        tables.append(poses)

    outcome = run_team(
        NAME, scenario, task_along(trajectory, item), _EXACT, 0, _LIMIT, watch, world
    )
    if outcome.code is not JobError.NONE:
        raise RuntimeError(outcome.reason)
    began = methods[-1].began
    since = np.array(times) - began
    pushing = (since > -1e-6) & (since < trajectory.duration + 0.5 / _EXACT.rate + 1e-6)
    return _judged(
        item,
        contacts,
        trajectory,
        radius,
        since[pushing],
        np.array(tables)[pushing],
        began,
        outcome,
    )


def _judged(
    item: ObjectSpec,
    contacts: Contacts,
    trajectory: ObjectTrajectory,
    radius: float,
    time: Array,
    poses: Array,
    began: float,
    outcome: Outcome,
) -> FormationPush:
    """What a run amounts to, from time ``(t,)`` [s] along the trajectory and poses ``(t, 1 + n,
    3)`` of object and discs; began: [s] of its first frame."""
    way = np.array([item.mass_pose(p) for p in poses[:, 0]])
    agents = poses[:, 1:, :2]
    since = np.array(outcome.trace.force_times) - began
    felt = np.array(outcome.trace.forces)[(since > time[0] + 1e-6) & (since < time[-1] + 1e-6)]
    wanted = np.array([trajectory.sample(t) for t in time])
    astray = float(np.hypot(*(way - wanted)[:, :2].T).max())
    late = time > 0.5
    gaps = [_gaps(item, p, a, radius).max() for p, a in zip(way[late], agents[late], strict=True)]
    widest = float(max(gaps, default=0.0))
    off = se2.between(trajectory.pose[-1], way[-1])
    moved = float(np.hypot(*np.diff(way[:, :2], axis=0).T).sum()) > 0.05
    return FormationPush(
        _slid(way, agents, trajectory.length),
        energy(way, contacts.points, felt) if moved else float("nan"),
        widest <= _KEPT and astray <= _TRANSPORTED,
        widest,
        astray,
        float(np.hypot(*off[:2])),
        abs(float(off[2])),
        way,
        agents,
        felt,
        outcome,
    )


def _slid(objects: Array, agents: Array, length: float) -> float:
    """(3.2) over the length of the trajectory that was asked for."""
    travelled = float(np.hypot(*np.diff(objects[:, :2], axis=0).T).sum())
    return displacement(objects, agents) * travelled / length if travelled > 0.0 else float("inf")


def _gaps(item: ObjectSpec, pose: Array, agents: Array, radius: float) -> Array:
    """``(n,)`` [m] between discs and object, 0 where they overlap."""
    outline = item.geometry.outline
    local = se2.transform(se2.inverse(pose), agents)
    away = distance(outline, local)
    away[inside(outline, local)] *= -1.0
    return np.maximum(0.0, away - radius)
