"""The other side of ``worker.py``: a room of GCo's simulator in a process of its own."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from push_model.arrays import Array
from push_study.gco.problems import Problem
from push_study.gco.worker import STEPS
from push_study.other_python import OtherPython, python_of

PYTHON = "GCO_PYTHON"
"""Environment variable: the Python of the environment in which GCo is installed."""
TICK = STEPS * 0.003
"""[s] of a move."""
_HANGS = 1800.0  # [s] of wall time without an answer; GCo takes about half a minute at most

Told = dict[str, Any]
"""What a room tells: see ``worker.Room.tell``."""


def python() -> Path:
    """Of the environment of GCo; raises SettingsError if there is none."""
    return python_of("GCo", PYTHON, ".venv-gco", "gco")


class Room(OtherPython):
    """A context for one problem: the process ends with it."""

    def __init__(self, problem: Problem) -> None:
        super().__init__(python(), Path(__file__).with_name("worker.py"))
        self._problem = problem

    def reset(self) -> Told:
        """Build the room; where everything is."""
        return self.ask({"reset": asdict(self._problem)})

    def move(self, targets: Array) -> Told:
        """Drag the robots evenly to targets ``(n, 2)`` [m] within a tick."""
        return self.ask({"move": targets.tolist()})

    def solve(self, away: float, turned: float) -> Told:
        """Let GCo bring the object to the goal, within [m] and [rad].

        It also tells the number of its pushes and of rounds of planning (some end without a push),
        why it ended early, if it did, and the CPU time [s] of its computations without the
        simulation and without loading its model.
        """
        return self.ask({"solve": [away, turned]}, _HANGS)
