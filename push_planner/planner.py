"""The two layers together: from start and goal pose to a plan of pushes that keeps improving."""

from collections.abc import Generator, Iterator, Sequence
from dataclasses import replace

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.distance_field import DistanceField
from push_model.occupancy import OccupancyGrid
from push_model.push_segment import PushSegment
from push_model.specs import ObjectSpec, RobotSpec
from push_model.stick_certificate import ContactBelief
from push_planner.arc_pushes import pushes_over_arcs
from push_planner.candidate_poses import along_guide, manoeuvres, nearby, runs, scattered
from push_planner.cost_bound import CostBound
from push_planner.gentle import gentler
from push_planner.guide_path import GuidePath, NoGuidePath, guide_paths, origin_floor
from push_planner.narrow_way import lined_up
from push_planner.push_graph import PushGraph, PushStep, risk_of
from push_planner.push_plan import (
    PlanError,
    PlanningFailed,
    Progress,
    PushPlan,
)
from push_planner.push_reference import push_reference
from push_planner.push_search import PushSearch
from push_planner.refusal import check_pose, check_room, check_way, sides_shut_off, why_not
from push_planner.run_ends import RunEnds
from push_planner.scene import PushScene
from push_planner.settings import PlannerSettings
from push_planner.thesis_search import ThesisSearch, poses_on
from push_planner.work import Guides, Work

