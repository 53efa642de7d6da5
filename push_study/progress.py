"""How far a study is: a bar on a terminal, plain lines elsewhere."""

import dataclasses
import sys
import time
from pathlib import Path
from typing import Any, TextIO

_WIDTH = 30  # [characters] of the bar
_CLEAR = "\r\033[K"
_NOT_NAMED = {"scenario", "seed", "out", "uncertainty", "world", "digest", "source"}
"""Fields of tasks that a title does not list with the others."""


class Progress:
    """Tells of each finished trial. Use it as a context manager."""

    def __init__(self, total: int, kept: int = 0, out: TextIO | None = None) -> None:
        """total: trials of the study; kept: of an earlier run, not run again."""
        self._total, self._kept = total, kept
        self._out = sys.stdout if out is None else out
        self._bar = self._out.isatty()
        self._done = self._wins = 0
        self._started = time.monotonic()

    def __enter__(self) -> "Progress":
        if self._kept:
            self._out.write(f"{self._kept} of {self._total} trials are kept from before\n")
        self._draw()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar:
            self._out.write(_CLEAR)
        self._out.flush()

    def tell(self, title: str, row: dict[str, Any]) -> None:
        """A trial has ended. title: which one, see ``title``."""
        self._done += 1
        self._wins += bool(row.get("success"))
        mark = "ok  " if row.get("success") else "FAIL"
        self._out.write(
            f"{_CLEAR if self._bar else ''}[{self._kept + self._done:3d}/{self._total}] {mark} "
            f"{title}{': ' if row.get('reason') else ''}{row.get('reason', '')} "
            f"({time.monotonic() - self._started:.0f} s)\n"
        )
        self._draw()

    def _draw(self) -> None:
        if self._bar:
            done = self._kept + self._done
            full = round(_WIDTH * done / max(1, self._total))
            elapsed = time.monotonic() - self._started
            left = ""
            if self._done:
                left = f", {elapsed / self._done * (self._total - done):.0f} s to go"
            bar = "█" * full + "░" * (_WIDTH - full)
            self._out.write(f"{_CLEAR}{bar} {done}/{self._total}, {self._wins} succeed{left}")
        self._out.flush()


def title(task: Any) -> str:
    """Which trial a task of a study is: its names (scenario, method, object, ...), counts, seed."""
    told = [Path(task.scenario).stem] if hasattr(task, "scenario") else []
    for field in dataclasses.fields(task):
        value = getattr(task, field.name)
        if field.name in _NOT_NAMED:
            continue
        if isinstance(value, str) and value:
            told.append(value)
        elif isinstance(value, int | float):  # also a bool
            told.append(f"{field.name.replace('_', ' ')} {value}")
    return ", ".join([*told, f"seed {task.seed}"])
