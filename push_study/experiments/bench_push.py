"""Area clearing, a public task of Bench-Push, in benchnpin's own rooms (docs/rivals.md).

Ten boxes of 1 m lie in an area. A robot with a bumper 2.4 m wide must push all of them out of it.
An episode ends when no box touches the area, or when 2000 actions of 0.2 s have passed since a box
left it. Share, efficiency and effort are computed by benchnpin.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from push_model.arrays import Array
from push_model.settings import SettingsError
from push_study.bench_push.policies import gtsp, gtsp_again, sweeping
from push_study.bench_push.room import Room, python
from push_study.pool import Row
from push_study.statistics import mean_interval, wilson
from push_study.study import StudyOptions

ROOMS = {"clear": "clear_env", "walled": "walled_env", "columns": "walled_env_with_columns"}
"""Of benchnpin, by the names that they have here."""
POLICIES = {"sweeps": sweeping, "gtsp": gtsp, "gtsp-again": gtsp_again}
SCENARIOS = tuple(f"{room}-{policy}" for room in ROOMS for policy in POLICIES)
OPTIONS: dict[str, str] = {}
MEASURES = ("share", "efficiency", "effort", "path_m", "time_s")
"""All but time_s of benchnpin. share: of the boxes that are out at the end. efficiency: length of a
spanning tree of robot, edges and the boxes that are out (where they were at first), over the
robot's path. effort: (R + S) / (R + W), of sums of mass times way: R of the robot, S of the
shortest ways out of the boxes that are out, W of all boxes. path_m: of the robot. time_s: [s] of
simulation."""
_ACTION = 0.2  # [s]
_THROWN = 1.0  # [m] that a box moves in one action, which no robot can make it do


@dataclass(frozen=True)
class ClearingTask:
    """An episode. scenario: of ``SCENARIOS``."""

    scenario: str
    seed: int
    out: str


def ready() -> None:
    """Raises SettingsError where benchnpin has no environment."""
    python()


def tasks(options: StudyOptions) -> list[ClearingTask]:
    """As many episodes; raises SettingsError for another scenario."""
    for name in options.scenarios:
        if name not in SCENARIOS:
            known = ", ".join(SCENARIOS)
            raise SettingsError(f"no scenario called '{name}'; expected one of: {known}")
    return [
        ClearingTask(name, options.seed + k, str(options.out))
        for k in range(options.trials)
        for name in options.scenarios
    ]


def trial(task: ClearingTask) -> Row:
    """One episode. A policy that has no more to do lets the robot stand until the end."""
    name, kind = task.scenario.split("-", 1)
    spent, steps, thrown = 0.0, 0, 0.0
    with Room(ROOMS[name]) as room:
        seen = room.reset(task.seed)
        count, over = len(seen["boxes"]), False
        began = time.thread_time()
        policy = POLICIES[kind](seen)
        action = next(policy, None)
        spent += time.thread_time() - began
        while not over:
            before = _middles(seen)
            seen = room.step(*(action or (0.0, 0.0)))
            steps, over = steps + 1, seen["over"]
            thrown = max(thrown, float(np.hypot(*(_middles(seen) - before).T).max()))
            began = time.thread_time()
            if action is not None and not over:
                try:
                    action = policy.send(seen)
                except StopIteration:
                    action = None
            spent += time.thread_time() - began
    left = count - seen["cleared"]
    reason = f"{left} of {count} boxes are left" if left else ""
    if thrown > _THROWN:
        reason = f"the physics threw a box by {thrown:.1f} m in one action"
    seen["time_s"] = _ACTION * steps
    return {
        "scenario": task.scenario,
        "seed": task.seed,
        "success": not reason,
        "reason": reason,
        **{measure: float(seen[measure]) for measure in MEASURES},
        "cpu_s": spent,
    }


def _middles(seen: dict[str, Any]) -> Array:
    """``(n, 2)`` [m] of the boxes."""
    return np.array([np.mean(box, axis=0) for box in seen["boxes"]]).reshape(-1, 2)


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Interval of the share of cleared areas, and of the means of benchnpin's measures."""
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


def conclude(options: StudyOptions, tasks: Sequence[ClearingTask], rows: list[Row]) -> None:
    """A line for each scenario."""
    for name in options.scenarios:
        mine, count = _of(rows, name), sum(r["scenario"] == name for r in rows)
        good = sum(bool(r["success"]) for r in mine)
        if not mine:
            continue
        low, high = wilson(good, count)
        print(f"\n{name}: cleared {good} of {count} ({low:.2f} to {high:.2f})")
        for measure in MEASURES:
            values = np.array([float(r[measure]) for r in mine])
            print(f"{measure}: mean {values.mean():.2f}, least {values.min():.2f}")
