"""Layer 2: A* over object poses and pushed sides, in place of Algorithms 1 and 2.

The search runs backward from the goal, as in the thesis. A node consists of an object pose and of
the side of the push that begins there. The parent of a node is one push closer to the goal.

The printed Algorithm 2 computes the curves of pushes into a node, and stops at the first starting
pose from which one succeeds. It thereby loses plans. Here the costs of all pushes into a node are
estimated first (rough_cost.py). The curve and the swept area of a push are computed only when its
estimate is the best in the whole queue (lazy weighted A*). The result of a push is stored. It
serves all nodes that the push may lead to, and the estimates of later searches.
"""

import heapq
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from push_model import se2
from push_model.arrays import Array
from push_planner.candidate_poses import Candidates
from push_planner.push_curve import PushCurve, shortest_push_curve
from push_planner.rough_cost import BLOCKED, guessed_length, pushes_into, rough_costs
from push_planner.scene import PushScene, PushSide
from push_planner.shortest_chord import shortest_chords

_SLICE = 20  # pushes tried between two reports


@dataclass
class SearchStatistics:
    """Counts of the work of one search.

    expanded: entries of the queue that were processed. generated: nodes that were added to it.
    solved: push curves that were computed. feasible: curves that exist and are free of collisions.
    """

    expanded: int = 0
    generated: int = 0
    solved: int = 0
    feasible: int = 0


@dataclass(frozen=True)
class PushStep:
    """One push of a sequence.

    side: the pushed side. curve: path of the robot's axle midpoint. object_start, object_end:
    ``(3,)`` [m, m, rad] poses of the object's centre of mass, world frame. clearance: [m] of robot
    and object to obstacles along the push.
    """

    side: PushSide
    curve: PushCurve
    object_start: Array
    object_end: Array
    clearance: float


@dataclass
class SearchNode:
    """An object pose, with the side of the push that begins there.

    pose: number of the pose in the graph. side: number of the side, -1 at the goal. cost: [m] from
    here to the goal, g of (2.10). parent: the node at which the push ends. step: that push.
    estimates, states: pushes that end at this node, from ``PushGraph.pushes_into``; None until the
    node is expanded. tried: how many of them have been taken.
    """

    pose: int
    side: int  # on which the push that starts here pushes; -1 at the goal
    cost: float  # g of (2.10)
    parent: "SearchNode | None" = None
    step: PushStep | None = None
    estimates: Array | None = None  # of the pushes that end here
    states: NDArray[np.int64] | None = None
    tried: int = 0


