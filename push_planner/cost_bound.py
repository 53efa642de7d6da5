"""A lower bound on the cost of every plan between two poses of the object.

Successive pushes on the same side are called a run. In a run the robot drives a curve whose
curvature is within the limits of that side, so a run is not shorter than the shortest path of
bounded curvature (dubins_bound.py). Obstacles lengthen it: the object's centre of mass has a least
distance to them, and it moves at most ``fastest`` times as far as the robot. The cost (2.10) of a
plan is therefore at least the smallest of these:

- one run: the time of its bound, and that to speed up and to brake;
- two runs: the smallest sum of two bounds over all poses at which the side is changed, and the
  times to speed up and to brake twice and of one change;
- three runs or more: the distance that the centre must move, or the length in which the object can
  turn as far as it must, and the times to speed up and to brake three times and of two changes.

Obstacles may block the shortest single run (single_run.py). At a change of the side, object and
robot need room. The first push needs room for the robot at the start, the last one at the goal;
other sides do not count there. The smallest sum over poses is found by branch and bound. A box of
positions and headings has a bound of its own, and the box with the lowest bound is divided next.
The work may stop at any time: the lowest bound of the boxes that are left is valid.
"""

import heapq
import math
from collections.abc import Iterator
from typing import Any

import numba
import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.distance_field import lookup
from push_planner.least_way import way_at
from push_planner.run_bounds import part_of_run, run_length, run_time, stands
from push_planner.run_ends import RunEnds
from push_planner.scene import TURNING, PushScene
from push_planner.single_run import least_single_run

_SMALL = 0.1  # [m] that bodies move in a box in which it is asked whether they can stand
_BATCH = 64  # boxes that are divided at a time
_WORTH = 0.003  # of the cost: boxes that may save less are not divided


@numba.njit(cache=True)  # infinities: no fast mathematics
def _of_boxes(
    boxes: Any,
    starts: Any,
    leaves: Any,
    goals: Any,
    arrives: Any,
    contacts: Any,
    radii: Any,
    fastest: Any,
    changes: Any,
    speeds: Any,
    begin: float,
    gone: Any,
    left: Any,
    places: Any,
    keeps: Any,
    bodies: Any,
    field: Any,
    ox: float,
    oy: float,
    scale: float,
) -> Any:
    """Lower bounds [s] of the cost of plans of two runs that change the side within a box.

    Parameters
    ----------
    boxes: ``(n, 5)`` x, y [m], theta [rad] of the centre, half the width in x and y [m], in theta
        [rad].
    starts, leaves, goals, arrives, contacts, radii, fastest: see ``RunEnds``.
    changes: ``(sides, sides)`` [s] of a change of the side; infinite on the diagonal.
    speeds, begin: see ``run_time``; [s] that each run takes longer.
    gone, left, places: levels of ``RunEnds.gone`` and ``.left``; their ox, oy and scale.
    keeps: [m] distance to obstacles of the centre, of the bodies, of the robot behind a contact.
    bodies: see ``PushScene.bodies``.
    """
    n, sides = boxes.shape[0], contacts.shape[0]
    result = np.full(n, math.inf)
    first, second = np.empty(sides), np.empty(sides)
    object_points, robot_points, object_radius, robot_radius, backs = bodies
    rounding = 1.0 / scale  # what is looked up is a lower bound, by less than that
    for k in range(n):
        x, y, theta, half, slack = boxes[k]
        off = half * math.sqrt(2.0)
        if lookup(field, x, y, ox, oy, scale) + off + rounding < keeps[0]:
            continue
        about = off + 2.0 * object_radius * math.sin(0.5 * slack)
        if about < _SMALL and not stands(
            object_points, object_radius, x, y, theta, keeps[1] - about - rounding,
            field, ox, oy, scale,
        ):  # fmt: skip
            continue
        way = way_at(gone, x, y, half, places[0], places[1], places[2])
        rest = way_at(left, x, y, half, places[0], places[1], places[2])
        c, s = math.cos(theta), math.sin(theta)
        for side in range(sides):
            first[side] = second[side] = math.inf
            gx, gy, turned = contacts[side]
            rx, ry, angle = x + c * gx - s * gy, y + s * gx + c * gy, theta + turned
            around = off + 2.0 * math.hypot(gx, gy) * math.sin(0.5 * slack)
            if around < _SMALL:
                free = False
                for back in backs[side]:
                    bx, by = rx - back * math.cos(angle), ry - back * math.sin(angle)
                    sway = around + 2.0 * back * math.sin(0.5 * slack) + rounding
                    free |= lookup(field, bx, by, ox, oy, scale) + sway >= keeps[2]
                if not free:
                    continue
                sway = around + 2.0 * robot_radius * math.sin(0.5 * slack) + rounding
                if not stands(
                    robot_points, robot_radius, rx, ry, angle, keeps[1] - sway, field, ox, oy, scale
                ):
                    continue
            there, here = radii[side], radii[side, ::-1]
            ax, ay, before = starts[side]
            if leaves[side]:
                length, turn = part_of_run(
                    ax, ay, before, rx, ry, angle, there, way / fastest[side], around, slack
                )
                first[side] = run_time(length, turn, speeds)
            bx, by, after = goals[side]
            if arrives[side]:
                # The way into the goal, driven backward: left turns become right ones.
                length, turn = part_of_run(
                    bx, by, after + math.pi, rx, ry, angle + math.pi, here, rest / fastest[side],
                    around, slack,
                )  # fmt: skip
                second[side] = run_time(length, turn, speeds)
        for a in range(sides):
            for b in range(sides):
                result[k] = min(result[k], first[a] + second[b] + changes[a, b])
        result[k] += 2.0 * begin
    return result


