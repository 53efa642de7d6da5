"""The two layers together: from start and goal pose to a plan of pushes that keeps improving."""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.distance_field import DistanceField
from push_model.occupancy import OccupancyGrid
from push_model.push_segment import PushSegment
from push_model.specs import ObjectSpec, RobotSpec
from push_model.trajectory import along_curve
from push_planner.candidate_poses import along_guide, nearby, runs, scattered
from push_planner.guide_path import GuidePath, NoGuidePath, guide_paths, origin_floor
from push_planner.push_search import PushGraph, PushSearch, PushStep, SearchStatistics
from push_planner.scene import PushScene
from push_planner.settings import PlannerSettings
from push_planner.thesis_search import ThesisSearch, poses_on

_Ends = tuple[Array, Array]
_WORTH = 0.002  # of the cost that a further plan must save
_NEARBY = 40  # poses about each one that an improvement moves
_WAYPOINTS = 30  # at most, in the first attempt
_REACH = (10.0, 3.0)  # waypoints that a push leads on at most: of the settings; of a long path


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
    """cost [m]: g(q) of (2.10); length [m] of all pushes; clearance [m]; the guide path used.

    goal ``(3,)`` and the segments' poses are of the object's geometric frame, the guide path is of
    its centre of mass.
    """

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


class _Work:
    """What has been spent on one plan, and what is left."""

    def __init__(self, settings: PlannerSettings, seed: int) -> None:
        self.seed = seed
        self.random = np.random.default_rng(seed)
        self.statistics = SearchStatistics()
        self.iterations = 0
        self.ways_out = self.ways_in = False  # whether any push leaves the start, ends at the goal
        self.left = settings.total_expansions
        self._most = settings.max_expansions
        self._clock = time.perf_counter()

    def effort(self) -> int:
        """Pushes that the next search may try."""
        return min(self.left, self._most)

    def counted(self, guide: GuidePath) -> PlanStatistics:
        """The work until now."""
        return PlanStatistics(
            self.iterations,
            self.statistics.expanded,
            self.statistics.generated,
            self.statistics.solved,
            self.statistics.feasible,
            guide.cost,
            guide.length,
            guide.clearance,
            time.perf_counter() - self._clock,
        )


