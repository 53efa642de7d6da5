"""Layer 2: A* over object poses and pushing sides, Algorithms 1 and 2.

The search runs backward from the goal, as in the thesis. A node is an object pose on Gamma and the
side on which the push that starts there pushes; its parent is nearer to the goal.
"""

import heapq
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_planner.guide_path import GuidePath, waypoints
from push_planner.push_curve import PushCurve, shortest_push_curve
from push_planner.scene import PushScene, PushSide
from push_planner.settings import PlannerSettings

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
    """A search along one guide path. ``run`` yields after each expansion."""

    scene: PushScene
    guide: GuidePath
    start: Array
    goal: Array
    bound: float = math.inf
    statistics: SearchStatistics = field(default_factory=SearchStatistics)
    solution: tuple[PushStep, ...] | None = None
    cost: float = math.inf

    def run(self) -> Iterator[None]:
        """Algorithm 1. ``bound``: nodes with f above it are not worth expanding."""
        settings = self.scene.settings
        points, headings, way = waypoints(self.guide, settings.waypoint_spacing)
        poses = self._poses(points, headings, settings)
        last = len(poses) - 1
        root = _Node(self.goal, (last, -1), None, 0.0, math.inf)
        counter = itertools.count()
        # h of (2.11); for the straight runs off Gamma, the distance to the start
        rest = [
            np.zeros(1),
            self._distances(poses[1]),
            *(np.full(len(p), w) for p, w in zip(poses[2:-2], way[1:-1], strict=True)),
            self._distances(poses[-2]),
            np.full(1, way[-1]),
        ]
        queue = [(float(way[-1]), next(counter), root)]
        settled: set[tuple[int, int, int]] = set()
        while queue and self.statistics.expanded < settings.max_expansions:
            estimate, _, node = heapq.heappop(queue)
            if estimate >= self.bound:
                return
            key = (*node.place, -1 if node.side is None else node.side.index)
            if key in settled:
                continue
            settled.add(key)
            if node.place[0] == 0:
                self.solution, self.cost = self._trace(node), node.cost
                return
            self.statistics.expanded += 1
            for child in self._successors(node, poses):
                self.statistics.generated += 1
                key = (*child.place, child.side.index if child.side else -1)
                if key not in settled:
                    h = float(rest[child.place[0]][child.place[1]])
                    heapq.heappush(queue, (child.cost + h, next(counter), child))
            yield

    def _distances(self, poses: list[Array]) -> Array:
        return np.array([np.hypot(*(p - self.start)[:2]) for p in poses])

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

    def _successors(self, node: _Node, poses: list[list[Array]]) -> Iterator[_Node]:
        """Algorithm 2: pushes that end at the node, from the farthest waypoints that have any."""
        successful = 0
        for index in range(node.place[0]):
            found = False
            for number, pose in enumerate(poses[index]):
                for side in self.scene.sides:
                    child = self._push(pose, (index, number), side, node)
                    if child is not None:
                        found = True
                        yield child
            successful += found
            if successful >= self.scene.settings.successor_waypoints:
                return

    def _push(
        self, pose: Array, place: tuple[int, int], side: PushSide, node: _Node
    ) -> _Node | None:
        start, end = side.robot_pose(pose), side.robot_pose(node.pose)
        if not _worth_trying(start, end):
            return None
        self.statistics.solved += 1
        curve = shortest_push_curve(start, end, side.trusted.minimum, side.trusted.maximum)
        if curve is None:
            return None
        needed = self.scene.settings.safety_distance
        clearance = self.scene.curve_clearance(curve, side, needed)
        if clearance < needed or not self.scene.has_room(start) or not self.scene.has_room(end):
            return None
        self.statistics.feasible += 1
        cost = node.cost + curve.length
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


def _worth_trying(start: Array, end: Array) -> bool:
    """Whether a forward push could reach the end, judged by bearings."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    if math.hypot(dx, dy) < 0.03:
        return False
    bearing = math.atan2(dy, dx)
    return (
        abs(se2.wrap(bearing - start[2])) < _WIDEST_BEARING
        and abs(se2.wrap(bearing - end[2])) < _WIDEST_BEARING
    )
