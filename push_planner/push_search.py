"""Layer 2: A* over object poses and pushed sides, in place of Algorithms 1 and 2.

The search runs backward from the goal, as in the thesis. A node consists of an object pose and of
the side of the push that begins there. The parent of a node is one push closer to the goal.

The printed Algorithm 2 computes the curves of pushes into a node, and stops at the first starting
pose from which one succeeds. It thereby loses plans. Here the costs of all pushes into a node are
estimated first (rough_cost.py). The curve and the swept area of a push are computed only when its
estimate is the best in the whole queue (lazy weighted A*). Whether the robot can go from side to
side between the pushes is checked on a complete sequence only. If it cannot, or if its way is so
narrow that it may turn out to be blocked, the search is repeated with the cost of that change.
"""

import heapq
import itertools
import math
from collections.abc import Generator, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from push_model.arrays import Array
from push_planner.push_graph import PushGraph, PushStep, SearchStatistics

_SLICE = 20  # pushes tried between two reports
_DETOURS = 20  # solutions of one search in which a change of sides costs more than assumed


@dataclass
class SearchNode:
    """An object pose, with the side of the push that begins there.

    pose: number of the pose in the graph. side: number of the side, -1 at the goal. cost: [s] from
    here to the goal, g of (2.10). parent: the node at which the push ends. step: that push.
    estimates, states: pushes that end at this node, from ``PushGraph.pushes_into``; None until the
    node is expanded. tried: how many of them have been taken.
    """

    pose: int
    side: int  # on which the push that starts here pushes; -1 at the goal
    cost: float  # g of (2.10), but for the robot's speeding up at the start
    parent: "SearchNode | None" = None
    step: PushStep | None = None
    estimates: Array | None = None  # of the pushes that end here
    states: NDArray[np.int64] | None = None
    tried: int = 0


@dataclass
class PushSearch:
    """A search among the poses of a graph. ``run`` does the work in slices.

    bound: [s] a solution must cost less; all costs contain the risks of drives (drive_risk.py).
    weight: factor (>= 1) of the estimated cost from the start to a push. expansions: number of
    pushes that may be tried. expanded: number that were tried. exhausted: whether all pushes that
    could be part of a solution, or of a cheaper one, were tried. solution: the pushes in their
    order, None if none was found. cost: [s] of the solution.
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
        for _ in range(_DETOURS):
            node = yield from self._cheapest(ready, estimate, statistics)
            if node is None:
                return
            changes = _changes(node)
            assumed = sum(graph.side_change(*change) for change in changes)
            for change in changes:
                graph.look_for_way(*change)
            more = sum(graph.side_change(*change) for change in changes) - assumed
            cost = graph.begin + node.cost + more
            if cost < self.bound:
                self.solution, self.cost, self.bound = trace(node), cost, cost
            if more == 0.0:
                return

    def _cheapest(
        self, ready: Array, estimate: float, statistics: SearchStatistics
    ) -> Generator[None, None, SearchNode | None]:
        """The node at the start with which the cheapest sequence of pushes begins, if any."""
        graph = self.graph
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
                    return node
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
            if step is None or (pose == 0 and not graph.may_begin(side)):
                continue
            cost = node.cost + step.time
            cost += graph.side_change(node.pose, side, node.side)
            if pose == 0:
                cost += graph.first_change(side)
            total = cost + self.weight * float(ready[pose, side])
            plain = cost + float(ready[pose, side])
            if plain < self.bound and cost < cheapest.get((pose, side), math.inf):
                cheapest[pose, side] = cost
                statistics.generated += 1
                child = SearchNode(pose, side, cost, node, step)
                heapq.heappush(queue, (total, next(counter), child))
        self.exhausted = not queue
        return None

    def _try_single_push(self, statistics: SearchStatistics) -> None:
        """Try one push from start to goal. If there is one, other plans must cost less."""
        graph = self.graph
        for side in range(len(graph.scene.sides)):
            if graph.worth_leaving_for(side, len(graph.poses) - 1) and graph.may_begin(side):
                step = graph.push(0, len(graph.poses) - 1, side, statistics)
                cost = graph.begin + graph.first_change(side) + (step.time if step else math.inf)
                if step is not None and cost < self.bound:
                    self.solution, self.cost, self.bound = (step,), cost, cost


def _changes(node: SearchNode) -> list[tuple[int, int, int]]:
    """The changes of side of a solution: the pose, and the sides before and after."""
    found = []
    while node.parent is not None:
        found.append((node.parent.pose, node.side, node.parent.side))
        node = node.parent
    return found


def trace(node: SearchNode) -> tuple[PushStep, ...]:
    """The pushes from a node to the goal, in the order in which they are executed."""
    steps = []
    while node.parent is not None:
        assert node.step is not None
        steps.append(node.step)
        node = node.parent
    return tuple(steps)
