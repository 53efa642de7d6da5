"""Episodes in rooms of benchnpin: what policies do there, and what came of it."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from push_model.settings import SettingsError
from push_study.bench_push.robot import Policy, Seen
from push_study.bench_push.room import Room
from push_study.pool import Row
from push_study.statistics import mean_interval, wilson
from push_study.study import StudyOptions

MEASURES = ("share", "efficiency", "effort", "path_m", "time_s")
"""Of benchnpin, but time_s, and W in box delivery (``worker.Delivery.step``). share: of the boxes
that are where they belong at the end. efficiency: length of a spanning tree of robot, goals and
these boxes (where they were at first), over the robot's path. effort: (R + S) / (R + W), of sums of
mass times way: R of the robot, S of the shortest ways of these boxes, W of all boxes. path_m: of
the robot. time_s: [s] of simulation."""
_THROWN = 1.0  # [m] that a box moves in one action, which no robot can make it do


@dataclass(frozen=True)
class Episode:
    """scenario: room and policy, joined by a hyphen."""

    scenario: str
    seed: int


def episodes(options: StudyOptions, known: Sequence[str]) -> list[Episode]:
    """As many of each scenario; raises SettingsError for one that is not known."""
    for name in options.scenarios:
        if name not in known:
            raise SettingsError(f"no scenario called '{name}'; expected one of: {', '.join(known)}")
    return [
        Episode(name, options.seed + k) for k in range(options.trials) for name in options.scenarios
    ]


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


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Interval of the share of episodes that succeed, and of the means of benchnpin's measures."""
    found: dict[str, Any] = {}
    for name in dict.fromkeys(str(r["scenario"]) for r in rows):
        mine, count = _of(rows, name), sum(r["scenario"] == name for r in rows)
        found[f"wilson_{name}"] = wilson(sum(bool(r["success"]) for r in mine), count)
        for measure in MEASURES:
            values = np.array([float(r[measure]) for r in mine])
            found[f"{measure}_{name}"] = mean_interval(values)
    return found


def _of(rows: list[Row], name: str) -> list[Row]:
    """Episodes of a scenario that did not crash: those that have measures."""
    return [r for r in rows if r["scenario"] == name and not r.get("crashed")]


def report(options: StudyOptions, rows: list[Row], done: str) -> None:
    """A line for each scenario. done: what an episode is that succeeds, in a word."""
    for name in options.scenarios:
        mine, count = _of(rows, name), sum(r["scenario"] == name for r in rows)
        good = sum(bool(r["success"]) for r in mine)
        if not mine:
            continue
        low, high = wilson(good, count)
        print(f"\n{name}: {done} {good} of {count} ({low:.2f} to {high:.2f})")
        for measure in MEASURES:
            values = np.array([float(r[measure]) for r in mine])
            print(f"{measure}: mean {values.mean():.2f}, least {values.min():.2f}")


def scenarios(rooms: Mapping[str, str], policies: Mapping[str, Any]) -> tuple[str, ...]:
    """Their names: each room with each policy."""
    return tuple(f"{room}-{policy}" for room in rooms for policy in policies)
