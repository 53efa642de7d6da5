"""PushT, a public task: a disc pushes a T to its place, in gym-pusht's own simulation.

The task, its physics and its measure of success are gym-pusht's (the T covers more than 0.95 of its
place within 300 steps of 0.1 s); nothing of it is changed. The planner sees the state of the
environment, which is the place of the disc and the pose of the T, and makes every action.

The scenario ``pusht-iou`` asks for more: an intersection over union of 0.95, which is a coverage of
0.974. The environment is then stepped on after it calls itself solved.
"""

import math
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.point_push import Disc, body, push
from push_model.settings import SettingsError
from push_planner.point_pusher import PointPusher, PointTask
from push_study.pool import Row
from push_study.statistics import wilson
from push_study.study import StudyOptions

SCENARIOS = ("pusht",)
COVERAGE = {"pusht": 0.95, "pusht-iou": 2.0 * 0.95 / 1.95}
"""Of its place by the T that counts, by scenario."""
OPTIONS: dict[str, str] = {}
PUBLISHED = 0.64
"""Share of successes that is quoted of a diffusion policy, over 500 seeds."""
STEPS = 300
"""Actions of an episode at most, as of gym-pusht's registration."""

T = np.array(
    [(-60, 0), (60, 0), (60, 30), (15, 30), (15, 120), (-15, 120), (-15, 30), (-60, 30)],
    dtype=np.float64,
)
"""Outline of gym-pusht's T in its frame, in its units (pixels)."""
CENTRE = np.array([0.0, 45.0])
"""Of mass."""
_MASS, _INERTIA = 1.0, 3000.0
_GOAL = np.array([256.0, 256.0, 0.25 * math.pi])
_ROOM = (1.0, 511.0)
_PERIOD = 10  # steps of the physics in an action
_RECOVERY = 1.0 - (0.9**60) ** 0.01  # pymunk's default bias for a step of 0.01 s
DISC = Disc(15.0, 100.0, 20.0, 0.01, _RECOVERY, 0.1)
_NOWHERE = np.array([[-1e5, -1e5, 0.0, 0.0, 0.0, 0.0]])


@dataclass(frozen=True)
class PushTTask:
    """An episode. scenario: of ``COVERAGE``."""

    scenario: str
    seed: int
    out: str


def ready() -> None:
    """Raises SettingsError where gym-pusht is not installed."""
    _environment()


def tasks(options: StudyOptions) -> list[PushTTask]:
    """As many episodes; raises SettingsError for another scenario."""
    for name in options.scenarios:
        if name not in COVERAGE:
            known = ", ".join(COVERAGE)
            raise SettingsError(f"no scenario called '{name}'; expected one of: {known}")
    return [
        PushTTask(name, options.seed + k, str(options.out))
        for name in options.scenarios
        for k in range(options.trials)
    ]


def _environment() -> Any:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import gym_pusht  # noqa: F401
            import gymnasium
    except ImportError as error:
        raise SettingsError(
            f"gym-pusht is needed ({error}); install the extra 'rivals': "
            'pip install -c constraints.txt -e ".[rivals]"'
        ) from None
    return gymnasium.make("gym_pusht/PushT-v0", obs_type="state").unwrapped


def to_mass(pose: Array) -> Array:
    """Pose ``(3,)`` of the centre of mass of a T whose frame is at a pose."""
    return np.array([*se2.transform(pose, CENTRE[None])[0], pose[2]])


def planner() -> PointPusher:
    """For PushT."""
    task = PointTask(T - CENTRE, math.sqrt(_INERTIA / _MASS), to_mass(_GOAL), _ROOM, _PERIOD)
    return PointPusher(task, DISC)


def moved(disc: Array, target: Array) -> Array:
    """Place and velocity ``(4,)`` of the disc after an action; nothing stops it."""
    item = body(T - CENTRE, math.sqrt(_INERTIA / _MASS))
    after = push(item, DISC, _NOWHERE, disc[None], target[None], _PERIOD)
    found: Array = after.discs[0]
    return found


def trial(task: PushTTask) -> Row:
    """One episode. The disc's velocity, which is not observed, follows from the actions."""
    env, chooser = _environment(), planner()
    seen, _ = env.reset(seed=task.seed)
    velocity, best, spent, steps = np.zeros(2), 0.0, 0.0, 0
    while best <= COVERAGE[task.scenario] and steps < STEPS:
        steps += 1
        disc = np.concatenate([seen[:2], velocity])
        began = time.thread_time()
        action = np.clip(chooser.target(to_mass(seen[2:5]), disc), 0.0, 512.0)
        spent += time.thread_time() - began
        velocity = moved(disc, action)[2:]
        seen, _, _, _, info = env.step(action)
        best = max(best, float(info["coverage"]))
    solved = best > COVERAGE[task.scenario]
    return {
        "scenario": task.scenario,
        "seed": task.seed,
        "success": solved,
        "reason": "" if solved else f"coverage of at most {best:.3f} in {STEPS} steps",
        "steps": steps,
        "best_coverage": best,
        "cpu_s": spent,
    }


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Share of successes with its interval."""
    found: dict[str, Any] = {"published": PUBLISHED}
    for name in COVERAGE:
        mine = [bool(r["success"]) for r in rows if r["scenario"] == name]
        if mine:
            found[f"wilson_{name}"] = wilson(sum(mine), len(mine))
    return found


def conclude(options: StudyOptions, tasks: Sequence[PushTTask], rows: list[Row]) -> None:
    """Success and steps beside the published figure."""
    for name in options.scenarios:
        mine = [r for r in rows if r["scenario"] == name]
        good = [r for r in mine if r["success"]]
        low, high = wilson(len(good), len(mine))
        print(f"\n{name}: solved {len(good)} of {len(mine)} ({low:.3f} to {high:.3f})")
        if good:
            steps, cpu = (np.array([r[k] for r in good]) for k in ("steps", "cpu_s"))
            print(f"steps: median {np.median(steps):.0f}, largest {steps.max()}, of {STEPS}")
            print(f"CPU time: median {np.median(cpu):.2f} s, largest {cpu.max():.2f} s")
    print(f"\na diffusion policy is quoted with {PUBLISHED} of pusht")
