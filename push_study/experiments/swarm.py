"""Section 4.3.1: four shapes, swarms of 8 to 20 e-pucks, six targets, by our law."""

from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.swarm.shapes import SHAPES, conclude, tasks_by
from push_study.swarm.targets import SwarmTask, run

__all__ = ["CHOOSES_WORLD", "SCENARIOS", "conclude", "tasks", "trial"]

SCENARIOS = SHAPES
CHOOSES_WORLD = True


def tasks(options: StudyOptions) -> list[SwarmTask]:
    """Every object with every swarm."""
    return tasks_by("crescent", options)


def trial(task: SwarmTask) -> Row:
    """Through all six targets."""
    return run(task)
