"""Ways to clear an area: the planner of this project, and the policy GTSP of Bench-Push.

All see the pose of the robot, rounded by benchnpin to 1 cm and 0.01 rad, and the outlines of the
boxes. The planner of this project is also told the walls and columns, which GTSP does not use.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.outlines import overlap
from push_planner.area_clearing import AreaClearing
from push_planner.covering_tour import covering_tour
from push_planner.sweeps import Area, Front, Sweep
from push_study.bench_push.robot import EASE, Blocked, Policy, Robot, Seen, Steps

FRONT = Front(0.72, 0.72, 1.22)
"""Of the robot of benchnpin's area clearing: a flat bumper, 2.4 m wide, with rounded corners."""
_SPARE = 1.05  # [m] that a box needs beyond an edge
_MOST = 100  # plans of an episode
_MOVED = 0.3  # [m] of a box after which its sweep is planned anew
_AT = 0.03  # [m] from a point at which it is reached


def sweeping(room: Seen) -> Policy:
    """Sweeps of ``push_planner.area_clearing``, planned anew one by one; within the action space,
    which is [-1, 1] for both actions. room: as told after a reset."""
    fixed = tuple(np.array(outline) for outline in room["fixed"])
    edges = tuple(np.array(edge) for edge in room["edges"])
    limits = np.array(room["limits"])
    area = Area(np.array(room["area"]), edges, limits, fixed, _SPARE)
    planner, robot, seen = AreaClearing(area, FRONT), _Sweeper(room), room
    for _ in range(_MOST):
        boxes = [np.array(box) for box in seen["boxes"]]
        planned = planner.next_sweep(np.array(seen["pose"]), boxes)
        if planned is None:
            return
        way, sweep = planned
        try:
            for point in way[:-1]:
                seen = yield from robot.drive(seen, point, None)
                if moved(sweep, boxes, seen):
                    break
            else:
                seen = yield from robot.drive(seen, way[-1], sweep.heading)
                seen = yield from robot.face(seen, sweep.heading)
                if not moved(sweep, boxes, seen):
                    seen = yield from robot.sweep(seen, sweep, area.outline)
        except Blocked as blocked:
            seen = yield from robot.back_off(blocked.seen)


def moved(sweep: Sweep, boxes: Sequence[Array], seen: Seen) -> bool:
    """Whether a box that a sweep takes is no longer where it was: the robot has pushed it on its
    way. Of shifts, which take none, this is not known. boxes: outlines ``(k, 2)`` [m] when the
    sweep was planned; seen: as the room tells now."""
    taken = [k for k in range(len(boxes)) if sweep.takes >> k & 1]
    return any(
        np.hypot(*(np.array(seen["boxes"][k]) - boxes[k]).mean(axis=0)) > _MOVED for k in taken
    )


class _Sweeper(Robot):
    """Drives to points and along sweeps, and turns on the spot between."""

    def __init__(self, room: Seen) -> None:
        super().__init__(room, room["speed"], room["turn"] / 2.0)  # half, as benchnpin takes it

    def drive(self, seen: Seen, point: Array, then: float | None) -> Steps:
        """Ahead or back to a point, whichever needs fewer turns, also to the heading ``then``."""
        away = point - seen["pose"][:2]
        if np.hypot(*away) < 2.0 * _AT:
            return seen
        course = math.atan2(away[1], away[0])
        turns = [
            abs(se2.wrap(course + back - seen["pose"][2]))
            + (0.0 if then is None else abs(se2.wrap(then - course - back)))
            for back in (0.0, math.pi)
        ]
        back, sign = (0.0, 1.0) if turns[0] <= turns[1] else (math.pi, -1.0)
        seen = yield from self.face(seen, course + back)
        nearest = math.inf
        while True:
            away = point - seen["pose"][:2]
            distance = float(np.hypot(*away))
            if distance < _AT or distance > nearest + _AT:
                return seen
            nearest = min(nearest, distance)
            error = se2.wrap(math.atan2(away[1], away[0]) + back - seen["pose"][2])
            turn = 2.0 * error if distance > 5.0 * _AT else 0.0
            seen = yield from self.act(sign * distance / EASE, turn)

    def sweep(self, seen: Seen, sweep: Sweep, area: Array) -> Steps:
        """Straight on until all boxes of the sweep have left, a quarter of a metre too far at
        most."""
        out = np.array([math.cos(sweep.heading), math.sin(sweep.heading)])
        across = np.array([-out[1], out[0]])
        takes = [k for k in range(len(seen["boxes"])) if sweep.takes >> k & 1]
        seen = yield from self.face(seen, sweep.heading)
        while True:
            left = float((sweep.end - seen["pose"][:2]) @ out)
            gone = not any(overlap(area, np.array(seen["boxes"][k])) for k in takes)
            if (takes and gone) or left < (-0.25 if takes else 0.0):
                return seen
            beside = float((seen["pose"][:2] - sweep.start) @ across)
            course = sweep.heading - min(max(0.5 * beside, -0.3), 0.3)
            turn = 1.5 * se2.wrap(course - seen["pose"][2])
            seen = yield from self.act(self.speed, turn)


