"""Rooms in which robots push an object to a goal: the core of all environments, many rooms at once.

No Gymnasium here: arrays in, arrays out. Every room has a generator of its own, so that what is
drawn in one does not depend on the others.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from push_gym.draws import Draws
from push_gym.settings import EnvSettings, changed_object
from push_model.arrays import Array, Mask, Rows
from push_model.drives import TorqueDrive
from push_model.settings import SettingsError
from push_model.specs import ObjectSpec
from sim_bridge.planar_batch import PlanarBatch
from sim_bridge.planar_world import PlanarSettings

PER_BODY = 7
"""Numbers of a body: x, y [m], cosine and sine of its heading, vx, vy [m/s], omega [rad/s] of its
centre of mass, world frame."""
FASTEST = 10.0
"""[m/s], and 10 of it [rad/s]: speeds that are shown at most."""
PER_GOAL = 4
"""Numbers of a goal: x, y, cosine and sine; only x and y where headings do not matter."""
OPTIONS = ("object", "start", "robots", "goal")
"""What the options of a reset may say: another object (a name, or fields that replace its own),
and poses of the object, of all robots and of the goal."""


@dataclass(frozen=True)
class Beginning:
    """Of episodes in some rooms. draws: for the object. poses: ``(rooms, robots + 1, 3)``, the
    object last. goals: ``(rooms, 3)``. World frame [m, m, rad]."""

    item: ObjectSpec
    draws: Draws
    poses: Array
    goals: Array


class PushArena:
    """``count`` rooms. Poses are world frame [m, m, rad]."""

    def __init__(self, count: int, settings: EnvSettings) -> None:
        """Raises SettingsError."""
        self.count, self.settings = count, settings
        self.robot, self.environment = settings.robot_spec, settings.environment
        if isinstance(self.robot.drive, TorqueDrive):
            raise SettingsError(
                "robot: its wheels are driven by torque, which these environments do not simulate; "
                "use epuck, epuck_ring, disc, or another robot with a drive of these kinds"
            )
        self.goals = np.zeros((count, 3))
        self.times = np.zeros(count)
        self.headings = settings.orientation_tolerance is not None
        self._speeds = FASTEST * np.array([1.0, 1.0, 10.0])
        item = settings.object_spec
        self._build(item, Draws(self.environment, self.robot, item))

    def _build(self, item: ObjectSpec, draws: Draws) -> None:
        s = self.settings
        steps = max(1, math.ceil(s.period / s.time_step - 1e-9))
        physics = PlanarSettings(time_step=s.period / steps)
        robots = [self.robot] * s.robots
        self.world = PlanarBatch(self.count, self.environment, robots, [item], physics)
        self.item, self._draws, self._steps = item, draws, steps
        self.lever = math.sqrt(item.geometry.inertia_per_mass)

    @property
    def goal_size(self) -> int:
        """Numbers of a goal."""
        return PER_GOAL if self.headings else 2

    def bounds(self) -> tuple[Array, Array]:
        """The greatest size of every number of the state ``(7 robots + 7,)`` and of a goal."""
        place = np.array([*np.array(self.environment.size), 1.0, 1.0])
        body = np.concatenate([place, self._speeds])
        return np.tile(body, self.settings.robots + 1), place[: self.goal_size]

    def reset(
        self, rooms: Rows, randoms: list[np.random.Generator], options: dict[str, Any] | None = None
    ) -> None:
        """Begin anew in some rooms, as ``drawn`` says. It raises SettingsError, and then changes
        nothing."""
        self.begin(rooms, self.drawn(rooms, randoms, options))

    def drawn(
        self, rooms: Rows, randoms: list[np.random.Generator], options: dict[str, Any] | None = None
    ) -> Beginning:
        """How to begin anew in some rooms, each with its generator. options: see ``OPTIONS``; an
        object is that of all rooms from then on.

        Raises
        ------
        SettingsError: an unknown option, poses of a wrong shape, bodies that do not fit.
        """
        if options is not None and not isinstance(options, Mapping):
            raise SettingsError(f"options: expected a mapping, got {options!r}")
        told = dict(options or {})
        for name in told:
            if name not in OPTIONS:
                known = ", ".join(OPTIONS)
                raise SettingsError(f"options: unknown key '{name}'; known: {known}")
        item, draws = self.item, self._draws
        if "object" in told:
            item = changed_object(self.item, told["object"])
            if item != self.item:
                if len(rooms) < self.count:
                    raise SettingsError("options: another object needs a reset of all rooms")
                draws = Draws(self.environment, self.robot, item)
        n = self.settings.robots
        poses, goals = np.empty((len(rooms), n + 1, 3)), np.empty((len(rooms), 3))
        for k, random in enumerate(randoms):
            start = _poses(told, "start", (3,))
            start = draws.object(random) if start is None else start
            robots = _poses(told, "robots", (n, 3))
            poses[k, :n] = draws.robots(random, n, start) if robots is None else robots
            goal = _poses(told, "goal", (3,))
            goals[k] = draws.object(random) if goal is None else goal
            poses[k, n] = start
            if told:
                draws.check(start, "start")
                draws.check(goals[k], "goal")
                draws.check_robots(poses[k, :n], start)
        return Beginning(item, draws, poses, goals)

    def begin(self, rooms: Rows, beginning: Beginning) -> None:
        """Begin anew in some rooms as it was drawn for them."""
        if beginning.item != self.item:
            self._build(beginning.item, beginning.draws)
        self.world.place(rooms, beginning.poses)
        self.goals[rooms] = beginning.goals
        self.times[rooms] = 0.0

    def step(self, twists: Array, still: Mask | None = None) -> None:
        """One period with twists ``(count, robots, 3)`` in the robots' frames. Rooms of the mask
        stand still."""
        self.world.command(twists)
        self.world.step(self._steps, still)
        self.times += self.settings.period if still is None else self.settings.period * ~still

    def observations(self) -> tuple[Array, Array, Array]:
        """State ``(count, 7 robots + 7)``, achieved and desired goal ``(count, goal size)``."""
        poses, moved, n = self.world.poses, self.world.velocities, self.settings.robots
        shown = np.clip(moved, -self._speeds, self._speeds)
        bodies = np.concatenate([_with_direction(poses), shown], axis=-1)
        size = self.goal_size
        achieved, desired = bodies[:, n, :size], _with_direction(self.goals)[:, :size]
        return bodies.reshape(self.count, -1), achieved, desired

    def costs(self, achieved: Array, desired: Array) -> Array:
        """``(…,)`` [m] distance from the goal, turned by 1 rad as far as the radius of gyration."""
        away, turned = _errors(achieved, desired)
        return away + self.lever * turned

    def reached(self, achieved: Array, desired: Array) -> Mask:
        """``(…,)`` whether an achieved goal counts as the desired one."""
        away, turned = _errors(achieved, desired)
        there: Mask = away < self.settings.position_tolerance
        if self.settings.orientation_tolerance is not None:
            there &= turned < self.settings.orientation_tolerance
        return there

    def rewards(self, achieved: Array, desired: Array) -> Array:
        """``(…,)`` of a step that ended at an achieved goal."""
        if self.settings.reward == "sparse":
            return np.where(self.reached(achieved, desired), 0.0, -1.0)
        return -self.costs(achieved, desired)

    def late(self) -> Mask:
        """``(count,)`` rooms whose time is over."""
        over: Mask = self.times >= self.settings.horizon - 1e-9
        return over


def _with_direction(poses: Array) -> Array:
    """x, y, cosine, sine ``(…, 4)`` of poses ``(…, 3)``."""
    turns = np.stack([np.cos(poses[..., 2]), np.sin(poses[..., 2])], axis=-1)
    return np.concatenate([poses[..., :2], turns], axis=-1)


def _errors(achieved: Array, desired: Array) -> tuple[Array, Array]:
    """[m], [rad] of goals ``(…, 4)`` or ``(…, 2)``."""
    a, d = np.asarray(achieved, dtype=np.float64), np.asarray(desired, dtype=np.float64)
    away = np.hypot(a[..., 0] - d[..., 0], a[..., 1] - d[..., 1])
    if a.shape[-1] == 2:
        return away, np.zeros_like(away)
    cross = d[..., 2] * a[..., 3] - d[..., 3] * a[..., 2]
    dot = d[..., 2] * a[..., 2] + d[..., 3] * a[..., 3]
    return away, np.abs(np.arctan2(cross, dot))


def _poses(told: dict[str, Any], name: str, shape: tuple[int, ...]) -> Array | None:
    if name not in told:
        return None
    try:
        poses = np.asarray(told[name], dtype=np.float64)
    except (TypeError, ValueError):
        poses = np.full(0, np.nan)
    if poses.shape != shape or not np.isfinite(poses).all():
        raise SettingsError(f"options: {name}: expected finite numbers of shape {shape}")
    return poses
