"""Two ways to clear an area: the planner of this project, and the policy GTSP of Bench-Push.

Both see what benchnpin tells of an episode: the pose of the robot, rounded to 1 cm and 0.01 rad,
and the outlines of the boxes.
"""

import math
from collections.abc import Generator
from typing import Any

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.outlines import overlap
from push_planner.area_clearing import AreaClearing
from push_planner.covering_tour import covering_tour
from push_planner.sweeps import Area, Front, Sweep

FRONT = Front(0.72, 0.72, 1.2)
"""Of the robot of benchnpin's area clearing: a flat bumper, 2.4 m wide."""
_SPARE = 1.05  # [m] that a box needs beyond an edge
_MOST = 60  # sweeps of an episode
_AT = 0.03  # [m] from a point at which it is reached
_TURNED = 0.012  # [rad], likewise
_EASE = 0.2  # [s] in which errors are to vanish

Action = tuple[float, float]
"""Speed and turn rate, of the greatest ones."""
Policy = Generator[Action, dict[str, Any], None]
"""Yields actions, and is sent what the room tells after each. Ends when it has no more to do."""


def sweeping(room: dict[str, Any]) -> Policy:
    """Sweeps of ``push_planner.area_clearing``, planned anew one by one; within the action space,
    which is [-1, 1] for both actions. room: as told after a reset."""
    fixed = tuple(np.array(outline) for outline in room["fixed"])
    edges = tuple(np.array(edge) for edge in room["edges"])
    limits = np.array(room["limits"])
    area = Area(np.array(room["area"]), edges, limits, fixed, _SPARE)
    planner, robot, seen = AreaClearing(area, FRONT), _Robot(room), room
    for _ in range(_MOST):
        boxes = [np.array(box) for box in seen["boxes"]]
        planned = planner.next_sweep(np.array(seen["pose"]), boxes)
        if planned is None:
            return
        way, sweep, _ = planned
        for point in way[:-1]:
            seen = yield from robot.drive(seen, point, None)
        seen = yield from robot.drive(seen, way[-1], sweep.heading)
        seen = yield from robot.sweep(seen, sweep, area.outline)


class _Robot:
    """Drives to points and along sweeps, and turns on the spot between."""

    def __init__(self, room: dict[str, Any]) -> None:
        self._speed, self._turn = room["speed"], room["turn"] / 2.0  # half, as benchnpin takes it

    def drive(
        self, seen: dict[str, Any], point: Array, then: float | None
    ) -> Generator[Action, dict[str, Any], dict[str, Any]]:
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
        seen = yield from self._face(seen, course + back)
        nearest = math.inf
        while True:
            away = point - seen["pose"][:2]
            distance = float(np.hypot(*away))
            if distance < _AT or distance > nearest + _AT:
                return seen
            nearest = min(nearest, distance)
            error = se2.wrap(math.atan2(away[1], away[0]) + back - seen["pose"][2])
            turn = 2.0 * error if distance > 5.0 * _AT else 0.0
            seen = yield self._action(sign * distance / _EASE, turn)

    def sweep(
        self, seen: dict[str, Any], sweep: Sweep, area: Array
    ) -> Generator[Action, dict[str, Any], dict[str, Any]]:
        """Straight on until all boxes of the sweep have left, a quarter of a metre too far at
        most."""
        out = np.array([math.cos(sweep.heading), math.sin(sweep.heading)])
        across = np.array([-out[1], out[0]])
        takes = [k for k in range(len(seen["boxes"])) if sweep.takes >> k & 1]
        seen = yield from self._face(seen, sweep.heading)
        while True:
            left = float((sweep.end - seen["pose"][:2]) @ out)
            gone = not any(overlap(area, np.array(seen["boxes"][k])) for k in takes)
            if (takes and gone) or left < (-0.25 if takes else 0.0):
                return seen
            beside = float((seen["pose"][:2] - sweep.start) @ across)
            course = sweep.heading - min(max(0.5 * beside, -0.3), 0.3)
            seen = yield self._action(self._speed, 1.5 * se2.wrap(course - seen["pose"][2]))

    def _face(
        self, seen: dict[str, Any], heading: float
    ) -> Generator[Action, dict[str, Any], dict[str, Any]]:
        while abs(error := se2.wrap(heading - seen["pose"][2])) > _TURNED:
            seen = yield self._action(0.0, 0.9 * error / _EASE)
        return seen

    def _action(self, speed: float, turn: float) -> Action:
        """Of [m/s] and [rad/s]."""
        ahead, round_ = speed / self._speed, turn / self._turn
        return min(max(ahead, -1.0), 1.0), min(max(round_, -1.0), 1.0)


def gtsp(room: dict[str, Any]) -> Policy:
    """The policy GTSP of Bench-Push, rebuilt: one push a box, the tour once at the start.

    Pushes, costs and control are those of its published code (IvanIZ/BenchPush); its solver of the
    travelling salesman's problem, GLNS, is replaced by an exact one. As there, turn rates are not
    limited to the action space.
    """
    pushes = [np.array(push) for box in room["pushes"] for push in box]
    takes = np.array([1 << k for k, box in enumerate(room["pushes"]) for _ in box])
    heading = np.array([math.cos(room["pose"][2]), math.sin(room["pose"][2])])
    first = [_gtsp_cost(np.array(room["pose"][:2]), heading, push) for push in pushes]
    between = [[_gtsp_cost(p[-1], p[-1] - p[-2], q) for q in pushes] for p in pushes]
    order, _ = covering_tour(np.array(first), np.array(between), takes)
    seen = room
    for point in [pushes[k][end] for k in order for end in (0, -1)]:
        while np.hypot(*(point - seen["pose"][:2])) >= 0.4:
            away = point - seen["pose"][:2]
            error = se2.wrap(math.atan2(away[1], away[0]) - seen["pose"][2])
            seen = yield 1.0, error / 0.8 / room["turn"]


def _gtsp_cost(here: Array, heading: Array, push: Array) -> float:
    """Of the way to a push; that of the push itself is not counted."""
    way = push[0] - here
    turns = _between(heading, way) + _between(way, push[-1] - push[-2])
    return 0.5 * float(np.hypot(*way)) + 0.25 * math.pi * turns


def _between(a: Array, b: Array) -> float:
    """Angle [rad]; 0 where one of them has no length."""
    lengths = float(np.hypot(*a) * np.hypot(*b))
    return math.acos(min(max(float(a @ b) / lengths, -1.0), 1.0)) if lengths else 0.0