_Ends = tuple[Array, Array]
_Pushes = tuple[PushStep, ...]
_WORTH = 0.002  # of the cost that a further plan must save
_NEAR_BOUND = 0.05  # of the lower bound: a plan so near to it needs no search over arcs
_NEARBY = 40  # poses about each one that an improvement moves
_SIZES = 9  # rounds after which an improvement moves poses by the first size again
_WAYPOINTS = 30  # at most, in the first attempt
_HASTE = 0.5  # of the time of a change of the side that counts, in searches along guide paths
_REACH = (10.0, 3.0)  # waypoints that a push leads on at most: of the settings; of a long path


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
        believed: ContactBelief | None = None,
    ) -> None:
        """Raises SettingsError where the robot cannot push: no flat bumper, no two wheels.

        grid: the map, or its distance field where that has been made already. believed: intervals
        of friction and centre of mass, where somebody has given some.
        """
        self.settings = settings
        field = grid if isinstance(grid, DistanceField) else DistanceField(grid)
        self.scene = PushScene(field, robot, item, settings, believed)

    def check(self, pose: Array, what: str, occupied: PlanError) -> None:
        """Raise PlanningFailed unless the object can stand at the pose ``(3,)``."""
        check_pose(self.scene, pose, what, occupied)

    def lower_bound(self, start: Array, goal: Array) -> float:
        """[s] that no plan can cost less than, before searches raise it (cost_bound.py)."""
        if not self.scene.sides:
            return np.inf
        start, goal = (self.scene.item.mass_pose(pose) for pose in (start, goal))
        return float(CostBound(self.scene, start, goal).value)

    def plan(
        self,
        start: Array,
        goal: Array,
        seed: int | None = None,
        thorough: bool = True,
        robot: Array | None = None,
        on_side: int | None = None,
    ) -> Iterator[Progress]:
        """Plan in small slices: each ``next`` does a little work and reports.

        thorough: whether a long search follows where the others find no plan, and whether the lower
        bound is raised by searches. robot: ``(3,)`` pose of the robot, from which it
        must have a way to the first side; None if unknown. on_side: index of the side on which the
        robot pushes when the plan begins: to go on there takes no change of the side.

        The last report carries the final plan, with the lower bound of all costs. The cost of a
        plan that is reported, with its risk, is never above that of one before it; only that of the
        final one may be, by ``easing``.

        The work is counted, never timed, so that equal inputs and seeds give equal plans.

        Raises
        ------
        PlanningFailed: when there is no plan; from the ``next`` that finds it out.
        """
        settings = self.settings
        work = Work(settings, settings.seed if seed is None else seed, robot, on_side)
        start = np.array([start[0], start[1], se2.wrap(start[2])])
        goal = np.array([goal[0], goal[1], se2.wrap(goal[2])])
        self.check(start, "start", PlanError.START_OCCUPIED)
        self.check(goal, "goal", PlanError.GOAL_OCCUPIED)
        check_room(self.scene, start, "pushed away from the start", True)
        check_room(self.scene, goal, "pushed into the goal")
        if on_side is None:
            check_way(self.scene, start, robot)
        ends = start, goal
        start, goal = (self.scene.item.mass_pose(pose) for pose in ends)
        guides = Guides(self._guides(start, goal, work.seed), work, settings.rrt_iterations)
        yield Progress("guide path", None)
        guides.number(0)
        bound = CostBound(self.scene, start, goal)
        work.least = bound.value
        best: PushPlan | None = None
        if settings.planner == "thesis":
            best = yield from self._as_printed(ends, min(guides.all(), key=lambda g: g.cost), work)
        else:
            for progress in self._first_plan(ends, guides, work, thorough):
                best = progress.best
                yield progress
            if best is None:
                raise self._refusal(ends, guides.all(), work)
        for _ in bound.run(settings.bound_boxes if thorough else 0, best.cost):
            yield Progress("lower bound of the cost", best)
        work.least = bound.value
        if settings.planner == "lazy":
            best = yield from self._improved(best, ends, guides, bound.ends, work)
        if settings.planner == "lazy" and settings.easing > 0.0:
            best = yield from self._eased(best, work)
        statistics = work.counted(best.guide)
        least = min(bound.value, best.cost)
        yield Progress("done", replace(best, cost_bound=least, statistics=statistics))

    def _first_plan(
        self, ends: _Ends, guides: Guides, work: Work, thorough: bool
    ) -> Iterator[Progress]:
        """Search among more and more poses, until there is a plan."""
        settings = self.settings
        start, goal = (self.scene.item.mass_pose(pose) for pose in ends)
        unfinished: tuple[PushGraph, GuidePath] | None = None
        for attempt, count in enumerate(settings.scattered_poses):
            guide = guides.number(attempt)
            yield Progress("guide path", None)
            around = settings.manoeuvres * attempt
            graph = self._graph(start, goal, guide, attempt, count, around, work)
            work.poses += len(graph.poses) - 2
            yield Progress("candidate poses", None)
            if not graph.leave(work.statistics, enough=1):
                continue
            work.graph, work.ways_out = graph, True
            # Greedier when that does not end; what has been tried by then is remembered.
            for weight in (1.0, settings.heuristic_weight):
                if weight > 1.0:
                    graph.leave(work.statistics)
                    yield Progress("pushes from the start", None)
                search = PushSearch(graph, np.inf, weight, work.effort())
                for _ in search.run(work.statistics):
                    yield Progress(f"push search {attempt + 1}", None)
                work.left -= search.expanded
                work.ways_in |= graph.arrivals > 0 or search.expanded == 0
                if search.solution is not None:
                    yield Progress(
                        "improving",
                        self._assemble(search.solution, ends[1], guide, work),
                    )
                    return
                if search.exhausted:
                    break
            else:
                unfinished = graph, guide
        if unfinished is None or not thorough:
            return
        # Pushes that were tried cost nothing now: nearly all of the effort is new.
        graph, guide = unfinished
        search = PushSearch(graph, np.inf, settings.heuristic_weight, work.left)
        for _ in search.run(work.statistics):
            yield Progress("long push search", None)
        work.left -= search.expanded
        work.ways_in |= graph.arrivals > 0
        if search.solution is not None:
            yield Progress("improving", self._assemble(search.solution, ends[1], guide, work))

    def _improved(
        self, best: PushPlan, ends: _Ends, guides: Guides, run_ends: RunEnds, work: Work
    ) -> Generator[Progress, None, PushPlan]:
        """Search below the cost of the best plan: over arcs or, where that finds nothing, along
        another guide path; then near its poses. Returns the best plan."""
        settings = self.settings
        start, goal = (self.scene.item.mass_pose(pose) for pose in ends)
        work.left = settings.improvement_expansions
        for number in range(settings.improvement_rounds):
            bound = (1.0 - _WORTH) * best.weighed
            if bound <= work.least or work.left <= 0:
                break
            if number == 0 and best.cost > (1.0 + _NEAR_BOUND) * work.least:
                found = yield from self._over_arcs(best, ends[1], run_ends, work)
                if found is not best:
                    best = found
                    yield Progress("improving", best)
                    continue
            if number == 0:
                for _ in guides.rest():
                    yield Progress("guide path", best)
                count, most = settings.improvement_poses, settings.improvement_expansions // 2
                graph = self._graph(start, goal, guides.all()[-1], 1, count, 0, work)
                hasty = self._cost(best.segments, work, _HASTE) + _HASTE * best.risk
                bound = (1.0 - _WORTH) * hasty
            else:
                most = work.left
                between = [self.scene.item.mass_pose(s.object_end) for s in best.segments[:-1]]
                if not between:
                    break
                size = settings.refinement / 2.0 ** ((number - 1) % _SIZES / 2)
                poses = nearby(np.array(between), _NEARBY, size, work.random)
                free = poses.free(self.scene)
                graph = PushGraph(
                    self.scene, start, goal, free, np.inf, work.robot, on_side=work.on_side
                )
            search = PushSearch(graph, bound, 1.0, min(most, work.effort()))
            for _ in search.run(work.statistics):
                yield Progress(f"improving, round {number + 1}", best)
            work.left -= search.expanded
            if search.solution is None:
                continue
            found = self._assemble(search.solution, ends[1], best.guide, work)
            if found.weighed < best.weighed:
                best = found
                yield Progress("improving", best)
        return best

    def _over_arcs(
        self, best: PushPlan, goal: Array, run_ends: RunEnds, work: Work
    ) -> Generator[Progress, None, PushPlan]:
        """Search over arcs below the cost of the best plan. Returns the best plan."""
        bound, nodes = (1.0 - _WORTH) * best.weighed, self.settings.arc_nodes
        given = work.robot, nodes, work.statistics, work.on_side
        search = pushes_over_arcs(self.scene, run_ends, bound, *given)
        found = yield from _reported(search, "search over arcs", best)
        return best if found is None else self._assemble(found, goal, best.guide, work)

    def _eased(self, best: PushPlan, work: Work) -> Generator[Progress, None, PushPlan]:
        """The best plan with wider bends, or itself."""
        given = work.robot, work.random, work.statistics, work.on_side
        search = gentler(self.scene, best.segments, best.weighed, *given)
        found = yield from _reported(search, "wider bends", best)
        return best if found is None else self._assemble(found, best.goal, best.guide, work)

    def _cost(
        self, segments: Sequence[PushSegment], work: Work, change_weight: float = 1.0
    ) -> float:
        return self.scene.time.of_plan(segments, change_weight, work.on_side)

    def _refusal(self, ends: _Ends, guides: Sequence[GuidePath], work: Work) -> PlanningFailed:
        widest = max(guide.clearance for guide in guides)
        ways = work.ways_out, work.ways_in
        reason = why_not(self.scene, *ends, work.statistics, ways, work.poses, widest, work.graph)
        shut, sides = sides_shut_off(self.scene, ends[0], work.robot)
        if shut:
            reason += f"; the robot has no way to {shut} of the {sides} sides that have room"
        return PlanningFailed(PlanError.NO_PUSH_SEQUENCE, reason)

    def _as_printed(
        self, ends: _Ends, guide: GuidePath, work: Work
    ) -> Generator[Progress, None, PushPlan]:
        """Layer 2 of the thesis: poses on Gamma alone, and no improvement."""
        start, goal = (self.scene.item.mass_pose(pose) for pose in ends)
        poses = poses_on(self.scene, guide).free(self.scene)
        graph = PushGraph(self.scene, start, goal, poses, np.inf)
        work.poses = len(poses.poses)
        search = ThesisSearch(graph, work.left)
        for _ in search.run(work.statistics):
            yield Progress("push search", None)
        work.ways_out = work.ways_in = True
        if search.solution is None:
            raise self._refusal(ends, [guide], work)
        return self._assemble(search.solution, ends[1], guide, work)

    def _graph(
        self,
        start: Array,
        goal: Array,
        guide: GuidePath,
        attempt: int,
        count: int,
        around: int,
        work: Work,
    ) -> PushGraph:
        """Poses along a guide path, at its ends, lined up with its narrow parts, ``count``
        scattered ones, and ``around`` two pushes off each end; the first attempt leaves waypoints
        out where the path is long."""
        scene, settings = self.scene, self.settings
        most = _WAYPOINTS * 2**attempt
        lengths = settings.run_lengths
        candidates = runs(scene, start, 1.0, 0.0, lengths)
        candidates += along_guide(scene, guide, start, goal, most)
        candidates += lined_up(scene, guide)
        candidates += runs(scene, goal, -1.0, guide.length, lengths)
        candidates += scattered(scene, guide, count, work.random)
        if around:
            candidates += manoeuvres(scene, start, 1.0, 0.0, around, work.random)
            candidates += manoeuvres(scene, goal, -1.0, guide.length, around, work.random)
        spacing = max(settings.waypoint_spacing, guide.length / most)
        reach = max(_REACH[0] * settings.waypoint_spacing, _REACH[1] * spacing)
        free = candidates.free(scene)
        return PushGraph(scene, start, goal, free, reach, work.robot, _HASTE, on_side=work.on_side)

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
                    PlanError.NO_GUIDE_PATH,
                    "obstacles separate start and goal, and no way connects them; "
                    "choose another goal",
                ) from None
            raise PlanningFailed(
                PlanError.NO_GUIDE_PATH,
                f"the widest way from start to goal is {2.0 * error.widest:.3f} m wide on the map, "
                f"but the object needs {2.0 * least:.3f} m; widen it, or choose another goal",
            ) from None

    def segment(self, step: PushStep) -> PushSegment:
        """A push with its time-parametrised reference; object poses in the geometric frame."""
        trajectory = push_reference([step.curve], self.scene.drive, self.settings)
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
        self,
        steps: Sequence[PushStep],
        goal: Array,
        guide: GuidePath,
        work: Work,
    ) -> PushPlan:
        segments = tuple(self.segment(step) for step in steps)
        clearance, cost = min(s.clearance for s in segments), self._cost(segments, work)
        least, counted = min(work.least, cost), work.counted(guide)
        risk = risk_of(self.scene, steps)
        return PushPlan(goal, segments, cost, least, clearance, guide, counted, risk)


def _reported(
    search: Generator[None, None, _Pushes | None], stage: str, best: PushPlan
) -> Generator[Progress, None, _Pushes | None]:
    """The result of a search in slices, each of which is reported."""
    while True:
        try:
            next(search)
        except StopIteration as end:
            found: _Pushes | None = end.value
            return found
        yield Progress(stage, best)
