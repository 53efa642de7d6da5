"""Layer 2: A* over object poses and pushing sides, Algorithms 1 and 2.

The search runs backward from the goal, as in the thesis. A node is an object pose on Gamma and the
side on which the push that starts there pushes; its parent is nearer to the goal.

Algorithm 2 tries pushes from the farthest waypoint on and stops after a few that have any. That
loses plans: where the far ones lead nowhere, the near ones are never tried. Here a node is expanded
one waypoint at a time (partial expansion A*): it goes back into the queue with the least cost that
its next waypoint can have. No push is lost, and far ones are still tried first. The distance to
the start is weighted, so that a first plan is found early; later searches are less greedy, and drop
what cannot be shorter than the best plan so far. A node is settled by its first expansion, as in
any weighted A*: plans are good, not optimal.
"""

import heapq
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from push_model import se2
from push_model.arrays import Array
from push_model.stable_push import CurvatureLimits
from push_planner.guide_path import GuidePath, waypoints
from push_planner.push_curve import PushCurve, shortest_push_curve
from push_planner.scene import PushScene, PushSide
from push_planner.settings import PlannerSettings

_NEAREST = 0.03  # [m] of a push
_WIDEST_BEARING = 2.0  # [rad] of a push's end seen from its start, and the other way round


@dataclass
class SearchStatistics:
    """Work of one search."""

    expanded: int = 0
    generated: int = 0
    solved: int = 0
    feasible: int = 0


@dataclass
class _Node:
    pose: Array
    place: tuple[int, int]  # waypoint, orientation
    side: PushSide | None
    cost: float  # g of (2.10)
    clearance: float
    parent: "_Node | None" = None
    curve: PushCurve | None = None


@dataclass(frozen=True)
class PushStep:
    """One push of a sequence: side, curve, object poses before and after, clearance [m]."""

    side: PushSide
    curve: PushCurve
    object_start: Array
    object_end: Array
    clearance: float


