"""Several objects, one robot: in which order to push them, and what to push out of the way first.

The task is that of ReloPush (Ahn & Mavrogiannis, arXiv 2409.18231): every object has a goal, all
stand in each other's way, and the robot moves one at a time. The answer is a list of moves. Each
move brings one object to its goal or, out of the way, to another place.

The search goes through the moves in depth. At each step it plans pushes for the objects that are
not at their goals, cheapest estimate first, among all the others as they stand then; the first one
with a plan is moved. If none has a plan, an object in the way of another one is moved aside,
to the nearest place from which it blocks neither that way nor a goal. If that fails too, the search
goes back and tries the next object of the step before. A move is only taken if the pushes are
planned (``PushPlanner``, the first plan; a plan for execution is made when the move begins).
"""

import math
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NoReturn

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.distance_field import DistanceField
from push_model.settings import SettingsError, bounded, settings
from push_model.specs import ObjectSpec, RobotSpec
from push_planner.among_bodies import planner_among
from push_planner.planner import PushPlanner
from push_planner.push_plan import PlanError, PlanningFailed, Progress, PushPlan
from push_planner.refusal import check_pose
from push_planner.settings import PlannerSettings

_SAMPLES = 8  # directions in which an object is moved aside, at each distance


@settings
class RearrangementSettings:
    """How a rearrangement is planned."""

    position_tolerance: float = bounded(
        0.012,
        low=1e-4,
        high=1.0,
        doc="An object counts as at its goal if it is at most this far from it (m), and if its "
        "heading is within orientation_tolerance.",
    )
    orientation_tolerance: float = bounded(
        0.05,
        low=1e-4,
        high=3.2,
        doc="Greatest angle between the headings of an object and of its goal at which the object "
        "counts as at its goal (rad).",
    )
    aside: tuple[float, ...] = bounded(
        (0.15, 0.25, 0.4, 0.6),
        doc="Distances by which an object that blocks the path of another one is moved (m), "
        "nearest first.",
    )
    max_plans: int = bounded(
        200,
        low=1,
        high=100000,
        doc="Number of moves for which pushes are planned before the search gives up.",
    )

    max_failures: int = bounded(
        3,
        low=0,
        high=100,
        doc="Maximum number of times that the moves are planned again, because a move has failed "
        "or an object is not at its goal after the last move.",
    )

    def __post_init__(self) -> None:
        if not self.aside or not all(0.0 < d < 100.0 for d in self.aside):
            raise SettingsError(f"aside: expected positive distances, got {self.aside}")

    def reached(self, pose: Array, goal: Array) -> bool:
        """Whether an object at a pose ``(3,)`` need not be moved to its goal ``(3,)``."""
        off = se2.between(goal, pose)
        near = float(np.hypot(off[0], off[1])) <= self.position_tolerance
        return near and abs(float(off[2])) <= self.orientation_tolerance


@dataclass(frozen=True)
class Move:
    """One object to one pose.

    start, goal: ``(3,)`` [m, m, rad] of the object's geometric frame. plan: the pushes that were
    found; when the move begins, it is planned anew. aside: whether the pose is not the object's
    goal.
    """

    object: str
    start: Array
    goal: Array
    plan: PushPlan
    aside: bool = False


@dataclass(frozen=True)
class Arrangement:
    """The state between two moves: poses ``(3,)`` of the objects by name, and of the robot."""

    poses: Mapping[str, Array]
    robot: Array | None


_Search = Generator[str, None, list[Move] | None]


