"""Episodes in rooms of benchnpin: what policies do there, and what came of it."""

import time
from collections.abc import Callable

import numpy as np

from push_study.bench_push.robot import Policy, Seen
from push_study.bench_push.room import Room
from push_study.by_scenario import Episode
from push_study.pool import Row

MEASURES = ("share", "efficiency", "effort", "path_m", "time_s")
"""Of benchnpin, but time_s, and W in box delivery (``worker.Delivery.step``). share: of the boxes
that are where they belong at the end. efficiency: length of a spanning tree of robot, goals and
these boxes (where they were at first), over the robot's path. effort: (R + S) / (R + W), of sums of
mass times way: R of the robot, S of the shortest ways of these boxes, W of all boxes. path_m: of
the robot. time_s: [s] of simulation."""
_THROWN = 1.0  # [m] that a box moves in one action, which no robot can make it do


def run(episode: Episode, room: Room, policy_in: Callable[[Seen], Policy]) -> Row:
    """One episode. A policy that has no more to do lets the robot stand until the end.

    policy_in: makes the policy of what the room tells after a reset.
    """
    spent, thrown = 0.0, 0.0
    with room:
        seen = room.reset(episode.seed)
        count, over = len(seen["boxes"]), False
        began = time.thread_time()
        policy = policy_in(seen)
        action = next(policy, None)
        spent += time.thread_time() - began
        while not over:
            before = seen
            seen = room.step(*(action or (0.0, 0.0)))
            over = seen["over"]
            thrown = max(thrown, _moved(before, seen))
            began = time.thread_time()
            if action is not None and not over:
                try:
                    action = policy.send(seen)
                except StopIteration:
                    action = None
            spent += time.thread_time() - began
    left = count - seen["done"]
    reason = f"{left} of {count} boxes are left" if left else ""
    if thrown > _THROWN:
        reason = f"the physics threw a box by {thrown:.1f} m in one action"
    return {
        "scenario": episode.scenario,
        "seed": episode.seed,
        "success": not reason,
        "reason": reason,
        **{measure: float(seen[measure]) for measure in MEASURES},
        "cpu_s": spent,
    }


def _moved(before: Seen, after: Seen) -> float:
    """[m] that a box has moved at most, of those that are still there."""
    pairs = zip(before["boxes"], after["boxes"], strict=True)
    moves = [np.mean(b, axis=0) - np.mean(a, axis=0) for a, b in pairs if b is not None]
    return max((float(np.hypot(*move)) for move in moves), default=0.0)
