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
from push_model.point_push import Disc, driven
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

SCALE = 1e-3
"""[m] of a pixel, which is gym-pusht's unit: nothing of the task depends on it."""
T = SCALE * np.array(
    [(-60, 0), (60, 0), (60, 30), (15, 30), (15, 120), (-15, 120), (-15, 30), (-60, 30)]
)
"""``(8, 2)`` [m] outline of gym-pusht's T in its frame."""
CENTRE = SCALE * np.array([0.0, 45.0])
"""``(2,)`` [m] of mass."""
MASS, INERTIA = 1.0, 3000.0
"""As gym-pusht gives them to its engine: per pixel squared."""
GYRATION = SCALE * math.sqrt(INERTIA / MASS)  # [m]
_GOAL = np.array([SCALE * 256.0, SCALE * 256.0, 0.25 * math.pi])
_ROOM = (SCALE * 1.0, SCALE * 511.0)
_PERIOD = 10  # steps of the physics in an action
_RECOVERY = 1.0 - (0.9**60) ** 0.01  # pymunk's default bias for a step of 0.01 s
DISC = Disc(SCALE * 15.0, 100.0, 20.0, 0.01, _RECOVERY, SCALE * 0.1)


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
    return PointPusher(PointTask(T - CENTRE, GYRATION, to_mass(_GOAL), _ROOM, _PERIOD), DISC)


def trial(task: PushTTask) -> Row:
    """One episode. The disc's velocity, which is not observed, follows from the actions."""
    env, chooser = _environment(), planner()
    seen, _ = env.reset(seed=task.seed)
    velocity, best, spent, steps = np.zeros(2), 0.0, 0.0, 0
    while best <= COVERAGE[task.scenario] and steps < STEPS:
        steps += 1
        disc = np.concatenate([SCALE * seen[:2], velocity])
        began = time.thread_time()
        item = to_mass(seen[2:5] * [SCALE, SCALE, 1.0])
        target = np.clip(chooser.target(item, disc), 0.0, SCALE * 512.0)
        spent += time.thread_time() - began
        velocity = driven(DISC, disc, target, _PERIOD)[2:]
        action = target / SCALE
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
