"""The other side of ``worker.py``: a room of benchnpin in a process of its own."""

from pathlib import Path
from typing import Any

from push_study.other_python import OtherPython, python_of

PYTHON = "BENCHPUSH_PYTHON"
"""Environment variable: the Python of the environment in which benchnpin is installed."""


def python() -> Path:
    """Of the environment of benchnpin; raises SettingsError if there is none."""
    return python_of("Bench-Push", PYTHON, ".venv-benchpush", "benchpush")


class Room(OtherPython):
    """A context: the process ends with it."""

    def __init__(self, task: str, name: str) -> None:
        """task: of ``worker.TASKS``. name: of a room of benchnpin, e.g. ``clear_env``."""
        super().__init__(python(), Path(__file__).with_name("worker.py"))
        self._task, self._name = task, name

    def reset(self, seed: int) -> dict[str, Any]:
        """Begin an episode; what ``worker.py`` tells of it."""
        return self.ask({"reset": seed, "task": self._task, "room": self._name})

    def step(self, speed: float, turn: float) -> dict[str, Any]:
        """One action of 0.2 s. speed, turn: of the room's greatest speed and turn rate."""
        return self.ask({"step": [speed, turn]})
