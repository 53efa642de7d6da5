"""The other side of ``worker.py``: a room of benchnpin in a process of its own."""

import json
import os
import subprocess
import tempfile
from pathlib import Path
from types import TracebackType
from typing import Any

from push_model.settings import SettingsError

PYTHON = "BENCHPUSH_PYTHON"
"""Environment variable: the Python of the environment in which benchnpin is installed."""
_DEFAULT = Path(".venv-benchpush/bin/python")


def python() -> Path:
    """Of the environment of benchnpin.

    Raises
    ------
    SettingsError: there is none.
    """
    path = Path(os.environ.get(PYTHON, _DEFAULT)).absolute()
    if not path.is_file():
        raise SettingsError(
            f"Bench-Push needs an environment of its own, and {path} does not exist; run 'make "
            f"benchpush' in the clone and start the study there, or set {PYTHON}"
        )
    return path


class Room:
    """A context: the process ends with it."""

    def __init__(self, task: str, name: str) -> None:
        """task: of ``worker.TASKS``. name: of a room of benchnpin, e.g. ``clear_env``."""
        self._task, self._name = task, name
        self._log = tempfile.TemporaryFile(mode="w+")  # noqa: SIM115, closed in __exit__
        self._process = subprocess.Popen(
            [str(python()), "-I", str(Path(__file__).with_name("worker.py"))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            text=True,
        )

    def __enter__(self) -> "Room":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._process.communicate()  # it ends with its input
        self._log.close()

    def reset(self, seed: int) -> dict[str, Any]:
        """Begin an episode; what ``worker.py`` tells of it."""
        return self._ask({"reset": seed, "task": self._task, "room": self._name})

    def step(self, speed: float, turn: float) -> dict[str, Any]:
        """One action of 0.2 s. speed, turn: of the room's greatest speed and turn rate."""
        return self._ask({"step": [speed, turn]})

    def _ask(self, message: dict[str, Any]) -> dict[str, Any]:
        assert self._process.stdin is not None and self._process.stdout is not None
        try:
            self._process.stdin.write(json.dumps(message) + "\n")
            self._process.stdin.flush()
            answer = self._process.stdout.readline()
        except BrokenPipeError:
            answer = ""
        if not answer:
            self._log.seek(0)
            said = self._log.read().strip().splitlines()
            raise RuntimeError(f"the room has ended: {said[-1] if said else 'without a word'}")
        told: dict[str, Any] = json.loads(answer)
        return told