class PushPlanner:
    """Plans pushes of one object by one robot on one map.

    Poses of the object that come in and go out are of its geometric frame; within, of its centre of
    mass (see ``ObjectSpec``).
    """

    def __init__(
        self,
        settings: PlannerSettings,
        grid: OccupancyGrid | DistanceField,
        robot: RobotSpec,
        item: ObjectSpec,
    ) -> None:
        """Raises SettingsError where the robot cannot push: no flat bumper, no two wheels.

        grid: the map, or its distance field where that has been made already.
        """
        self.settings = settings
        field = grid if isinstance(grid, DistanceField) else DistanceField(grid)
        self.scene = PushScene(field, robot, item, settings)

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
        if self.scene.object_clearance(self.scene.item.mass_pose(pose)) <= 0.0:
            raise PlanningFailed(
                occupied, f"at the {what} {where} the object would overlap an obstacle"
            )

    def lower_bound(self, start: Array, goal: Array) -> float:
        """[m] that no plan can cost less than.

        While the robot drives 1 m the object's centre, ``ahead`` of the axle midpoint, moves
        sqrt((1 - kappa y)^2 + (kappa ahead)^2) m; no shorter than straight, with one push.
        """
        if not self.scene.sides:
            return np.inf
        fastest = max(
            np.hypot(1.0 - kappa * side.grasp[1], kappa * side.grasp[0])
            for side in self.scene.sides
            for kappa in (side.trusted.minimum, side.trusted.maximum)
        )
        item = self.scene.item
        straight = float(np.hypot(*(item.mass_pose(goal) - item.mass_pose(start))[:2]))
        return straight / float(max(fastest, 1.0)) + self.settings.push_cost

    def plan(self, start: Array, goal: Array, seed: int | None = None) -> Iterator[Progress]:
        """Plan in small slices: each ``next`` does a little work and reports.

        The last report carries the best plan, and a plan that is reported never costs more than
        one before it. The work is counted, never timed, so that equal inputs and seeds give equal
        plans.

        Raises
        ------
        PlanningFailed: when there is no plan; from the ``next`` that finds it out.
        """
        settings = self.settings
        work = _Work(settings, settings.seed if seed is None else seed)
        start = np.array([start[0], start[1], se2.wrap(start[2])])
        goal = np.array([goal[0], goal[1], se2.wrap(goal[2])])
        self.check(start, "start", PlanError.START_OCCUPIED)
        self.check(goal, "goal", PlanError.GOAL_OCCUPIED)
        self._check_room(start, "pushed away from the start", True)
        self._check_room(goal, "pushed into the goal")
        ends = start, goal
        start, goal = (self.scene.item.mass_pose(pose) for pose in ends)
        guides = []
        for guide in self._guides(start, goal, work.seed):
            guides.append(guide)
            work.iterations += settings.rrt_iterations
            yield Progress("guide path", None)
        if not guides:
            raise PlanningFailed(
                PlanError.NO_GUIDE_PATH, "no path from start to goal is wide enough for the object"
            )
        guides.sort(key=lambda g: g.cost)
        if settings.planner == "thesis":
            yield from self._as_printed(ends, guides[0], work)
            return
        best: PushPlan | None = None
        for attempt, count in enumerate(settings.scattered_poses):
            guide = guides[attempt % len(guides)]
            graph = self._graph(start, goal, guide, attempt, count, work)
            if not graph.leave(work.statistics, enough=1):
                continue
            work.ways_out = True
            # Greedier when that does not end, and only by ways out of the start that there are;
            # what has been tried is remembered.
            for weight in (1.0, settings.heuristic_weight):
                if weight > 1.0:
                    graph.leave(work.statistics)
                search = PushSearch(graph, np.inf, weight, work.effort())
                for _ in search.run(work.statistics):
                    yield Progress(f"push search {attempt + 1}", None)
                work.left -= search.expanded
                work.ways_in |= graph.arrivals > 0 or search.expanded == 0
                if search.solution is not None or search.exhausted:
                    break
            if search.solution is not None:
                best = self._assemble(search, ends[1], guide, work)
                break
        if best is None:
            raise PlanningFailed(PlanError.NO_PUSH_SEQUENCE, self._why_not(*ends, work))
        yield Progress("improving", best)
        least = self.lower_bound(*ends)
        work.left = settings.improvement_expansions
        for number in range(settings.improvement_rounds):
            bound = (1.0 - _WORTH) * best.cost
            if work.left <= 0 or bound <= least:
                break
            if number == 0:
                graph = self._graph(start, goal, guides[-1], 1, settings.scattered_poses[-1], work)
            else:
                between = [self.scene.item.mass_pose(s.object_end) for s in best.segments[:-1]]
                if not between:
                    break
                size = settings.refinement / 2.0 ** ((number - 1) / 2)
                poses = nearby(np.array(between), _NEARBY, size, work.random)
                graph = PushGraph(self.scene, start, goal, poses.free(self.scene), np.inf)
            search = PushSearch(graph, bound, 1.0, work.effort())
            for _ in search.run(work.statistics):
                yield Progress(f"improving, round {number + 1}", best)
            work.left -= search.expanded
            if search.solution is not None and search.cost < best.cost:
                best = self._assemble(search, ends[1], best.guide, work)
                yield Progress("improving", best)
        yield Progress("done", best)

    def _as_printed(self, ends: _Ends, guide: GuidePath, work: _Work) -> Iterator[Progress]:
        """Layer 2 of the thesis: poses on Gamma alone, and no improvement."""
        start, goal = (self.scene.item.mass_pose(pose) for pose in ends)
        poses = poses_on(self.scene, guide).free(self.scene)
        graph = PushGraph(self.scene, start, goal, poses, np.inf)
        search = ThesisSearch(graph, work.left)
        for _ in search.run(work.statistics):
            yield Progress("push search", None)
        work.ways_out = work.ways_in = True
        if search.solution is None:
            raise PlanningFailed(PlanError.NO_PUSH_SEQUENCE, self._why_not(*ends, work))
        yield Progress("done", self._assemble(search, ends[1], guide, work))

    def _graph(
        self, start: Array, goal: Array, guide: GuidePath, attempt: int, count: int, work: "_Work"
    ) -> PushGraph:
        """Poses along a guide path, at its ends, and ``count`` scattered ones; the first attempt
        leaves waypoints out where the path is long."""
        scene = self.scene
        most = _WAYPOINTS * 2**attempt
        lengths = self.settings.run_lengths
        candidates = runs(scene, start, 1.0, 0.0, lengths)
        candidates += along_guide(scene, guide, start, goal, most)
        candidates += runs(scene, goal, -1.0, guide.length, lengths)
        candidates += scattered(scene, guide, count, work.random)
        spacing = max(self.settings.waypoint_spacing, guide.length / most)
        reach = max(_REACH[0] * self.settings.waypoint_spacing, _REACH[1] * spacing)
        return PushGraph(scene, start, goal, candidates.free(scene), reach)

    def _check_room(self, pose: Array, what: str, leaving: bool = False) -> None:
        """Raise PlanningFailed when the object can be pushed on no side at the pose ``(3,)``."""
        centre = self.scene.item.mass_pose(pose)
        where = f"({pose[0]:.3f}, {pose[1]:.3f}, {pose[2]:.3f})"
        needed = self.scene.leaving(centre) if leaving else self.settings.safety_distance
        clearance = self.scene.object_clearance(centre)
        if clearance < needed:
            raise PlanningFailed(
                PlanError.NO_PUSH_SEQUENCE,
                f"the object cannot be {what} {where}: it is {1e3 * clearance:.1f} mm from an "
                f"obstacle there, and pushes keep {1e3 * needed:.1f} mm",
            )
        sides = self.scene.sides
        if not sides:
            raise PlanningFailed(
                PlanError.NO_PUSH_SEQUENCE,
                f"no side of the object can be pushed: {self.scene.why_no_sides()}",
            )
        if not any(self.scene.has_room(s.robot_pose(centre), s, needed) for s in sides):
            behind = ", ".join(f"{s.index} ({1e3 * self.scene.back(s):.0f} mm)" for s in sides)
            around = 1e3 * self.scene.robot_keeps(needed)
            raise PlanningFailed(
                PlanError.NO_PUSH_SEQUENCE,
                f"no side of the object can be {what} {where}: behind each that can be pushed the "
                f"robot, which needs {around:.1f} mm around it and some way to back off, would "
                f"touch an obstacle: sides {behind}",
            )

    def _why_not(self, start: Array, goal: Array, work: "_Work") -> str:
        """What the searches have found out."""
        statistics = work.statistics
        tried = f"{statistics.feasible} of {statistics.solved} pushes tried are free"
        for found, pose, what in (
            (work.ways_out, start, "leads away from the start"),
            (work.ways_in, goal, "ends at the goal"),
        ):
            if not found:
                where = f"({pose[0]:.3f}, {pose[1]:.3f}, {pose[2]:.3f})"
                return f"no push {what} {where} without a collision; {tried}"
        return f"no sequence of pushes reaches the goal; {tried}"

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
        """A push with its time-parametrised reference; object poses in the geometric frame."""
        count = max(20, int(step.curve.length / 0.005))
        points, heading, curvature = step.curve.sample(count)
        trajectory = along_curve(
            points,
            heading,
            curvature,
            self.scene.drive,
            self.settings.push_speed,
            self.settings.push_acceleration,
        )
        curve, item = step.curve, self.scene.item
        return PushSegment(
            step.side.index,
            item.geometric_pose(step.object_start),
            item.geometric_pose(step.object_end),
            curve.start,
            curve.end,
            self.scene.standoff(curve.start, step.side),
            curve.k_start,
            curve.k_end,
            curve.length,
            step.side.nominal,
            step.clearance,
            trajectory,
        )

    def _assemble(
        self, search: PushSearch | ThesisSearch, goal: Array, guide: GuidePath, work: "_Work"
    ) -> PushPlan:
        assert search.solution is not None
        segments = tuple(self.segment(step) for step in search.solution)
        clearance = min(s.clearance for s in segments)
        return PushPlan(goal, segments, search.cost, clearance, guide, work.counted(guide))
