"""Box delivery, a public task of Bench-Push, in benchnpin's own rooms (docs/rivals.md).

Ten boxes of 0.44 m (twenty in the large rooms) lie in a room of 10 m by 5 m (or 10 m). A robot with
a flat front 0.7 m wide must push all of them into a receptacle in a corner, where they vanish. An
episode ends when none is left, or when 2000 actions of 0.2 s have passed since the last one was
delivered. Share and efficiency are computed by benchnpin.
"""

from collections.abc import Sequence
from typing import Any

from push_study import by_scenario
from push_study.bench_push.delivery import delivering, straight
from push_study.bench_push.episode import MEASURES, run
from push_study.bench_push.room import Room
from push_study.bench_push.room import python as ready
from push_study.by_scenario import Episode, episodes, scenarios
from push_study.pool import Row
from push_study.study import StudyOptions

__all__ = ["MEASURES", "OPTIONS", "SCENARIOS", "conclude", "ready", "statistics", "tasks", "trial"]

ROOMS = {
    "small": "small_empty",
    "columns": "small_columns",
    "large": "large_columns",
    "divider": "large_divider",
}
"""Of benchnpin, by the names that they have here."""
POLICIES = {"pushes": delivering, "straight": straight}
SCENARIOS = scenarios(ROOMS, POLICIES)
OPTIONS: dict[str, str] = {}


def tasks(options: StudyOptions) -> list[Episode]:
    """As many episodes; raises SettingsError for another scenario."""
    return episodes(options, SCENARIOS)


def trial(task: Episode) -> Row:
    """One episode."""
    name, policy = task.scenario.split("-")
    return run(task, Room("delivery", ROOMS[name]), POLICIES[policy])


def conclude(options: StudyOptions, tasks: Sequence[Any], rows: list[Row]) -> None:
    """A line for each scenario."""
    by_scenario.report(options, rows, "delivered all in", MEASURES)


def statistics(rows: list[Row]) -> dict[str, Any]:
    """See ``by_scenario``."""
    return by_scenario.statistics(rows, MEASURES)
