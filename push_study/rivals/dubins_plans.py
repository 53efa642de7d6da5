"""Pushes of one object along Dubins paths, with a pre-relocation where none fits.

It is the search of ReloPush (Ahn and Mavrogiannis, arXiv 2409.18231) for one object. A push from a
side is a Dubins path of the robot, from behind the object to where it stands when the object is at
a goal. If this path is not clear, the object is first pushed straight ahead from one of its sides,
to the nearest place from which the path is clear (pre-relocation). Of all plans, the one with the
shortest pushes is the best.

Between poses that are farther from each other than a distance that depends on their headings
(``_far``), the path is a bend, a straight part and a bend. The code of the authors (``strict``)
relocates an object only if it is not so far from the goal, only to where it is, and only by the
side that has the nearest such place. The method ``dubins-push`` leaves out these conditions: it
also relocates an object whose path is blocked by obstacles, which the rooms of the authors do not
have.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from ompl import base

from push_model import se2
from push_model.arrays import Array

_EVERY = 0.01  # [m] between poses of a path
_LONGEST = 20.0  # [m] of a path
_STEP, _FARTHEST = 0.1, 5.0  # [m] between places tried for a relocation, and to the last one


@dataclass(frozen=True)
class Push:
    """What a side allows. grasp: pose ``(3,)`` of the object in the robot's frame. radius: [m] of
    the tightest bend of the robot's path."""

    grasp: Array
    radius: float


@dataclass(frozen=True)
class DubinsPlan:
    """length: [m] of the robot's path in all pushes. push: index of the first push's side. path:
    poses ``(n, 3)`` of the robot in this push. relocates: whether a second one must follow."""

    length: float
    push: int
    path: Array
    relocates: bool


Clear = Callable[[Array, int], bool]
"""Whether poses ``(n, 3)`` of the robot, pushing with the side of an index, are all allowed."""


def dubins_plans(
    item: Array, goals: Sequence[Array], pushes: Sequence[Push], clear: Clear, strict: bool = False
) -> list[DubinsPlan]:
    """Plans for an object at a pose ``(3,)`` to one of some goals ``(3,)``, best first."""
    straight: list[list[Array]] = []  # for each side: paths to the places, the nearest first
    found = []
    for k, push in enumerate(pushes):
        for goal in goals:
            path, length = _to(item, goal, push)
            if length <= _LONGEST and clear(path, k):
                found.append(DubinsPlan(length, k, path, False))
                continue
            if strict and _far(*_ends(item, goal, push), push.radius):
                continue
            straight = straight or [
                list(_straight(item, p, i, clear)) for i, p in enumerate(pushes)
            ]
            plans = list(_relocated(goal, k, pushes, straight, clear, strict))
            if strict:  # one of them, to the nearest place
                plans = sorted(plans, key=lambda plan: len(plan.path))[:1]
            found += plans
    return sorted(found, key=lambda plan: plan.length)


def _relocated(
    goal: Array,
    last: int,
    pushes: Sequence[Push],
    straight: Sequence[Sequence[Array]],
    clear: Clear,
    strict: bool,
) -> Iterator[DubinsPlan]:
    """For each side, by its shortest straight push after which the last push is clear."""
    push = pushes[last]
    for first, paths in enumerate(straight):
        for i, straight_on in enumerate(paths):
            there = se2.compose(straight_on[-1], pushes[first].grasp)
            if strict and not _far(*_ends(there, goal, push), push.radius):
                continue
            path, length = _to(there, goal, push)
            if length <= _LONGEST and clear(path, last):
                yield DubinsPlan((i + 1) * _STEP + length, first, straight_on, True)
                break


def _straight(item: Array, push: Push, index: int, clear: Clear) -> Iterator[Array]:
    """Straight paths of the robot that are clear, each a step longer."""
    x, y, heading = se2.compose(item, se2.inverse(push.grasp))
    along = np.linspace(0.0, _FARTHEST, round(_FARTHEST / _EVERY) + 1)
    rows = [x + math.cos(heading) * along, y + math.sin(heading) * along]
    path = np.column_stack([*rows, np.full(len(along), heading)])
    step = round(_STEP / _EVERY)
    for end in range(step, len(path), step):
        if not clear(path[: end + 1], index):
            return
        yield path[: end + 1]


def _ends(item: Array, goal: Array, push: Push) -> tuple[Array, Array]:
    """Poses ``(3,)`` of the robot."""
    back = se2.inverse(push.grasp)
    return se2.compose(item, back), se2.compose(goal, back)


def _to(item: Array, goal: Array, push: Push) -> tuple[Array, float]:
    return dubins(*_ends(item, goal, push), push.radius)


def _far(start: Array, goal: Array, radius: float) -> bool:
    """Whether the path is a bend, a straight part and a bend (Shkel and Lumelsky 2001)."""
    way = goal[:2] - start[:2]
    along = math.atan2(way[1], way[0])
    a, b = float(start[2]) - along, float(goal[2]) - along
    least = abs(math.sin(a)) + abs(math.sin(b))
    least += math.sqrt(4.0 - (math.cos(a) + math.cos(b)) ** 2)
    return float(np.hypot(*way)) > least * radius


def dubins(start: Array, goal: Array, radius: float) -> tuple[Array, float]:
    """Shortest path of bends no tighter than a radius [m] between poses ``(3,)``, by OMPL: poses
    ``(n, 3)``, about ``_EVERY`` apart (none where it is longer than ``_LONGEST``); its length [m].
    """
    space = base.DubinsStateSpace(radius)
    a, b, between = (space.allocState() for _ in range(3))
    for state, (x, y, heading) in ((a, start), (b, goal)):
        state.setX(float(x))
        state.setY(float(y))
        state.setYaw(float(se2.wrap(float(heading))))
    length = float(space.distance(a, b))
    if length > _LONGEST:
        return np.zeros((0, 3)), length
    poses = []
    for part in np.linspace(0.0, 1.0, max(2, math.ceil(length / _EVERY) + 1)):
        space.interpolate(a, b, float(part), between)
        poses.append((between.getX(), between.getY(), between.getYaw()))
    return np.array(poses), length
