"""Area clearing, a public task of Bench-Push, in benchnpin's own rooms (docs/rivals.md).

Ten boxes of 1 m lie in an area. A robot with a bumper 2.4 m wide must push all of them out of it.
An episode ends when no box touches the area, or when 2000 actions of 0.2 s have passed since a box
left it. Share, efficiency and effort are computed by benchnpin.
"""

from collections.abc import Sequence
from typing import Any

from push_study import by_scenario
from push_study.bench_push.episode import MEASURES, run
from push_study.bench_push.policies import gtsp, gtsp_again, sweeping
from push_study.bench_push.room import Room
from push_study.bench_push.room import python as ready
from push_study.by_scenario import Episode, episodes, scenarios
from push_study.pool import Row
from push_study.study import StudyOptions

__all__ = ["MEASURES", "OPTIONS", "SCENARIOS", "conclude", "ready", "statistics", "tasks", "trial"]

ROOMS = {"clear": "clear_env", "walled": "walled_env", "columns": "walled_env_with_columns"}
"""Of benchnpin, by the names that they have here."""
POLICIES = {"sweeps": sweeping, "gtsp": gtsp, "gtsp-again": gtsp_again}
SCENARIOS = scenarios(ROOMS, POLICIES)
OPTIONS: dict[str, str] = {}


def tasks(options: StudyOptions) -> list[Episode]:
    """As many episodes; raises SettingsError for another scenario."""
    return episodes(options, SCENARIOS)


def trial(task: Episode) -> Row:
    """One episode."""
    name, policy = task.scenario.split("-", 1)
    return run(task, Room("clearing", ROOMS[name]), POLICIES[policy])


def conclude(options: StudyOptions, tasks: Sequence[Any], rows: list[Row]) -> None:
    """A line for each scenario."""
    by_scenario.report(options, rows, "cleared", MEASURES)


def statistics(rows: list[Row]) -> dict[str, Any]:
    """See ``by_scenario``."""
    return by_scenario.statistics(rows, MEASURES)