class PushGraph:
    """Object poses, estimated costs of the pushes between them, and the pushes that were computed.

    The first pose is the start, the last one is the goal, and the others are ordered along Gamma.
    """

    def __init__(
        self, scene: PushScene, start: Array, goal: Array, candidates: Candidates, reach: float
    ) -> None:
        """Build the graph.

        Parameters
        ----------
        scene: robot, object and map.
        start, goal: ``(3,)`` [m, m, rad] poses of the object's centre of mass, world frame.
        candidates: poses of the object between start and goal.
        reach: [m] longest distance along Gamma that one push may cover.
        """
        self.scene = scene
        order = np.argsort(candidates.way, kind="stable")
        self.poses = np.vstack([start, candidates.poses[order], goal])
        first, last = (candidates.way.min(), candidates.way.max()) if len(order) else (0.0, 0.0)
        way = self.way = np.concatenate([[first], candidates.way[order], [last]])
        self.window = np.column_stack(
            [
                np.searchsorted(way, way - reach, side="left"),
                np.searchsorted(way, way + reach, side="right"),
            ]
        )
        c, s = np.cos(self.poses[:, 2]), np.sin(self.poses[:, 2])
        robots = []
        for side in scene.sides:
            x, y, theta = se2.inverse(side.grasp)
            heading = self.poses[:, 2] + theta
            position = self.poses[:, :2] + np.column_stack([c * x - s * y, s * x + c * y])
            robots.append(np.column_stack([position, heading, np.cos(heading), np.sin(heading)]))
        self.robots = np.array(robots)
        self.leaving = scene.leaving(self.poses[0])
        self.room = np.array(
            [
                scene.rooms(np.ascontiguousarray(r[:, :3]), side)
                for r, side in zip(robots, scene.sides, strict=True)
            ]
        )
        self.room[:, 0] = [
            scene.has_room(r[0, :3], side, self.leaving)
            for r, side in zip(robots, scene.sides, strict=True)
        ]
        self.grasps = np.array([s.grasp for s in scene.sides])
        self.chords = np.array(
            [shortest_chords(s.trusted.minimum, s.trusted.maximum) for s in scene.sides]
        )
        settings = scene.settings
        widest = int((self.window[:, 1] - self.window[:, 0]).max())
        self._sight = np.zeros((*self.room.shape, widest), dtype=np.int8)
        self._costs = (settings.push_cost, settings.side_change_cost)
        keeps = np.array([self.leaving, settings.safety_distance])
        least = scene.shape.inradius + np.minimum(keeps, settings.safety_distance)
        self._view = (self.window, self._sight, least, scene.field.values, *scene.field.args)
        self.arrivals = 0  # pushes found that end at the goal
        self._pushes: dict[tuple[int, int, int], PushStep | None] = {}

    def rough_costs(self, bound: float) -> tuple[Array, float]:
        """Estimated cost [m] from the start to each state ``(n, sides)``, and of a whole plan [m].

        bound: [m] states whose estimate exceeds it are left out.
        """
        ready, arrived = rough_costs(
            self.poses,
            self.robots,
            self.room,
            self.chords,
            self.grasps,
            *self._costs,
            bound,
            *self._view,
        )
        return ready, float(arrived[-1].min())

    def leave(self, statistics: SearchStatistics, enough: float = math.inf) -> int:
        """Compute pushes that begin at the start, until ``enough`` are feasible.

        Returns the number of feasible pushes. Adds the work to the statistics.
        """
        found = 0
        for side in range(len(self.scene.sides)):
            for pose in range(1, self.window[0, 1]):
                if found >= enough:
                    return found
                if self.worth_leaving_for(side, pose):
                    found += self.push(0, pose, side, statistics) is not None
        return found

    def worth_leaving_for(self, side: int, pose: int) -> bool:
        """Whether a push from the start to a pose is worth computing.

        The robot must have room at both ends, and the push must not have to make a loop.
        """
        if not (self.room[side, 0] and self.room[side, pose]):
            return False
        (ax, ay, _, ac, sa), (bx, by, _, bc, sb) = self.robots[side, 0], self.robots[side, pose]
        length = guessed_length(ax, ay, ac, sa, bx, by, bc, sb, self.chords[side])
        return bool(length < math.inf)

    def pushes_into(
        self, pose: int, following: int, cost: float, weight: float, bound: float, ready: Array
    ) -> Any:
        """Estimated costs of plans through the pushes that end at a pose, and where these begin.

        Arguments and result are those of ``rough_cost.pushes_into``.
        """
        return pushes_into(
            pose,
            following,
            cost,
            weight,
            self.poses,
            self.robots,
            self.room,
            self.chords,
            self.grasps,
            *self._costs,
            bound,
            *self._view,
            ready,
        )

    def side_change(self, pose: int, before: int, after: int) -> float:
        """Cost [m] of changing from one side to another at a pose; 0 if the side is the same.

        before, after: numbers of the sides; -1 for ``after`` if no push follows.
        """
        if after < 0 or before == after:
            return 0.0
        way = self.robots[before, pose, :2] - self.robots[after, pose, :2]
        return float(np.hypot(*way)) + self.scene.settings.side_change_cost

    def push(
        self, first: int, last: int, side: int, statistics: SearchStatistics
    ) -> PushStep | None:
        """The push on a side from one pose to another; computed once and then stored.

        None if there is no curve within the curvature limits, or if it is not free of collisions.
        """
        key = (first, last, side)
        if key not in self._pushes:
            statistics.solved += 1
            self._pushes[key] = self._try(first, last, side)
            if self._pushes[key] is not None:
                statistics.feasible += 1
                self.arrivals += last == len(self.poses) - 1
            elif self.window[first, 0] <= last < self.window[first, 1]:
                self._sight[side, first, last - self.window[first, 0]] = BLOCKED
        return self._pushes[key]

    def _try(self, first: int, last: int, number: int) -> PushStep | None:
        side = self.scene.sides[number]
        start, end = self.robots[number, first, :3], self.robots[number, last, :3]
        curve = shortest_push_curve(start, end, side.trusted.minimum, side.trusted.maximum)
        if curve is None:
            return None
        leaving = self.leaving if first == 0 else math.inf
        clearance = self.scene.kept(curve, side, leaving)
        if clearance is None:
            return None
        return PushStep(side, curve, self.poses[first], self.poses[last], clearance)


