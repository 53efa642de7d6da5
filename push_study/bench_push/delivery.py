"""Ways to deliver boxes: the planner of this project, and straight pushes for comparison.

Both see the pose of the robot, rounded by benchnpin to 1 cm and 0.01 rad, and the outlines of the
boxes that are not yet delivered, and are told what is fixed: columns, divider, pieces in corners.
"""

import math
from itertools import pairwise

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_planner.box_delivery import BoxDelivery, Delivery, DeliveryRoom, StraightDelivery
from push_study.bench_push.robot import Blocked, Policy, Robot, Seen, Steps

_MOST = 300  # plans of an episode
_MOVED = 0.15  # [m] of a box, on the robot's way to it, after which there is a new plan
_STANDS = 0.05  # [m] that a box moves at most in a push that is not tried again
_AHEAD = 0.3  # [m] of the point that the robot steers at
_TIGHTEST = 1.0, 1.3  # [1/m] of what it steers, with a box and without
_FLAT = 0.08  # [m] from the front within which a box counts as flat against it
_EASED = 0.3  # of the curvature that is steered until then
_SLOW = 0.2  # [m] before the end of a way within which the robot slows down
_LEAST = 0.05  # [m/s] of the robot there
_AT = 0.03  # [m] from the end of a way at which it is reached
_IDLE = 25  # actions without progress after which a robot counts as blocked
_BEYOND = 0.5  # [m] that the robot drives on where a box is not quite in the receptacle
_HELD = 0.35, 0.35  # [m] of a box ahead of where it touches, and aside: else the robot has lost it


def delivering(room: Seen) -> Policy:
    """Pushes of ``push_planner.box_delivery``, planned anew one by one; within the action space,
    which is [-1, 1] for both actions. room: as told after a reset."""
    yield from _with(BoxDelivery(_room(room)), room)


def straight(room: Seen) -> Policy:
    """Straight pushes, planned anew one by one; else as above."""
    yield from _with(StraightDelivery(_room(room)), room)


def _room(room: Seen) -> DeliveryRoom:
    fixed = tuple(np.array(outline) for outline in room["fixed"])
    limits, receptacle = np.array(room["limits"]), np.array(room["receptacle"])
    robot = np.array(room["robot"])
    return DeliveryRoom(limits, fixed, receptacle, robot, room["box"], room["grown"])


def _with(planner: BoxDelivery, room: Seen) -> Policy:
    robot, seen = _Pusher(room), room
    tried: set[tuple[int, int]] = set()
    for _ in range(_MOST):
        left = [k for k, box in enumerate(seen["boxes"]) if box is not None]
        boxes = [np.array(seen["boxes"][k]) for k in left]
        failed = {(left.index(k), node) for k, node in tried if k in left}
        push = planner.next_push(np.array(seen["pose"]), boxes, failed)
        if push is None and not failed:
            return
        if push is None:
            tried.clear()
            continue
        box, before = left[push.box], boxes[push.box].mean(axis=0)
        try:
            seen = yield from robot.deliver(seen, push, box)
        except Blocked as blocked:
            seen = yield from robot.back_off(blocked.seen)
        now = _middle(seen, box)
        if now is not None and np.hypot(*(now - before)) < _STANDS:
            tried.add((box, push.node))
        else:
            tried = {(k, node) for k, node in tried if k != box}


def _middle(seen: Seen, box: int) -> Array | None:
    """``(2,)`` [m] of a box; None if it is delivered."""
    outline = seen["boxes"][box]
    return None if outline is None else np.array(outline).mean(axis=0)


class _Pusher(Robot):
    """Drives ways of poses, also back, and pushes boxes along them."""

    def __init__(self, room: Seen) -> None:
        super().__init__(room, room["speed"], room["turn"])
        front = max(x for x, _ in room["robot"])
        self._touching = front + room["grown"] + 0.5 * room["box"]  # [m] to the middle of a box

    def deliver(self, seen: Seen, push: Delivery, box: int) -> Steps:
        """Go behind a box and push it along; returns as soon as the robot has lost it."""
        before = _middle(seen, box)
        for sign, poses in _parts(push.way):
            if sign == 0.0:
                seen = yield from self.face(seen, float(poses[-1, 2]))
            else:
                seen = yield from self.follow(seen, poses[:, :2], sign)
            now = _middle(seen, box)
            if before is None or now is None or np.hypot(*(now - before)) > _MOVED:
                return seen
        seen = yield from self.face(seen, float(push.path[0, 2]))
        seen = yield from self.follow(seen, push.path[:, :2], 1.0, box)
        start = np.array(seen["pose"][:2])
        while self.holds(seen, box) and np.hypot(*(seen["pose"][:2] - start)) < _BEYOND:
            seen = yield from self.act(self.speed, 0.0)
        return seen

    def holds(self, seen: Seen, box: int) -> bool:
        """Whether a box that is not yet delivered is before the front."""
        middle = _middle(seen, box)
        if middle is None:
            return False
        ahead, aside = self._seen_from(seen, middle)
        return bool(0.0 < ahead < self._touching + _HELD[0] and abs(aside) < _HELD[1])

    def _seen_from(self, seen: Seen, point: Array) -> Array:
        """``(2,)`` [m] of a point in the frame of the robot."""
        x, y, theta = seen["pose"]
        found: Array = se2.transform(se2.inverse(np.array([x, y, theta])), point[None])[0]
        return found

    def follow(self, seen: Seen, points: Array, sign: float, box: int | None = None) -> Steps:
        """Pure pursuit along points ``(n, 2)``, ahead (sign 1) or back (-1). box: that is pushed;
        returns when it is delivered or lost."""
        tightest, at, least, idle = _TIGHTEST[box is None], 0, math.inf, 0
        last = len(points) - 1
        while box is None or self.holds(seen, box):
            away = np.hypot(*(points - seen["pose"][:2]).T)
            at += int(away[at : at + 4].argmin())
            aim = next((k for k in range(at, last) if away[k] >= _AHEAD), last)
            x, y = sign * self._seen_from(seen, points[aim])
            if aim == last and x < _AT:
                return seen
            curvature = 2.0 * y / max(x * x + y * y, 0.01)
            if box is not None and not self._flat(seen, box):
                curvature *= _EASED
            curvature = min(max(curvature, -tightest), tightest)
            speed = (
                self.speed if aim < last else max(_LEAST, min(self.speed * x / _SLOW, self.speed))
            )
            seen = yield from self.act(sign * speed, speed * curvature)
            left = float(np.hypot(*(points[-1] - seen["pose"][:2]))) + 0.4 * (last - aim)
            idle = 0 if left < least - 0.01 else idle + 1
            least = least if idle else left
            if idle > _IDLE:
                raise Blocked(seen)
        return seen

    def _flat(self, seen: Seen, box: int) -> bool:
        middle = _middle(seen, box)
        return middle is None or self._seen_from(seen, middle)[0] < self._touching + _FLAT


def _parts(way: Array) -> list[tuple[float, Array]]:
    """A way ``(n, 3)`` in parts ``(k, 3)`` that are driven ahead (1), back (-1), or turned on the
    spot (0); each begins where the one before ends."""
    found: list[tuple[float, list[Array]]] = []
    for a, b in pairwise(way):
        ahead = float((b - a)[:2] @ [math.cos(a[2]), math.sin(a[2])])
        sign = 0.0 if np.hypot(*(b - a)[:2]) < 1e-9 else math.copysign(1.0, ahead)
        if not found or found[-1][0] != sign:
            found.append((sign, [a]))
        found[-1][1].append(b)
    return [(sign, np.array(poses)) for sign, poses in found]