def gtsp(room: Seen) -> Policy:
    """The policy GTSP of Bench-Push, rebuilt: one push a box, the tour once at the start.

    Pushes, costs and control are those of its published code (IvanIZ/BenchPush, e9f865b); its
    solver of the travelling salesman's problem, GLNS, is replaced by an exact one. As there, the
    tour is a closed one, of which the way back is not driven, and turn rates are not limited to the
    action space.
    """
    yield from _gtsp_tour(room, room)


def gtsp_again(room: Seen) -> Policy:
    """GTSP, planned anew at the end of each tour, for the boxes that are still in the area."""
    seen, area = room, np.array(room["area"])
    while any(_in(area, box) for box in seen["boxes"]):
        seen = yield from _gtsp_tour(room, seen)


def _gtsp_tour(room: Seen, seen: Seen) -> Steps:
    """One tour through the boxes that are in the area."""
    area, (x, y, theta) = np.array(room["area"]), seen["pose"]
    inner = [p for p, b in zip(seen["pushes"], seen["boxes"], strict=True) if _in(area, b)]
    pushes = [np.array(push) for box in inner for push in box]
    takes = np.array([1 << k for k, box in enumerate(inner) for _ in box], dtype=np.int64)
    here, heading = np.array([x, y]), np.array([math.cos(theta), math.sin(theta)])
    first = [_gtsp_cost(here, heading, p[0], p[-1] - p[-2]) for p in pushes]
    between = [
        [_gtsp_cost(p[-1], p[-1] - p[-2], q[0], q[-1] - q[-2]) for q in pushes] for p in pushes
    ]
    home = [_gtsp_cost(p[-1], p[-1] - p[-2], here, heading) for p in pushes]
    order = covering_tour(np.array(first), np.array(between), takes, np.array(home))
    for point in [pushes[k][end] for k in order for end in (0, -1)]:
        while np.hypot(*(point - seen["pose"][:2])) >= 0.4:
            away = point - seen["pose"][:2]
            error = se2.wrap(math.atan2(away[1], away[0]) - seen["pose"][2])
            seen = yield 1.0, error / 0.8 / room["turn"]
    return seen


def _in(area: Array, box: Any) -> bool:
    return overlap(area, np.array(box))


def _gtsp_cost(here: Array, heading: Array, there: Array, then: Array) -> float:
    """Of the straight way between two points, and of the turns at both ends: from a direction, to
    another one. Pushes themselves cost nothing."""
    way = there - here
    turns = _between(heading, way) + _between(way, then)
    return 0.5 * float(np.hypot(*way)) + 0.25 * math.pi * turns


def _between(a: Array, b: Array) -> float:
    """Angle [rad]; 0 where one of them has no length."""
    lengths = float(np.hypot(*a) * np.hypot(*b))
    return math.acos(min(max(float(a @ b) / lengths, -1.0), 1.0)) if lengths else 0.0
