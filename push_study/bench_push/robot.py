"""A robot of benchnpin as policies drive it: what it is told, and whether it moves."""

from collections import deque
from collections.abc import Generator
from typing import Any

import numpy as np

from push_model import se2

EASE = 0.2
"""[s] in which errors are to vanish: an action."""
_TURNED = 0.012  # [rad] from a heading at which it is reached
_PATIENCE = 15  # actions in which a robot that is not blocked moves by over 1 cm or 0.02 rad
_BACK = 8  # actions for which one that is blocked drives back

Action = tuple[float, float]
"""Speed and turn rate, of the greatest ones."""
Seen = dict[str, Any]
"""What a room tells after an action."""
Policy = Generator[Action, Seen, None]
"""Yields actions, and is sent what the room tells after each. Ends when it has no more to do."""
Steps = Generator[Action, Seen, Seen]
"""Part of a policy; returns what was told last."""


class Blocked(Exception):
    """The robot is told to move and does not. seen: what the room told last."""

    def __init__(self, seen: Seen) -> None:
        super().__init__("the robot is blocked")
        self.seen = seen


class Robot:
    """Turns on the spot and backs off; raises Blocked. Within the action space, which is [-1, 1]
    for both actions."""

    def __init__(self, seen: Seen, speed: float, turn: float) -> None:
        """speed: [m/s]; turn: [rad/s], the greatest ones."""
        self.speed, self._turn = speed, turn
        self._told, self._poses = (0.0, 0.0), deque([np.array(seen["pose"])], _PATIENCE)

    def back_off(self, seen: Seen) -> Steps:
        """Undo the last command for a while."""
        ahead, turn = self._told
        for _ in range(_BACK):
            seen = yield -ahead, -turn
        self._poses.clear()
        return seen

    def face(self, seen: Seen, heading: float) -> Steps:
        """Turn on the spot to a heading [rad]."""
        while abs(error := se2.wrap(heading - seen["pose"][2])) > _TURNED:
            seen = yield from self.act(0.0, 0.9 * error / EASE)
        return seen

    def act(self, speed: float, turn: float) -> Steps:
        """One action, of [m/s] and [rad/s]."""
        ahead, round_ = speed / self.speed, turn / self._turn
        self._told = min(max(ahead, -1.0), 1.0), min(max(round_, -1.0), 1.0)
        seen = yield self._told
        self._poses.append(np.array(seen["pose"]))
        if len(self._poses) == _PATIENCE:
            moved = np.ptp(self._poses, axis=0)
            if moved[:2].max() < 0.015 and moved[2] < 0.025:  # one step of rounding is no motion
                raise Blocked(seen)
        return seen