class CostBound:
    """The bound for one start and one goal in a scene.

    one, two, several: [s] the cost of no plan of one run, of two runs, of three or more is less.
    ends: what is known of the runs.
    """

    def __init__(self, scene: PushScene, start: Array, goal: Array) -> None:
        """Bound by the costs of one run and of three runs.

        Parameters
        ----------
        scene: with at least one side to push on.
        start, goal: ``(3,)`` [m, m, rad] poses of the object's centre of mass, world frame.
        """
        settings, time = scene.settings, scene.time
        self._scene = scene
        ends = self.ends = RunEnds.of(scene, start, goal)
        changes = time.changes.copy()
        np.fill_diagonal(changes, math.inf)
        speeds = time.speeds
        behind = scene.robot.footprint_radius + TURNING * settings.safety_distance
        self._known = (
            *(ends.starts, ends.leaves, ends.goals, ends.arrives, ends.contacts, ends.radii),
            *(ends.fastest, changes, speeds, time.begin, ends.gone.levels, ends.left.levels),
            ends.gone.places,
            (ends.least, ends.nearest, behind),
            scene.bodies,
            scene.field.values,
            *scene.field.args,
        )
        speed, change = float(ends.fastest.max()), float(changes.min())
        straight = math.hypot(*(goal - start)[:2])
        turn = abs(float(se2.wrap(goal[2] - start[2])))
        length = max(max(ends.gone.at(goal), straight) / speed, turn * float(ends.radii.min()))
        least = run_time(length, 0.0, speeds)
        self._runs = np.full(len(scene.sides), math.inf)
        for k in np.flatnonzero(ends.leaves & ends.arrives):
            shortest = run_length(*ends.starts[k], *ends.goals[k], ends.radii[k], 0.0, 0.0)
            self._runs[k] = run_time(max(length, shortest), turn, speeds)
        self.one = max(time.begin + float(self._runs.min()), time.begin + least)
        self.several = 3.0 * time.begin + 2.0 * change + least
        self._fixed, self._speed = 2.0 * time.begin + change, speed / time.pace
        self.two = self._fixed + least
        self._centre = 0.5 * (start + goal)[:2]
        self._turning = float(ends.radii.mean())

    @property
    def value(self) -> float:
        """[s] the cost of no plan is less."""
        return float(min(self.one, self.two, self.several))

    def run(self, boxes: int, cost: float = math.inf) -> Iterator[None]:
        """Raise the bound by dividing up to so many boxes. Yields after each slice.

        boxes: of changes of the side; with 0, the bound stays as it is. cost: [s] of a known plan;
        the bound is not raised above it.
        """
        if boxes > 0:
            yield from self._raise_two(boxes, min(self.several, cost))
            yield from self._raise_one(min(self.several, self.two, cost))

    def _raise_one(self, most: float) -> Iterator[None]:
        """Raise the bound of plans of one run up to so much [s]."""
        begin = self._scene.time.begin
        for side in np.argsort(self._runs):
            if begin + self._runs[side] >= most:
                break
            least = float(self._runs[side])
            for bound in least_single_run(self._scene, self.ends, int(side), most - begin):
                self._runs[side] = max(least, bound)
                self.one = max(self.one, begin + float(self._runs.min()))
                yield

    def _raise_two(self, boxes: int, most: float) -> Iterator[None]:
        """Raise the bound of plans of two runs up to so much [s]."""
        reach = 0.5 * self._speed * (most - self._fixed)  # the ellipse of the centre is within it
        if self.two >= most or reach <= 0.0:
            return
        # As much of the bound is lost by the width of a box as by its headings.
        count = max(1, math.ceil(math.pi * 2.0 * self._turning / (reach * math.sqrt(2.0))))
        slack = math.pi / count
        roots = [(*self._centre, (2 * k + 1) * slack, reach, slack) for k in range(count)]
        queue: list[tuple[float, int, tuple[float, ...]]] = []
        made = self._add(queue, np.array(roots), 0, most)
        while queue and queue[0][0] < (1.0 - _WORTH) * most and boxes > 0:
            self.two = max(self.two, queue[0][0])
            taken = [heapq.heappop(queue)[2] for _ in range(min(_BATCH, len(queue)))]
            boxes -= len(taken)
            made = self._add(queue, _divided(np.array(taken)), made, most)
            yield
        self.two = max(self.two, min(queue[0][0] if queue else math.inf, most))

    def of_boxes(self, boxes: Array) -> Array:
        """Bounds ``(n,)`` [s] of plans of two runs that change the side in a box ``(n, 5)``: x, y
        [m], theta [rad] of its centre, half its width in x and y [m] and in theta [rad]."""
        found: Array = _of_boxes(boxes, *self._known)
        return found

    def _add(
        self,
        queue: list[tuple[float, int, tuple[float, ...]]],
        boxes: Array,
        made: int,
        most: float,
    ) -> int:
        """Put boxes into the queue that may hold a cheaper plan; counts those that were made."""
        bounds = self.of_boxes(boxes)
        for bound, box in zip(bounds.tolist(), boxes.tolist(), strict=True):
            if bound < most:
                made += 1
                heapq.heappush(queue, (max(bound, self.two), made, tuple(box)))
        return made


def _divided(boxes: Array) -> Array:
    """The eight parts of each box, in the middle of x, y and theta."""
    signs = np.array([(i, j, k) for i in (-0.5, 0.5) for j in (-0.5, 0.5) for k in (-0.5, 0.5)])
    widths = boxes[:, [3, 3, 4]]
    centres = boxes[:, None, :3] + signs[None] * widths[:, None]
    halves = np.repeat(0.5 * boxes[:, None, 3:], 8, axis=1)
    return np.concatenate([centres, halves], axis=2).reshape(-1, 5)
