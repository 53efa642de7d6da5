"""Plans as they are drawn: pushes with their sides, and the ways of robots to their places."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from push_model.arrays import Array


@dataclass(frozen=True)
class PlannedPush:
    """name: for a legend. number: of the pushed side, or of the piece of a way; it decides the
    colour. path ``(n, 2)`` [m]: of the robot's axle midpoint, or of the object."""

    name: str
    number: int
    path: Array


@dataclass(frozen=True)
class Plan:
    """time: [s]. ways: name of a robot and its path ``(n, 2)`` [m]. continues: it is the next piece
    of the plan before, which stays. cost, cost_bound: [s] of the plan, and what no plan costs less
    than; 0 if unknown."""

    time: float
    pushes: tuple[PlannedPush, ...]
    ways: tuple[tuple[str, Array], ...] = ()
    continues: bool = False
    cost: float = 0.0
    cost_bound: float = 0.0

    @property
    def gap(self) -> float:
        """What the cost may be above that of the best plan, at most, as a fraction of the latter;
        NaN if unknown."""
        known = 0.0 < self.cost_bound <= self.cost < math.inf
        return self.cost / self.cost_bound - 1.0 if known else math.nan


def from_push_plan(message: Any, time: float) -> Plan:
    """Of push_msgs/PushPlan: the pushes of one robot."""
    pushes = [
        PlannedPush(
            f"push {i + 1}: " + ("a corner" if getattr(s, "turns", False) else f"side {s.side}"),
            int(s.side),
            _points(s.trajectory.x, s.trajectory.y),
        )
        for i, s in enumerate(message.segments)
    ]
    drawn = tuple(p for p in pushes if len(p.path))
    return Plan(time, drawn, cost=float(message.cost), cost_bound=float(message.cost_bound))


def from_group_plan(message: Any, time: float, number: int) -> Plan:
    """Of push_msgs/GroupPlan: one push of a group, and the ways of its robots. number: pieces of
    the job before this one."""
    count = len(message.pushers)
    push = PlannedPush(f"push {number + 1}: {count} robots", number, _points(message.x, message.y))
    ways = [(str(m.robot), _points(m.x, m.y)) for m in message.moves]
    return Plan(
        time,
        (push,) if len(push.path) else (),
        tuple((r, p) for r, p in ways if len(p) > 1),
        continues=number > 0,
    )


def from_path(message: Any, time: float) -> Plan:
    """Of nav_msgs/Path, where there is no other plan."""
    points = [(p.pose.position.x, p.pose.position.y) for p in message.poses]
    path = _points(*zip(*points, strict=True)) if points else np.zeros((0, 2))
    return Plan(time, (PlannedPush("planned path", 0, path),) if len(path) else ())


def merged(plans: Sequence[Plan]) -> Plan | None:
    """The plan that stands after several: the last one that continues none, and those after it."""
    first = max((i for i, p in enumerate(plans) if not p.continues), default=0)
    kept = plans[first:]
    if not kept:
        return None
    return replace(kept[-1], pushes=tuple(q for p in kept for q in p.pushes), continues=False)


def _points(x: Sequence[float], y: Sequence[float]) -> Array:
    """``(n, 2)`` [m]; none at all if one is not finite or the numbers of values differ."""
    if len(x) != len(y):
        return np.zeros((0, 2))
    points = np.column_stack([np.asarray(x, np.float64), np.asarray(y, np.float64)])
    return points if np.isfinite(points).all() else np.zeros((0, 2))
