"""Many trials through one executor: local processes, or a Dask cluster by address.

Every finished trial is written down at once, with what it was, so that a study that was interrupted
goes on where it ended.
"""

import dataclasses
import json
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

from push_study.cluster import cluster_results
from push_study.pool import Row, Trial, local_results
from push_study.progress import Progress, title

__all__ = ["Row", "Trial", "identity", "read_journal", "run_trials"]


def identity(task: Any) -> str:
    """What a task is, as JSON: all its fields but the folder ``out``, which may be moved."""
    values = dataclasses.asdict(task)
    values.pop("out", None)
    return json.dumps({"trial": type(task).__name__, **values}, sort_keys=True)


def read_journal(journal: Path) -> dict[str, Row]:
    """Row by identity of every finished trial; a line that was cut off counts for nothing, and a
    trial that crashed is not finished."""
    rows: dict[str, Row] = {}
    if not journal.is_file():
        return rows
    for line in journal.read_text(encoding="utf-8").splitlines():
        try:
            entry = json.loads(line)
        except ValueError:
            continue
        if not entry["row"].get("crashed"):
            rows[entry["task"]] = entry["row"]
    return rows


def run_trials(
    trial: Trial, tasks: Sequence[Any], journal: Path, scheduler: str = "", workers: int = 0
) -> list[Row]:
    """Run a function on every task, show progress, return the rows in the order of the tasks.

    Parameters
    ----------
    trial: importable function of one task; a raised exception becomes a failed row.
    tasks: dataclasses. Those whose rows are in the journal are not run again.
    journal: JSON-lines file that each finished row is appended to.
    scheduler: address of a Dask scheduler; empty for local processes.
    workers: local processes; 0 for one a core.
    """
    journal.parent.mkdir(parents=True, exist_ok=True)
    known = read_journal(journal)
    keys = [identity(task) for task in tasks]
    rows = {i: known[key] for i, key in enumerate(keys) if key in known}
    open_tasks = [(i, task) for i, task in enumerate(tasks) if i not in rows]
    _rewrite(journal, known)
    with journal.open("a", encoding="utf-8") as file, ExitStack() as stack:
        stack.enter_context(_signals_as_interrupts())
        progress = stack.enter_context(Progress(len(tasks), len(rows)))
        results = (
            cluster_results(trial, open_tasks, scheduler)
            if scheduler
            else local_results(trial, open_tasks, workers or os.cpu_count() or 1)
        )
        try:
            for index, row in stack.enter_context(closing(results)):  # type: ignore[type-var]
                rows[index] = row
                file.write(json.dumps({"task": keys[index], "row": row}) + "\n")
                file.flush()
                progress.tell(title(tasks[index]), row)
        except KeyboardInterrupt:
            print(f"interrupted: {len(rows)} of {len(tasks)} trials are kept", file=sys.stderr)
    return [rows[i] for i in sorted(rows)]


def _rewrite(journal: Path, rows: dict[str, Row]) -> None:
    """Leave whole lines of finished trials only."""
    temporary = journal.with_suffix(".new")
    lines = (json.dumps({"task": key, "row": row}) + "\n" for key, row in rows.items())
    temporary.write_text("".join(lines), encoding="utf-8")
    temporary.replace(journal)


@contextmanager
def _signals_as_interrupts() -> Iterator[None]:
    """SIGINT and SIGTERM end a study, and what is finished is kept.

    Both are set: a process that a script starts in the background ignores SIGINT from its birth.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(number: int, frame: Any) -> None:
        raise KeyboardInterrupt

    before = {n: signal.signal(n, interrupt) for n in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
