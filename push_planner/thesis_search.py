"""Layer 2 as the thesis prints it: Algorithms 1 and 2, without the additions of this project.

It serves for comparison: it misses plans that the default search finds. It returns its first plan.
"""

import heapq
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from push_model import se2
from push_planner.candidate_poses import Candidates
from push_planner.guide_path import GuidePath, waypoints
from push_planner.push_graph import PushGraph, PushStep, SearchStatistics
from push_planner.push_search import SearchNode, trace
from push_planner.scene import PushScene

_SLICE = 20  # pushes tried between two reports


def poses_on(scene: PushScene, guide: GuidePath) -> Candidates:
    """Object poses on Gamma: waypoints, and at each of them every side once across the path.

    The path of layer 1 has no angles and the thesis does not say which ones Algorithm 2 uses: here
    a robot on one of the sides drives along the tangent.
    """
    points, headings, at = waypoints(guide, scene.settings.waypoint_spacing)
    turns = [side.contact.heading for side in scene.sides]
    poses = [
        (*point, se2.wrap(heading + turn))
        for point, heading in zip(points[1:-1], headings[1:-1], strict=True)
        for turn in turns
    ]
    way = np.repeat(at[1:-1], len(turns))
    return Candidates(np.array(poses, dtype=np.float64).reshape(-1, 3), way)


@dataclass
class ThesisSearch:
    """``run`` yields now and then, and ends with the first solution of Algorithm 1.

    graph: of the poses on Gamma. expansions: how many pushes may be tried. solution, cost: what
    was found, and its cost (2.10) [m] as printed.
    """

    graph: PushGraph
    expansions: int
    expanded: int = 0
    solution: tuple[PushStep, ...] | None = None
    cost: float = math.inf

    def run(self, statistics: SearchStatistics) -> Iterator[None]:
        """Algorithm 1; adds to the statistics."""
        graph = self.graph
        counter = itertools.count()
        goal = len(graph.poses) - 1
        queue = [(float(graph.way[goal]), next(counter), SearchNode(goal, -1, 0.0))]
        cheapest: dict[tuple[int, int], float] = {}
        while queue:
            _, _, node = heapq.heappop(queue)
            if node.pose == 0:
                self.solution, self.cost = trace(node), node.cost
                return
            if node.cost > cheapest.get((node.pose, node.side), math.inf):
                continue
            statistics.expanded += 1
            for child in self._successors(node, statistics):
                if self.expanded % _SLICE == 0:
                    yield
                if self.expanded >= self.expansions:
                    return
                if child is None or not child.cost < cheapest.get((child.pose, child.side), np.inf):
                    continue
                cheapest[child.pose, child.side] = child.cost
                statistics.generated += 1
                guess = child.cost + float(graph.way[child.pose])  # (2.9), (2.11)
                heapq.heappush(queue, (guess, next(counter), child))

    def _successors(
        self, node: SearchNode, statistics: SearchStatistics
    ) -> Iterator[SearchNode | None]:
        """Algorithm 2: from the first place on Gamma from which a push leads to the node's pose.

        None for a push that there is not.
        """
        graph, found = self.graph, -1.0
        for pose in range(node.pose):
            here = float(graph.way[pose])
            if found >= 0.0 and here > found:
                return
            if pose and here >= graph.way[node.pose]:
                return
            for side in range(len(graph.scene.sides)):
                self.expanded += 1
                step = graph.push(pose, node.pose, side, statistics)
                if step is None or not graph.room[side, pose]:
                    yield None
                    continue
                found = here
                cost = node.cost + step.curve.length + self._change(node, side)
                yield SearchNode(pose, side, cost, node, step)

    def _change(self, node: SearchNode, side: int) -> float:
        """[m] between the robot's places before and after a change of side, Figure 2.3."""
        if node.side in (-1, side):
            return 0.0
        robots = self.graph.robots[:, node.pose, :2]
        return float(np.hypot(*(robots[node.side] - robots[side])))
