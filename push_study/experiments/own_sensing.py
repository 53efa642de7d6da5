"""Robots that have only their own sensing, as range, errors and number of robots change.

Each scenario is one change of the contests ``open-square`` and ``open-triangle`` of the
leaderboard. Trials alternate between both objects.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from push_job.method import Task
from push_model import se2
from push_model.settings import SettingsError
from push_model.specs import EnvironmentSpec
from push_scenario.scatter import around
from push_scenario.scenario import Scenario
from push_study.leaderboard.contests import SIZE, contest, straight
from push_study.pool import Row
from push_study.statistics import wilson
from push_study.study import StudyOptions
from push_study.team_run import made_scenario, run_team
from push_study.uncertainty import uncertainty


@dataclass(frozen=True)
class Condition:
    """robots: how many. sensor: settings that differ from the defaults."""

    robots: int
    sensor: dict[str, float]


CONDITIONS = {
    "default": Condition(20, {}),
    "range-1m": Condition(20, {"range": 1.0}),
    "range-75cm": Condition(20, {"range": 0.75}),
    "range-50cm": Condition(20, {"range": 0.5}),
    "errors-3": Condition(
        20, {"distance_error": 0.03, "least_error": 3e-3, "odometry_error": 0.06}
    ),
    "robots-5": Condition(5, {}),
    "robots-10": Condition(10, {}),
    "robots-40": Condition(40, {}),
}
"""By scenario."""
SCENARIOS = tuple(CONDITIONS)
OPTIONS = {"uncertainty": "mild", "world": "planar"}
CONTESTS = ("open-square", "open-triangle")
_LIMIT = 300.0  # [s]
_SPACE = 0.3  # [m] from the robots to the walls


@dataclass(frozen=True)
class SensingTask:
    """A run. scenario: of ``CONDITIONS``; contest: of ``CONTESTS``."""

    scenario: str
    seed: int
    contest: str
    world: str
    uncertainty: str


def tasks(options: StudyOptions) -> list[SensingTask]:
    """As many of each condition; raises SettingsError for what is no condition."""
    for name in options.scenarios:
        if name not in CONDITIONS:
            known = ", ".join(CONDITIONS)
            raise SettingsError(f"no condition called '{name}'; expected one of: {known}")
    world = options.world or OPTIONS["world"]
    return [
        SensingTask(
            name,
            options.seed + k,
            CONTESTS[(options.seed + k) % len(CONTESTS)],
            world,
            options.uncertainty,
        )
        for k in range(options.trials)
        for name in options.scenarios
    ]


def scenario_of(task: SensingTask) -> tuple[Scenario, Task, float]:
    """The run, its task, and how far [m] the object has to go."""
    condition, problem = CONDITIONS[task.scenario], contest(task.contest).draw(task.seed)
    random = np.random.default_rng([task.seed, condition.robots])
    places = around(random, condition.robots, problem.item, problem.robot.footprint_radius)
    begin = np.array([se2.compose(problem.start, p) for p in places])
    side = max(SIZE, 2.0 * (float(np.abs(begin[:, :2]).max()) + _SPACE))
    settings = {
        "position_tolerance": contest(task.contest).tolerance[0],
        "stalled": _LIMIT,
        "seed": task.seed,
        "sensor": condition.sensor,
    }
    scenario = made_scenario(
        task.scenario,
        EnvironmentSpec((side, side), resolution=0.05),
        problem.robot,
        begin,
        problem.item,
        problem.start,
        {"own-sensing": settings},
    )
    return scenario, Task((problem.goal,)), straight(problem)


def trial(task: SensingTask) -> Row:
    """To the target, or until the time is over."""
    scenario, goal, way = scenario_of(task)
    ((robot, _), *_) = scenario.robots.values()
    doubt = uncertainty(task.uncertainty)
    outcome = run_team("own-sensing", scenario, goal, doubt, task.seed, _LIMIT, world=task.world)
    row: Row = {
        "scenario": task.scenario,
        "seed": task.seed,
        "contest": task.contest,
        "success": outcome.success,
        **outcome.row(),
    }
    if outcome.success:
        row["lambda"] = outcome.charged * robot.max_speed / way
    return row


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Targets reached, and Lambda of those, by condition."""
    found: dict[str, Any] = {}
    for name in CONDITIONS:
        mine = [r for r in rows if r["scenario"] == name]
        ways = [r["lambda"] for r in mine if r["success"]]
        if mine:
            found[name] = {
                "reached": len(ways),
                "of": len(mine),
                "wilson": wilson(len(ways), len(mine)),
                "lambda_mean": float(np.mean(ways)) if ways else math.nan,
                "lambda_median": float(np.median(ways)) if ways else math.nan,
                "lambda_max": max(ways, default=math.nan),
            }
    return found


def conclude(options: StudyOptions, tasks: Sequence[SensingTask], rows: list[Row]) -> None:
    """A line for each condition."""
    print("\ncondition      reached      Lambda: mean, median, largest")
    for name, s in statistics(rows).items():
        print(
            f"{name:12s} {s['reached']:3d} of {s['of']:<3d}   {s['lambda_mean']:6.2f}  "
            f"{s['lambda_median']:6.2f}  {s['lambda_max']:6.2f}"
        )
