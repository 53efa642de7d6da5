"""The graph of layer 2: object poses, and the pushes between them, each computed when asked for.

The result of a push is stored. It serves all nodes of a search that the push may lead to, and the
estimates of later searches.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from push_model import se2
from push_model.arrays import Array
from push_planner.candidate_poses import Candidates
from push_planner.drive_risk import TIGHT, drive_risk
from push_planner.push_curve import PushCurve, shortest_push_curve
from push_planner.robot_path import has_way
from push_planner.rough_cost import BLOCKED, guessed_length, pushes_into, rough_costs
from push_planner.scene import PushScene, PushSide
from push_planner.shortest_chord import shortest_chords


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
    and object to obstacles along the push. time: [s] that it takes at full speed, see
    ``plan_time.py``.
    """

    side: PushSide
    curve: PushCurve
    object_start: Array
    object_end: Array
    clearance: float
    time: float


def risk_of(scene: PushScene, steps: Sequence[PushStep]) -> float:
    """[s] of all drives between pushes, see drive_risk.py; each of them is known to be possible."""
    changes = [(a, b) for a, b in pairwise(steps) if a.side.index != b.side.index]
    risks = [drive_risk(scene, b.object_start, a.side, b.side) for a, b in changes]
    return sum(min(risk, TIGHT) for risk in risks)


class PushGraph:
    """Object poses, estimated costs of the pushes between them, and the pushes that were computed.

    The first pose is the start, the last one is the goal, and the others are ordered along Gamma.
    """

    def __init__(
        self,
        scene: PushScene,
        start: Array,
        goal: Array,
        candidates: Candidates,
        reach: float,
        robot: Array | None = None,
        change_weight: float = 1.0,
        on_side: int | None = None,
    ) -> None:
        """Build the graph.

        Parameters
        ----------
        scene: robot, object and map.
        start, goal: ``(3,)`` [m, m, rad] poses of the object's centre of mass, world frame.
        candidates: poses of the object between start and goal.
        reach: [m] longest distance along Gamma that one push may cover.
        robot: ``(3,)`` pose of the robot before the first push; None if unknown.
        change_weight: fraction of the time of a change of the side that counts.
        on_side: index of the side on which the robot pushes at the start; None if it does not.
        """
        self.scene = scene
        self._on_side = on_side
        self._robot = robot
        self._ways: dict[tuple[int, int, int], float] = {}  # [s] that they cost more
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
        settings, time = scene.settings, scene.time
        widest = int((self.window[:, 1] - self.window[:, 0]).max())
        self._sight = np.zeros((*self.room.shape, widest), dtype=np.int8)
        # After a change the robot speeds up anew.
        self._change_weight = change_weight
        self._changes = change_weight * time.changes
        self._changes += time.begin * (1.0 - np.eye(len(self._changes)))
        self._first = [time.first_change(on_side, s.index, change_weight) for s in scene.sides]
        self.begin = time.begin
        """[s] that the first push takes longer, because the robot speeds up and brakes."""
        self._pace = time.pace
        keeps = np.array([self.leaving, settings.safety_distance])
        least = scene.shape.inradius + np.minimum(keeps, settings.safety_distance)
        self._view = (self.window, self._sight, least, scene.field.values, *scene.field.args)
        self.arrivals = 0  # pushes found that end at the goal
        self._pushes: dict[tuple[int, int, int], PushStep | None] = {}

    def rough_costs(self, bound: float) -> tuple[Array, float]:
        """Estimated cost [s] from the start to each state ``(n, sides)``, and of a whole plan [s].

        bound: [s] states whose estimate exceeds it are left out.
        """
        ready, arrived = rough_costs(
            self.poses,
            self.robots,
            self.room,
            self.chords,
            self.grasps,
            self._pace,
            self.begin,
            self._changes,
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

    def joined(self, goal: bool) -> NDArray[np.int64]:
        """Numbers of the poses that the pushes found so far join to the start, or to the goal."""
        pairs = [(a, b) for (a, b, _), step in self._pushes.items() if step is not None]
        follow: dict[int, set[int]] = {}
        for first, last in pairs:
            follow.setdefault(last if goal else first, set()).add(first if goal else last)
        end = len(self.poses) - 1 if goal else 0
        found, new = {end}, [end]
        while new:
            more = follow.get(new.pop(), set()) - found
            found |= more
            new += more
        return np.array(sorted(found - {end}), dtype=np.int64)

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
            self._pace,
            self._changes,
            bound,
            *self._view,
            ready,
        )

    def side_change(self, pose: int, before: int, after: int) -> float:
        """Cost [s] of changing from one side to another at a pose, and of speeding up again, and
        the risk of the drive, see ``look_for_way``; 0 if the side is the same.

        before, after: numbers of the sides; -1 for ``after`` if no push follows.
        """
        if after < 0 or before == after:
            return 0.0
        return float(self._changes[before, after]) + self._ways.get((pose, before, after), 0.0)

    def first_change(self, side: int) -> float:
        """Cost [s] of changing to a side at the start; 0 if the robot does not push there."""
        return self._first[side]

    def may_begin(self, side: int) -> bool:
        """Whether the robot can go from where it is to a side at the start, as far as is known."""
        if self._robot is None or self.scene.sides[side].index == self._on_side:
            return True
        key = (0, -1, side)
        if key not in self._ways:
            scene = self.scene
            goal = scene.standoff(self.robots[side, 0, :3], scene.sides[side])
            outline = se2.transform(self.poses[0], scene.shape.outline)
            given = scene.field, scene.robot, scene.settings, self._robot, goal, outline
            self._ways[key] = 0.0 if has_way(*given) else math.inf
        return self._ways[key] < math.inf

    def may_change(self, pose: int, before: int, after: int) -> bool:
        """Whether the robot can go round the object at a pose, from one side to another. Computed
        when it is first asked for, and told by ``side_change`` from then on."""
        self.look_for_way(pose, before, after)
        return self.side_change(pose, before, after) < math.inf

    def look_for_way(self, pose: int, before: int, after: int) -> None:
        """Have ``side_change`` tell the risk of the drive, which is infinite if there is no way;
        before, it assumes that there is a wide one."""
        key = (pose, before, after)
        if after < 0 or before == after or key in self._ways:
            return
        sides = self.scene.sides[before], self.scene.sides[after]
        self._ways[key] = self._change_weight * drive_risk(self.scene, self.poses[pose], *sides)

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
        time = self.scene.time.of_push(curve)
        return PushStep(side, curve, self.poses[first], self.poses[last], clearance, time)
