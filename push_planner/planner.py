"""The two layers together: from start and goal pose to a plan of pushes that keeps improving."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.occupancy import OccupancyGrid
from push_model.push_segment import PushSegment
from push_model.specs import ObjectSpec, RobotSpec
from push_model.trajectory import along_curve
from push_planner.distance_field import DistanceField
from push_planner.guide_path import GuidePath, NoGuidePath, guide_paths, origin_floor
from push_planner.push_search import PushSearch, PushStep, SearchStatistics
from push_planner.scene import PushScene
from push_planner.settings import PlannerSettings

_WORTH = 0.01  # of the cost that a further plan must save


class PlanError(IntEnum):
    """Why there is no plan; the codes of the PlanPush action."""

    NONE = 0
    INVALID_GOAL = 101
    OUTSIDE_MAP = 104
    START_OCCUPIED = 105
    GOAL_OCCUPIED = 106
    NO_GUIDE_PATH = 107
    NO_PUSH_SEQUENCE = 108


class PlanningFailed(Exception):
    """Raised when there is no plan; carries the code."""

    def __init__(self, code: PlanError, message: str) -> None:
        super().__init__(message)
        self.code = code


@dataclass(frozen=True)
class PlanStatistics:
    """How much work a plan took."""

    rrt_iterations: int = 0
    nodes_expanded: int = 0
    nodes_generated: int = 0
    curves_solved: int = 0
    curves_feasible: int = 0
    guide_cost: float = 0.0
    guide_length: float = 0.0
    guide_clearance: float = 0.0
    plan_time: float = 0.0


@dataclass(frozen=True)
class PushPlan:
    """cost [m]: g(q) of (2.10); length [m] of all pushes; clearance [m]; the guide path used."""

    goal: Array
    segments: tuple[PushSegment, ...]
    cost: float
    clearance: float
    guide: GuidePath
    statistics: PlanStatistics

    @property
    def length(self) -> float:
        """[m] pushed in all."""
        return sum(s.length for s in self.segments)


@dataclass(frozen=True)
class Progress:
    """Where planning stands: what it is doing and the best plan so far."""

    stage: str
    best: PushPlan | None


class PushPlanner:
    """Plans pushes of one object by one robot on one map."""

    def __init__(
        self, settings: PlannerSettings, grid: OccupancyGrid, robot: RobotSpec, item: ObjectSpec
    ) -> None:
        self.settings = settings
        self.scene = PushScene(DistanceField(grid), robot, item, settings)

    def check(self, pose: Array, what: str, occupied: PlanError) -> None:
        """Raise PlanningFailed unless the object can stand at the pose ``(3,)``."""
        if not np.isfinite(pose).all():
            raise PlanningFailed(PlanError.INVALID_GOAL, f"the {what} pose is not finite: {pose}")
        grid = self.scene.field.grid
        where = f"({pose[0]:.3f}, {pose[1]:.3f}, {pose[2]:.3f})"
        if not grid.contains(pose[0], pose[1]):
            x0, x1, y0, y1 = grid.extent
            raise PlanningFailed(
                PlanError.OUTSIDE_MAP,
                f"the {what} {where} lies outside the map, x in [{x0:.2f}, {x1:.2f}], "
                f"y in [{y0:.2f}, {y1:.2f}] m",
            )
        if self.scene.object_clearance(pose) <= 0.0:
            raise PlanningFailed(
                occupied, f"at the {what} {where} the object would overlap an obstacle"
            )

    def plan(self, start: Array, goal: Array, seed: int | None = None) -> Iterator[Progress]:
        """Plan in small slices: each ``next`` does a little work and reports.

        The last report carries the best plan. The work is counted in iterations, never in time, so
        that equal inputs and seeds give equal plans.

        Raises
        ------
        PlanningFailed: when there is no plan; from the ``next`` that finds it out.
        """
        clock = time.perf_counter()
        start = np.array([start[0], start[1], se2.wrap(start[2])])
        goal = np.array([goal[0], goal[1], se2.wrap(goal[2])])
        self.check(start, "start", PlanError.START_OCCUPIED)
        self.check(goal, "goal", PlanError.GOAL_OCCUPIED)
        best: PushPlan | None = None
        any_guide = False
        iterations = 0
        totals = SearchStatistics()
        base = self.settings.seed if seed is None else seed
        left = self.settings.total_expansions
        for round_number in range(1 + self.settings.improvement_rounds):
            if left <= 0:
                break
            weight = max(1.0, self.settings.heuristic_weight / 2.0**round_number)
            guides = []
            for guide in self._guides(start, goal, base + round_number):
                guides.append(guide)
                iterations += self.settings.rrt_iterations
                yield Progress("guide path", best)
            any_guide |= bool(guides)
            guides.sort(key=lambda g: g.cost)
            for number, guide in enumerate(guides):
                if left <= 0:
                    break
                bound = np.inf if best is None else (1.0 - _WORTH) * best.cost
                if guide.length >= 1.5 * bound:
                    continue
                effort = min(left, self.settings.max_expansions)
                search = PushSearch(self.scene, guide, start, goal, bound, weight, effort)
                for _ in search.run():
                    yield Progress(f"push search, round {round_number + 1}.{number + 1}", best)
                for name in vars(totals):
                    setattr(totals, name, getattr(totals, name) + getattr(search.statistics, name))
                left -= search.statistics.expanded
                if search.solution is not None:
                    if best is None:
                        left = self.settings.improvement_expansions
                    statistics = PlanStatistics(
                        iterations,
                        totals.expanded,
                        totals.generated,
                        totals.solved,
                        totals.feasible,
                        guide.cost,
                        guide.length,
                        guide.clearance,
                        time.perf_counter() - clock,
                    )
                    best = self._assemble(search.solution, search.cost, goal, guide, statistics)
                    yield Progress("improving", best)
            if not any_guide and round_number == 0:
                break
        if best is None:
            if not any_guide:
                raise PlanningFailed(
                    PlanError.NO_GUIDE_PATH,
                    "no path from start to goal is wide enough for the object",
                )
            raise PlanningFailed(
                PlanError.NO_PUSH_SEQUENCE,
                f"no sequence of pushes reaches the goal ({totals.expanded} nodes expanded, "
                f"{totals.feasible} of {totals.solved} pushes feasible)",
            )
        yield Progress("done", best)

    def solve(self, start: Array, goal: Array, seed: int | None = None) -> PushPlan:
        """The final plan of ``plan``."""
        best = None
        for progress in self.plan(start, goal, seed):
            best = progress.best
        assert best is not None
        return best

    def _guides(self, start: Array, goal: Array, seed: int) -> Iterator[GuidePath]:
        shape, margin = self.scene.shape, self.settings.safety_distance
        floor = origin_floor(shape)
        least = floor + margin
        easy = shape.circumradius + margin
        try:
            yield from guide_paths(
                self.scene.field, start, goal, least, self.settings, seed, easy, floor
            )
        except NoGuidePath as error:
            if error.widest == 0.0:
                raise PlanningFailed(
                    PlanError.NO_GUIDE_PATH, "obstacles part start and goal: no way connects them"
                ) from None
            raise PlanningFailed(
                PlanError.NO_GUIDE_PATH,
                f"the widest way from start to goal is {2.0 * error.widest:.3f} m wide on the map, "
                f"the object needs {2.0 * least:.3f} m",
            ) from None

    def segment(self, step: PushStep) -> PushSegment:
        """A push with its time-parametrised reference."""
        count = max(20, int(step.curve.length / 0.005))
        points, heading, curvature = step.curve.sample(count)
        trajectory = along_curve(
            points,
            heading,
            curvature,
            self.scene.robot.differential,
            self.settings.push_speed,
            self.settings.push_acceleration,
        )
        curve = step.curve
        return PushSegment(
            step.side.index,
            step.object_start,
            step.object_end,
            curve.start,
            curve.end,
            self.scene.standoff(curve.start),
            curve.k_start,
            curve.k_end,
            curve.length,
            step.side.nominal,
            step.clearance,
            trajectory,
        )

    def _assemble(
        self,
        steps: tuple[PushStep, ...],
        cost: float,
        goal: Array,
        guide: GuidePath,
        statistics: PlanStatistics,
    ) -> PushPlan:
        segments = tuple(self.segment(step) for step in steps)
        clearance = min(s.clearance for s in segments)
        return PushPlan(goal, segments, cost, clearance, guide, replace(statistics))