@dataclass
class PushSearch:
    """A search among the poses of a graph. ``run`` does the work in slices.

    bound: [m] a solution must cost less. weight: factor (>= 1) of the estimated cost from the start
    to a push. expansions: number of pushes that may be tried. expanded: number that were tried.
    exhausted: whether all pushes that could be part of a solution were tried. solution: the pushes
    in their order, None if none was found. cost: [m] of the solution.
    """

    graph: PushGraph
    bound: float
    weight: float
    expansions: int
    expanded: int = 0
    exhausted: bool = False
    solution: tuple[PushStep, ...] | None = None
    cost: float = math.inf

    def run(self, statistics: SearchStatistics) -> Iterator[None]:
        """Search (Algorithm 1). Yields after each slice, and adds its work to the statistics.

        The order of the queue is (2.9): the cost of a node, (2.10), and an estimate of the rest.
        The thesis estimates the rest by the length of the guide path, (2.11); here ``rough_costs``
        gives it, which is nearer to the truth.
        """
        graph = self.graph
        ready, estimate = graph.rough_costs(self.bound)
        yield
        if not estimate < self.bound:
            self.exhausted = True
            return
        self._try_single_push(statistics)
        counter = itertools.count()
        queue = [(estimate, next(counter), SearchNode(len(graph.poses) - 1, -1, 0.0))]
        cheapest: dict[tuple[int, int], float] = {}
        settled: set[tuple[int, int]] = set()
        while queue and self.expanded < self.expansions:
            _, _, node = heapq.heappop(queue)
            key = (node.pose, node.side)
            if node.states is None:
                if key in settled:
                    continue
                settled.add(key)
                if node.pose == 0:
                    self.solution, self.cost = trace(node), node.cost
                    return
                node.estimates, node.states = graph.pushes_into(
                    node.pose, node.side, node.cost, self.weight, self.bound, ready
                )
            assert node.estimates is not None
            if node.tried >= len(node.states):
                continue
            state = int(node.states[node.tried])
            estimate = float(node.estimates[node.tried])
            node.tried += 1
            if node.tried < len(node.states):
                again = (float(node.estimates[node.tried]), next(counter), node)
                heapq.heappush(queue, again)
            pose, side = divmod(state, len(graph.scene.sides))
            if (pose, side) in settled:
                continue
            self.expanded += 1
            statistics.expanded += 1
            step = graph.push(pose, node.pose, side, statistics)
            if self.expanded % _SLICE == 0:
                yield
            if step is None:
                continue
            cost = node.cost + step.curve.length + graph.scene.settings.push_cost
            cost += graph.side_change(node.pose, side, node.side)
            total = cost + self.weight * float(ready[pose, side])
            plain = cost + float(ready[pose, side])
            if plain < self.bound and cost < cheapest.get((pose, side), math.inf):
                cheapest[pose, side] = cost
                statistics.generated += 1
                child = SearchNode(pose, side, cost, node, step)
                heapq.heappush(queue, (total, next(counter), child))
        self.exhausted = not queue

    def _try_single_push(self, statistics: SearchStatistics) -> None:
        """Try one push from start to goal. If there is one, other plans must cost less."""
        graph = self.graph
        for side in range(len(graph.scene.sides)):
            if graph.worth_leaving_for(side, len(graph.poses) - 1):
                step = graph.push(0, len(graph.poses) - 1, side, statistics)
                if step is not None:
                    cost = step.curve.length + graph.scene.settings.push_cost
                    if cost < self.bound:
                        self.solution, self.cost, self.bound = (step,), cost, cost


def trace(node: SearchNode) -> tuple[PushStep, ...]:
    """The pushes from a node to the goal, in the order in which they are executed."""
    steps = []
    while node.parent is not None:
        assert node.step is not None
        steps.append(node.step)
        node = node.parent
    return tuple(steps)
