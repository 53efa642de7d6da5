"""Section 4.3.1: four shapes, swarms of 8 to 20 e-pucks, six targets, by our law."""

from typing import Any

from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.summary import by_cell
from push_study.swarm.shapes import SHAPES, conclude, tasks_by
from push_study.swarm.targets import SwarmTask, run

__all__ = ["OPTIONS", "SCENARIOS", "conclude", "statistics", "tasks", "trial"]

SCENARIOS = SHAPES
OPTIONS = {"uncertainty": "mild", "world": "pybullet"}


def tasks(options: StudyOptions) -> list[SwarmTask]:
    """Every object with every swarm."""
    return tasks_by("crescent", options)


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Mean Lambda and time by object and number of robots."""
    return dict(by_cell(rows, ("scenario", "robots"), ("lambda", "charged_s")))


def trial(task: SwarmTask) -> Row:
    """Through all six targets."""
    return run(task)