class Rearrangement:
    """Plans moves of the objects of one map by one robot. plans: tried so far."""

    def __init__(
        self,
        settings: RearrangementSettings,
        planner_settings: PlannerSettings,
        field: DistanceField,
        robot: RobotSpec,
        items: Mapping[str, ObjectSpec],
    ) -> None:
        """items: every object on the map, by name, also those that have no goal.

        Raises
        ------
        SettingsError: the robot cannot push, see ``PushPlanner``.
        """
        self._settings, self._robot = settings, robot
        self._items = dict(items)
        self._planners: dict[ObjectSpec, PushPlanner] = {}
        for item in items.values():
            if item not in self._planners:
                self._planners[item] = PushPlanner(planner_settings, field, robot, item)
        self._reach = {name: item.geometry.circumradius for name, item in items.items()}
        self._gap = 2.0 * planner_settings.safety_distance + robot.footprint_radius
        self.plans = 0

    def check(self, goals: Mapping[str, Array]) -> None:
        """Refuse goals ``(3,)`` [m, m, rad] of the geometric frames that cannot be.

        Raises
        ------
        PlanningFailed: a goal in a wall, outside the map, or two goals that overlap.
        """
        for name, goal in goals.items():
            check_pose(self._planner(name).scene, goal, f"goal of '{name}'", _OCCUPIED)
        names = list(goals)
        for i, one in enumerate(names):
            for two in names[i + 1 :]:
                apart, least = self._apart(goals, one, two), self._reach[one] + self._reach[two]
                if apart < least:
                    text = (
                        f"the goals of '{one}' and '{two}' are {1e3 * apart:.0f} mm apart; they "
                        f"must be at least {1e3 * least:.0f} mm apart, so that the circles around "
                        "the two objects do not overlap"
                    )
                    raise PlanningFailed(_OCCUPIED, text)

    def plan(
        self, poses: Mapping[str, Array], goals: Mapping[str, Array], robot: Array | None
    ) -> Generator[str, None, list[Move]]:
        """The moves, by a generator that works in slices and yields what it is doing.

        Parameters
        ----------
        poses: ``(3,)`` [m, m, rad] where every object stands. goals: of some or all of them.
        robot: ``(3,)`` its pose; None if unknown.

        Raises
        ------
        PlanningFailed: there is no such goal, see ``check``; or no order was found.
        """
        self.check(goals)
        self.plans = 0
        state = Arrangement({n: np.array(p) for n, p in poses.items()}, robot)
        left = frozenset(n for n in goals if not self._settings.reached(poses[n], goals[n]))
        moves = yield from self._order(state, goals, left, frozenset())
        if moves is None:
            self._give_up(left)
        return moves

    def solve(
        self, poses: Mapping[str, Array], goals: Mapping[str, Array], robot: Array | None = None
    ) -> list[Move]:
        """The moves of ``plan``, at once."""
        work = self.plan(poses, goals, robot)
        while True:
            try:
                next(work)
            except StopIteration as end:
                moves: list[Move] = end.value
                return moves

    # The search

    def _order(
        self,
        state: Arrangement,
        goals: Mapping[str, Array],
        left: frozenset[str],
        moved: frozenset[str],
    ) -> _Search:
        """The moves that bring what is left to its goals; None if none are found.

        moved: objects that were moved aside since the last one reached its goal.
        """
        if not left:
            return []
        for name in sorted(left, key=lambda n: _guess(state, goals, n)):
            step = yield from self._try(state, name, goals[name])
            if step is None:
                continue
            move, after = step
            rest = yield from self._order(after, goals, left - {name}, frozenset())
            if rest is not None:
                return [move, *rest]
        return (yield from self._clear(state, goals, left, moved))

    def _clear(
        self,
        state: Arrangement,
        goals: Mapping[str, Array],
        left: frozenset[str],
        moved: frozenset[str],
    ) -> _Search:
        """Move something aside, so that one of those that are left can reach its goal."""
        for name in sorted(left, key=lambda n: _guess(state, goals, n)):
            for other in self._blockers(state, goals, name):
                if other in moved:
                    continue
                without = replace(state, poses={n: p for n, p in state.poses.items() if n != other})
                if (yield from self._try(without, name, goals[name])) is None:
                    continue
                for place in self._places(state, goals, other):
                    step = yield from self._try(state, other, place, aside=True)
                    if step is None:
                        continue
                    move, after = step
                    if (yield from self._try(after, name, goals[name])) is None:
                        continue
                    waiting = left | ({other} if other in goals else frozenset())
                    rest = yield from self._order(after, goals, waiting, moved | {other})
                    if rest is not None:
                        return [move, *rest]
        return None

    def _try(
        self, state: Arrangement, name: str, goal: Array, aside: bool = False
    ) -> Generator[str, None, tuple[Move, Arrangement] | None]:
        """The move of one object among the others, and what it leads to; None without a plan."""
        if self.plans >= self._settings.max_plans:
            return None
        start = state.poses[name]
        where = {**state.poses, name: goal}
        if any(
            self._apart(where, name, n) < self._reach[name] + self._reach[n]
            for n in state.poses
            if n != name
        ):
            return None
        self.plans += 1
        circles = [[*p[:2], self._reach[n]] for n, p in state.poses.items() if n != name]
        planner = planner_among(self._planner(name), start, np.array(circles).reshape(-1, 3))
        work = planner.plan(start, goal, thorough=False, robot=state.robot)
        try:
            plan = yield from _first(work, f"{'moving aside' if aside else 'ordering'} '{name}'")
        except PlanningFailed:
            return None
        last = plan.segments[-1].trajectory.pose[-1]
        move = Move(name, start, goal, plan, aside)
        return move, Arrangement(where, last)

    # What stands in the way

    def _blockers(self, state: Arrangement, goals: Mapping[str, Array], name: str) -> Sequence[str]:
        """The other objects, those nearest to the object, its goal and the line between first."""
        a, b = state.poses[name][:2], goals[name][:2]

        def off(other: str) -> float:
            p = state.poses[other][:2]
            along = float(
                np.clip((p - a) @ (b - a) / max(float((b - a) @ (b - a)), 1e-9), 0.0, 1.0)
            )
            return float(np.hypot(*(a + along * (b - a) - p)))

        return sorted((n for n in state.poses if n != name), key=off)

    def _places(self, state: Arrangement, goals: Mapping[str, Array], name: str) -> Iterator[Array]:
        """Poses to which an object can be moved aside, nearest first, on no goal of another one."""
        x, y, theta = state.poses[name]
        taken = [(p, self._reach[n]) for n, p in state.poses.items() if n != name]
        taken += [(g, self._reach[n]) for n, g in goals.items() if n != name]
        scene = self._planner(name).scene
        for distance in self._settings.aside:
            for k in range(_SAMPLES):
                angle = theta + 2.0 * math.pi * k / _SAMPLES
                pose = np.array(
                    [x + distance * math.cos(angle), y + distance * math.sin(angle), theta]
                )
                try:
                    check_pose(scene, pose, "place aside", _OCCUPIED)
                except PlanningFailed:
                    continue
                room = self._reach[name] + self._gap
                if all(np.hypot(*(pose - p)[:2]) >= r + room for p, r in taken):
                    yield pose

    def _apart(self, poses: Mapping[str, Array], one: str, two: str) -> float:
        return float(np.hypot(*(poses[one] - poses[two])[:2]))

    def _planner(self, name: str) -> PushPlanner:
        return self._planners[self._items[name]]

    def _give_up(self, left: frozenset[str]) -> NoReturn:
        names = ", ".join(f"'{n}'" for n in sorted(left))
        spent = self.plans >= self._settings.max_plans
        why = (
            f"none was found with {self.plans} planned moves (max_plans)"
            if spent
            else "in every order there is an object without a plan, even with one moved aside"
        )
        raise PlanningFailed(PlanError.NO_PUSH_SEQUENCE, f"no order of pushes for {names}: {why}")


_OCCUPIED = PlanError.GOAL_OCCUPIED


def _guess(state: Arrangement, goals: Mapping[str, Array], name: str) -> tuple[float, str]:
    """[m] that the robot drives at least for this object; equal ones by name."""
    pose = state.poses[name]
    way = float(np.hypot(*(goals[name] - pose)[:2]))
    if state.robot is not None:
        way += float(np.hypot(*(pose - state.robot)[:2]))
    return way, name


def _first(work: Iterator[Progress], stage: str) -> Generator[str, None, PushPlan]:
    """The first plan of a planner at work."""
    for progress in work:
        if progress.best is not None:
            return progress.best
        yield stage
    raise PlanningFailed(PlanError.NO_PUSH_SEQUENCE, "the planner ended without a plan")
