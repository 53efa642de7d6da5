"""The maps of swarm-maps, by robots that decide for themselves; messages are lost at random."""

from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.swarm.map_tables import conclude, statistics, tasks_of
from push_study.swarm.maps import MAPS, MapTask, run

__all__ = ["OPTIONS", "SCENARIOS", "conclude", "statistics", "tasks", "trial"]

SCENARIOS = tuple(MAPS)
OPTIONS = {"uncertainty": "mild", "world": "planar"}
LOST = 0.1
"""Part of the messages that get lost."""


def tasks(options: StudyOptions) -> list[MapTask]:
    """Every map with every object, to poses."""
    return tasks_of(options, (True,), LOST)


def trial(task: MapTask) -> Row:
    """To the goal of its map."""
    return run(task)
