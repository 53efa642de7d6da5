"""Planning for several boxes: the program of ReloPush, and our search, for the same instances.

The instances are those that the authors published, 100 for each number of boxes; the trial with
seed k is the instance k. ReloPush plans for its car and its 15 cm boxes. Ours plans for an e-puck
and 9 cm boxes, with all lengths scaled by 0.6, as in the study ``rearrange``. Nothing is executed.

With one box (``1-…``), the program of ReloPush is compared with our reconstruction
(``dubins_plans``): ``1-dubins`` with the rules of the authors, ``1-contest`` without those that the
method ``dubins-push`` leaves out in the contests of the leaderboard.
"""

import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from push_model.distance_field import DistanceField
from push_model.settings import SettingsError
from push_planner.push_plan import PlanningFailed
from push_planner.rearrangement import Move, Rearrangement, RearrangementSettings
from push_planner.settings import PlannerSettings
from push_scenario.scenario import Scenario
from push_study import by_scenario
from push_study.by_scenario import Episode, episodes, finished, scenarios
from push_study.pool import Row
from push_study.relopush.authors import (
    ALONE,
    COUNT,
    FILES,
    MODES,
    instance,
    parsed,
    plan,
    plan_alone,
)
from push_study.relopush.authors import program as ready
from push_study.relopush.scenes import SCALE, scaled, scenario_of
from push_study.statistics import mean_interval
from push_study.study import StudyOptions

__all__ = ["MEASURES", "OPTIONS", "SCENARIOS", "conclude", "ready", "statistics", "tasks", "trial"]

METHODS = ("relopush", "rearrange")
_ALONE = scenarios((ALONE,), ("relopush", "dubins", "contest"))
SCENARIOS = (*scenarios(FILES, METHODS), *_ALONE)
BASELINES = scenarios(FILES, ("dubinsonly", "mponly"))
"""Scenarios that can also be named: those of the authors, see ``MODES``; without ``way_m``."""
OPTIONS: dict[str, str] = {}
MEASURES = ("cpu_s", "pushes", "aside", "way_m")
"""cpu_s: [s] of the search. pushes: times that the robot drives to a box. aside: times that a box
is moved out of the way of another one. way_m: [m] of all boxes, in lengths of the authors."""
_OF_SUCCESSES = ("pushes", "aside", "way_m")


def tasks(options: StudyOptions) -> list[Episode]:
    """A task for each trial. Raises SettingsError for an unknown scenario or instance."""
    made = episodes(options, (*SCENARIOS, *BASELINES))
    for task in made:
        if task.scenario not in _ALONE and not 0 <= task.seed < COUNT:
            raise SettingsError(
                f"--seed, --trials: there are {COUNT} instances of {task.scenario}, from 0 to "
                f"{COUNT - 1}; trial {task.seed} is none of them"
            )
    return made


def trial(task: Episode) -> Row:
    """Plan for one instance."""
    boxes, method = task.scenario.split("-")
    line = instance(boxes, task.seed)
    if method in MODES:
        row = _authors(line, method)
    else:
        row = _ours(line) if method == "rearrange" else _rebuilt(line, method == "dubins")
    return {"scenario": task.scenario, "seed": task.seed, **row}


def _authors(line: str, method: str) -> Row:
    told = plan(line, MODES[method])
    kinds = [part.kind for part in told.parts]
    way = {"way_m": sum(part.way for part in told.parts)} if method == "relopush" else {}
    return {
        "success": bool(told.parts),
        "reason": "" if told.parts else f"{method} finds no plan",
        "cpu_s": told.cpu,
        "pushes": kinds.count("app"),
        "aside": kinds.count("temp"),
        **way,
    }


def _rebuilt(line: str, strict: bool) -> Row:
    began = time.thread_time()
    plans = plan_alone(line, strict)
    return {
        "success": bool(plans),
        "reason": "" if plans else "no Dubins path is clear, also after a straight push",
        "cpu_s": time.thread_time() - began,
        "pushes": 1 + plans[0].relocates if plans else 0,
        "aside": 0,
        "way_m": plans[0].length if plans else 0.0,
    }


def _ours(line: str) -> Row:
    scenario = scaled(parsed(line), "instance")
    field = DistanceField(scenario.grid)
    _ready()
    moves: list[Move] = []
    began, reason = time.thread_time(), ""
    try:
        moves = _searched(scenario, field)
    except PlanningFailed as failure:
        reason = str(failure)
    return {
        "success": not reason,
        "reason": reason,
        "cpu_s": time.thread_time() - began,
        "pushes": sum(len(move.plan.segments) for move in moves),
        "aside": sum(move.aside for move in moves),
        "way_m": sum(_way(move) for move in moves) / SCALE,
    }


def _way(move: Move) -> float:
    """[m] of the box."""
    steps = [np.diff(segment.object_poses[:, :2], axis=0) for segment in move.plan.segments]
    return float(np.hypot(*np.vstack(steps).T).sum())


@cache
def _ready() -> None:
    """Load the kernels of the planner, once in a process, as its node does when it starts."""
    scenario = scenario_of("relopush-2", 1)
    _searched(scenario, DistanceField(scenario.grid))


def _searched(scenario: Scenario, field: DistanceField) -> list[Move]:
    """The moves, searched for as the node ``rearranger`` does."""
    search = Rearrangement(
        RearrangementSettings(),
        PlannerSettings(),
        field,
        scenario.robot()[1],
        {name: item for name, (item, _) in scenario.objects.items()},
    )
    poses = {name: start for name, (_, start) in scenario.objects.items()}
    return search.solve(poses, scenario.arrangement, scenario.robots[scenario.robot()[0]][1])


def statistics(rows: list[Row]) -> dict[str, Any]:
    """See ``by_scenario``; pushes, boxes moved aside and ways are of the plans that are found. For
    the instances that both plan, also our way less that of ReloPush: 95 % interval of the mean, and
    the number of instances in which they are equal to a millimetre."""
    found: dict[str, Any] = {}
    for measures, names in _with_measures(str(r["scenario"]) for r in rows):
        mine = [r for r in rows if r["scenario"] in names]
        found |= by_scenario.statistics(mine, measures, _OF_SUCCESSES)
    for name in (*scenarios(FILES, ("rearrange",)), *_ALONE[1:]):
        theirs, ours = (
            {int(r["seed"]): float(r["way_m"]) for r in finished(rows, of) if r["success"]}
            for of in (f"{name.split('-')[0]}-relopush", name)
        )
        less = np.array([ours[k] - theirs[k] for k in sorted(ours.keys() & theirs.keys())])
        if len(less):
            found[f"way_less_than_relopush_{name}"] = mean_interval(less)
            found[f"way_equal_to_relopush_{name}"] = int((np.abs(less) <= 1e-3).sum())
    return found


def _with_measures(names: Iterable[str]) -> list[tuple[tuple[str, ...], list[str]]]:
    """Scenarios that have all measures, and those that have no way."""
    names = list(dict.fromkeys(names))
    alike = [n for n in names if n not in BASELINES], [n for n in names if n in BASELINES]
    return list(zip((MEASURES, MEASURES[:-1]), alike, strict=True))


def conclude(options: StudyOptions, tasks: Sequence[Any], rows: list[Row]) -> None:
    """A line for each scenario and measure."""
    for measures, names in _with_measures(options.scenarios):
        mine = replace(options, scenarios=tuple(names))
        by_scenario.report(mine, rows, "planned", measures, _OF_SUCCESSES)