@dataclass
class PushSearch:
    """A search along one guide path. ``run`` yields after each partial expansion.

    bound: cost [m] that a solution must stay below. weight: of the heuristic, >= 1. expansions:
    how many there may be.
    """

    scene: PushScene
    guide: GuidePath
    start: Array
    goal: Array
    bound: float
    weight: float
    expansions: int
    statistics: SearchStatistics = field(default_factory=SearchStatistics)
    solution: tuple[PushStep, ...] | None = None
    cost: float = math.inf
    _room: dict[bytes, bool] = field(default_factory=dict)

    def run(self) -> Iterator[None]:
        """Algorithm 1."""
        settings = self.scene.settings
        points, headings, way = waypoints(self.guide, settings.waypoint_spacing)
        poses = self._poses(points, headings, settings)
        starts = [self._robot_poses(p) for p in poses]
        last = len(poses) - 1
        root = _Node(self.goal, (last, -1), None, 0.0, math.inf)
        counter = itertools.count()
        direct = [self._distances(p) for p in poses]  # never more than what is left, to prune with
        # h of (2.11); for the straight runs off Gamma, the distance to the start
        rest = [
            direct[0],
            direct[1],
            *(np.full(len(p), w) for p, w in zip(poses[2:-2], way[1:-1], strict=True)),
            direct[-2],
            np.full(1, way[-1]),
        ]
        # estimate, tie-break, node, waypoint to push from next
        queue = [(float(way[-1]), next(counter), root, 0)]
        settled: set[tuple[int, int, int]] = set()
        while queue and self.statistics.expanded < self.expansions:
            estimate, _, node, waypoint = heapq.heappop(queue)
            if waypoint == 0:
                key = (*node.place, -1 if node.side is None else node.side.index)
                if key in settled:
                    continue
                settled.add(key)
                if node.place[0] == 0:
                    self.solution, self.cost = self._trace(node), node.cost
                    return
            self.statistics.expanded += 1
            for child in self._successors(
                node, poses[waypoint], starts[waypoint], direct[waypoint], waypoint
            ):
                self.statistics.generated += 1
                key = (*child.place, child.side.index if child.side else -1)
                h = float(rest[waypoint][child.place[1]])
                if key not in settled:
                    f = child.cost + self.weight * h
                    heapq.heappush(queue, (f, next(counter), child, 0))
            for following in range(waypoint + 1, node.place[0]):
                if not poses[following]:
                    continue
                gap = np.hypot(*(np.array(poses[following])[:, :2] - node.pose[:2]).T)
                if node.cost + float((gap + direct[following]).min()) < self.bound:
                    least = node.cost + float((gap + self.weight * rest[following]).min())
                    entry = (max(estimate, least), next(counter), node, following)
                    heapq.heappush(queue, entry)
                    break
            yield

    def _distances(self, poses: list[Array]) -> Array:
        way: Array = np.hypot(*(np.array(poses).reshape(-1, 3) - self.start)[:, :2].T)
        return way

    def _runs(self, pose: Array, sign: float) -> list[Array]:
        """Object poses a straight push before (sign -1) or after (+1) a pose, on every side.

        Off Gamma, but through them most pushes leave the start and reach the goal: curves are wide,
        and the first and last heading are given.
        """
        settings = self.scene.settings
        result = []
        for side in self.scene.sides:
            heading = float(pose[2]) - side.contact.heading
            for length in settings.run_lengths:
                place = pose + sign * length * np.array([math.cos(heading), math.sin(heading), 0.0])
                if self.scene.object_clearance(place) >= settings.safety_distance:
                    result.append(place)
        return result

    def _poses(
        self, points: Array, headings: Array, settings: PlannerSettings
    ) -> list[list[Array]]:
        """Object poses at each waypoint: one of its sides faces along Gamma, or nearly so."""
        result = [[self.start]]
        for point, heading in zip(points[1:-1], headings[1:-1], strict=True):
            angles: list[float] = [self.start[2], self.goal[2]]
            for offset in settings.heading_offsets:
                for side in self.scene.sides:
                    angles.append(se2.wrap(heading + offset + side.contact.heading))
            distinct: list[float] = []
            for angle in angles:
                if all(abs(se2.wrap(angle - other)) > 0.05 for other in distinct):
                    distinct.append(angle)
            aside = np.array([-math.sin(heading), math.cos(heading)])
            places = [point + offset * aside for offset in settings.lateral_offsets]
            candidates = [np.array([x, y, angle]) for x, y in places for angle in distinct]
            least = settings.safety_distance
            result.append([p for p in candidates if self.scene.object_clearance(p) >= least])
        before, after = self._runs(self.start, 1.0), self._runs(self.goal, -1.0)
        return [result[0], before, *result[1:], after, [self.goal]]

    def _robot_poses(self, poses: list[Array]) -> list[Array]:
        """For each side, the robot ``(n, 3)`` in contact with the object at the poses."""
        table = np.array(poses).reshape(-1, 3)
        c, s = np.cos(table[:, 2]), np.sin(table[:, 2])
        result = []
        for side in self.scene.sides:
            x, y, theta = se2.inverse(side.grasp)
            position = table[:, :2] + np.column_stack([c * x - s * y, s * x + c * y])
            result.append(np.column_stack([position, table[:, 2] + theta]))
        return result

    def _successors(
        self,
        node: _Node,
        poses: list[Array],
        starts: list[Array],
        remaining: Array,
        waypoint: int,
    ) -> Iterator[_Node]:
        """Pushes from the poses at one waypoint that end at the node, as far as they can be part of
        a solution below the bound; remaining: of each pose, the distance to the start."""
        for side, robots in zip(self.scene.sides, starts, strict=True):
            end = side.robot_pose(node.pose)
            way = np.hypot(*(robots[:, :2] - end[:2]).T)
            promising = np.flatnonzero(
                worth_trying(robots, end, side.trusted) & (node.cost + way + remaining < self.bound)
            )
            if len(promising) == 0 or not self._has_room(end):
                continue
            for number in promising.tolist():
                start = robots[number]
                if self._has_room(start):
                    place = (waypoint, number)
                    child = self._push(poses[number], place, start, end, side, node)
                    if child is not None:
                        yield child

    def _has_room(self, robot: Array) -> bool:
        key = robot.tobytes()
        if key not in self._room:
            self._room[key] = self.scene.has_room(robot)
        return self._room[key]

    def _push(
        self,
        pose: Array,
        place: tuple[int, int],
        start: Array,
        end: Array,
        side: PushSide,
        node: _Node,
    ) -> _Node | None:
        self.statistics.solved += 1
        curve = shortest_push_curve(start, end, side.trusted.minimum, side.trusted.maximum)
        if curve is None:
            return None
        needed = self.scene.settings.safety_distance
        clearance = self.scene.curve_clearance(curve, side, needed)
        if clearance < needed:
            return None
        self.statistics.feasible += 1
        cost = node.cost + curve.length + self.scene.settings.push_cost
        if node.side is not None and node.side.index != side.index:
            other = node.side.robot_pose(node.pose)
            cost += float(np.hypot(*(other - end)[:2])) + self.scene.settings.side_change_cost
        return _Node(pose, place, side, cost, clearance, node, curve)

    def _trace(self, node: _Node) -> tuple[PushStep, ...]:
        steps = []
        while node.parent is not None:
            assert node.side is not None and node.curve is not None
            steps.append(
                PushStep(node.side, node.curve, node.pose, node.parent.pose, node.clearance)
            )
            node = node.parent
        return tuple(steps)


def worth_trying(starts: Array, end: Array, limits: CurvatureLimits) -> NDArray[np.bool_]:
    """Whether a push that does not loop could lead from starts ``(n, 3)`` to end ``(3,)``.

    Either pose must lie outside the tightest circle that the other one touches on that side.
    """
    dx, dy = end[0] - starts[:, 0], end[1] - starts[:, 1]
    distance, bearing = np.hypot(dx, dy), np.arctan2(dy, dx)
    worth: NDArray[np.bool_] = distance >= _NEAREST
    for angle in (bearing - starts[:, 2], end[2] - bearing):
        angle = (angle + math.pi) % (2.0 * math.pi) - math.pi
        diameter = np.where(angle > 0.0, 2.0 / limits.maximum, -2.0 / limits.minimum)
        worth &= np.abs(angle) <= _WIDEST_BEARING
        worth &= distance >= diameter * np.sin(np.minimum(np.abs(angle), 0.5 * math.pi))
    return worth
