"""Swarms round walls: the four maps and seven objects of Queiroz and MacRae 2024."""

from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.swarm.map_tables import conclude, statistics, tasks_of
from push_study.swarm.maps import MAPS, MapTask, run

__all__ = ["OPTIONS", "SCENARIOS", "conclude", "statistics", "tasks", "trial"]

SCENARIOS = tuple(MAPS)
OPTIONS = {"uncertainty": "mild", "world": "planar"}


def tasks(options: StudyOptions) -> list[MapTask]:
    """Every map with every object, to poses and to positions."""
    return tasks_of(options, (True, False))


def trial(task: MapTask) -> Row:
    """To the goal of its map."""
    return run(task)
