"""A script in a process with the Python of another environment: a line of JSON in, a line out."""

import contextlib
import json
import os
import select
import subprocess
import tempfile
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from push_model.settings import SettingsError

_END = 10.0  # [s] of wall time that a script may take to end


def python_of(what: str, variable: str, environment: str, target: str) -> Path:
    """The Python of an environment of its own.

    what: is installed there. variable: of the environment, that names the Python. environment: the
    folder in the clone where it is otherwise. target: of ``make``, that installs it.

    Raises
    ------
    SettingsError: there is none.
    """
    path = Path(os.environ.get(variable, f"{environment}/bin/python")).absolute()
    if not path.is_file():
        raise SettingsError(
            f"{what} needs an environment of its own, and {path} does not exist; run 'make "
            f"{target}' in the clone and start the study there, or set {variable}"
        )
    return path


class OtherPython:
    """A context: the process ends with it."""

    def __init__(self, python: Path, script: Path) -> None:
        self._log = tempfile.TemporaryFile(mode="w+")  # noqa: SIM115, closed in __exit__
        self._process = subprocess.Popen(
            [str(python), "-I", str(script)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            text=True,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.communicate(timeout=_END)  # it ends with its input
        self._process.kill()
        self._process.wait()
        self._log.close()

    def ask(self, message: dict[str, Any], limit: float | None = None) -> dict[str, Any]:
        """Its answer. limit: [s] of wall time to wait for it.

        Raises
        ------
        RuntimeError: the script has ended, with the last line that it said; or there is no answer.
        """
        assert self._process.stdin is not None and self._process.stdout is not None
        try:
            self._process.stdin.write(json.dumps(message) + "\n")
            self._process.stdin.flush()
            if not select.select([self._process.stdout], [], [], limit)[0]:
                raise RuntimeError(f"no answer within {limit:.0f} s")
            answer = self._process.stdout.readline()
        except BrokenPipeError:
            answer = ""
        if not answer:
            self._log.seek(0)
            said = self._log.read().strip().splitlines()
            raise RuntimeError(f"the room has ended: {said[-1] if said else 'without a word'}")
        told: dict[str, Any] = json.loads(answer)
        return told
