"""GCo (Shaoul et al., AAMAS 2026), run by itself, beside our group in the same rooms of MuJoCo.

Two or three discs push one object, a rectangle or a circle, to a pose. GCo is the program of its
authors with the model that they trained (yoraish/gco); nothing of it is rebuilt (docs/rivals.md).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from push_study import by_scenario
from push_study.by_scenario import Episode, episodes, finished, scenarios
from push_study.gco.problems import ROOMS, problem
from push_study.gco.room import Room
from push_study.gco.room import python as ready
from push_study.gco.team import push
from push_study.pool import Row
from push_study.statistics import mean_interval
from push_study.study import StudyOptions

__all__ = ["MEASURES", "OPTIONS", "SCENARIOS", "conclude", "ready", "statistics", "tasks", "trial"]

ROBOTS = ("2", "3")
METHODS = ("group", "gco")
TOLERANCES = {"wide": (0.15, 0.5), "narrow": (0.02, 0.1)}
"""[m], [rad] of the object from its goal. ``wide``: of the evaluation script of GCo. ``narrow``:
that of the contests ``plates-…`` of the leaderboard."""
SCENARIOS = scenarios(ROOMS, ROBOTS, METHODS, TOLERANCES)
OPTIONS: dict[str, str] = {}
MEASURES = ("error_m", "error_rad", "touched", "pushes", "time_s", "path_m", "cpu_s")
"""error: of the object at the end. touched: whether a robot or the object touched an obstacle.
time_s: [s] of simulation. path_m: [m] of all robots."""
_OF_SUCCESSES = ("pushes", "time_s", "path_m", "cpu_s")


def tasks(options: StudyOptions) -> list[Episode]:
    """As many episodes; raises SettingsError for another scenario."""
    return episodes(options, SCENARIOS)


def trial(task: Episode) -> Row:
    """One episode. The goal counts as reached if the object is there at the end; with our method
    also only if the method says so. Touching an obstacle does not make it fail."""
    room_name, robots, method, tolerance = task.scenario.split("-")
    what, (away, turned) = problem(room_name, int(robots), task.seed), TOLERANCES[tolerance]
    with Room(what) as room:
        if method == "gco":
            room.reset()
            told = room.solve(away, turned)
            pushes, reason, cpu = told["pushes"], told["why"], told["cpu_s"]
        else:
            outcome = push(room, what, away, turned)
            told, pushes, reason, cpu = outcome.told, outcome.pushes, outcome.reason, outcome.cpu
    off = what.errors(np.array(told["object"]))
    if not reason and not (off[0] <= away and off[1] <= turned):
        reason = f"the object is {1e3 * off[0]:.0f} mm and {off[1]:.2f} rad from the goal"
    return {
        "scenario": task.scenario,
        "seed": task.seed,
        "success": not reason,
        "reason": reason,
        "error_m": off[0],
        "error_rad": off[1],
        "touched": int(told["touched"]),
        "pushes": pushes,
        "rounds": told.get("rounds", pushes),
        "time_s": told["time_s"],
        "path_m": told["path_m"],
        "cpu_s": cpu,
    }


def statistics(rows: list[Row]) -> dict[str, Any]:
    """See ``by_scenario``; time, path, pushes and CPU time are of the goals that are reached. For
    the problems that both methods solve, also our time and path less GCo's: 95 % intervals of
    their means."""
    found = by_scenario.statistics(rows, MEASURES, _OF_SUCCESSES)
    for name in dict.fromkeys(str(r["scenario"]) for r in rows):
        if "-group-" not in name:
            continue
        ours, theirs = (
            {int(r["seed"]): r for r in finished(rows, scenario) if r["success"]}
            for scenario in (name, name.replace("-group-", "-gco-"))
        )
        both = sorted(ours.keys() & theirs.keys())
        for measure in ("time_s", "path_m"):
            less = [float(ours[k][measure]) - float(theirs[k][measure]) for k in both]
            found[f"{measure}_less_than_gco_{name}"] = mean_interval(np.array(less))
    return found


def conclude(options: StudyOptions, tasks: Sequence[Any], rows: list[Row]) -> None:
    """A line for each scenario and measure."""
    by_scenario.report(options, rows, "reached", MEASURES, _OF_SUCCESSES)
