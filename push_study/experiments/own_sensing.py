"""Robots that have only their own sensing, as range, errors and number of robots change.

Each scenario is one change of the contests ``open-square`` and ``open-triangle`` of the
leaderboard. Trials alternate between both objects. The name of a map of ``swarm-maps`` is a
scenario as well: robots that have this map bring the seven objects of that study round its walls.
A trial on a map is one of every object.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from push_job.method import Task
from push_model import se2
from push_model.free_space import FreeSpace
from push_model.settings import SettingsError
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from push_scenario.scatter import around
from push_scenario.scenario import Scenario
from push_study.leaderboard.contests import SIZE, contest, straight
from push_study.pool import Row
from push_study.statistics import wilson
from push_study.study import StudyOptions
from push_study.swarm.map_tables import OBJECTS, ROBOTS
from push_study.swarm.maps import MAPS, REACHED, drawn, load_map
from push_study.swarm.targets import ROBOT
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
_LIMIT, _MAP_LIMIT = 300.0, 1200.0  # [s]; on a map as in ``swarm-maps``
_STALLED = 120.0  # [s] on a map
_SPACE = 0.3  # [m] from the robots to the walls


@dataclass(frozen=True)
class SensingTask:
    """A run. scenario: a condition or a map; contest: of ``CONTESTS``; on a map the object."""

    scenario: str
    seed: int
    contest: str
    world: str
    uncertainty: str


def tasks(options: StudyOptions) -> list[SensingTask]:
    """As many of each condition, and with each object of each map; raises SettingsError for what is
    neither a condition nor a map."""
    for name in options.scenarios:
        if name not in CONDITIONS and name not in MAPS:
            known = ", ".join([*CONDITIONS, *MAPS])
            raise SettingsError(f"no condition or map called '{name}'; expected one of: {known}")
    world = options.world or OPTIONS["world"]
    return [
        SensingTask(name, options.seed + k, contest, world, options.uncertainty)
        for k in range(options.trials)
        for name in options.scenarios
        for contest in _contests(name, options.seed + k)
    ]


def _contests(name: str, seed: int) -> tuple[str, ...]:
    return OBJECTS if name in MAPS else (CONTESTS[seed % len(CONTESTS)],)


def scenario_of(task: SensingTask) -> tuple[Scenario, Task, float]:
    """The run, its task, and how far [m] the object has to go: straight, or round the walls."""
    if task.scenario in MAPS:
        return _on_map(task)
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


def _on_map(task: SensingTask) -> tuple[Scenario, Task, float]:
    item, robot, room = (
        load_object(f"transport_{task.contest}"),
        load_robot(ROBOT),
        load_map(task.scenario),
    )
    start, goal, begin = drawn(task.scenario, item, task.seed, ROBOTS, turned=False)
    settings = {"position_tolerance": REACHED, "stalled": _STALLED, "seed": task.seed}
    parameters = {"own-sensing": settings}
    scenario = made_scenario(task.scenario, room, robot, begin, item, start, parameters)
    radius = float(np.hypot(*item.geometry.outline.T).max())
    reach = FreeSpace(scenario.grid).from_here(item.mass_pose(start)[:2], radius)
    way = reach.way_to(goal[:2])
    assert way is not None
    return scenario, Task((goal,)), float(np.hypot(*np.diff(way, axis=0).T).sum())


def trial(task: SensingTask) -> Row:
    """To the target, or until the time is over."""
    scenario, goal, way = scenario_of(task)
    ((robot, _), *_) = scenario.robots.values()
    doubt = uncertainty(task.uncertainty)
    limit = _MAP_LIMIT if task.scenario in MAPS else _LIMIT
    outcome = run_team("own-sensing", scenario, goal, doubt, task.seed, limit, world=task.world)
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
    for name in (*CONDITIONS, *MAPS):
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
    print("\ncondition               reached      Lambda: mean, median, largest")
    for name, s in statistics(rows).items():
        print(
            f"{name:21s} {s['reached']:3d} of {s['of']:<3d}   {s['lambda_mean']:6.2f}  "
            f"{s['lambda_median']:6.2f}  {s['lambda_max']:6.2f}"
        )
