"""Many trials through one executor: local processes, or a Dask cluster by address.

Every finished trial is written down at once, so that an interrupted study keeps what it has.
"""

import json
import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

Row = dict[str, Any]
Trial = Callable[[Any], Row]


def run_trials(
    trial: Trial, tasks: Sequence[Any], journal: Path, scheduler: str = "", workers: int = 0
) -> list[Row]:
    """Run a function on every task, show progress, return the rows in the order of the tasks.

    Parameters
    ----------
    trial: importable function of one task; a raised exception becomes a failed row.
    journal: JSON-lines file that each finished row is appended to.
    scheduler: address of a Dask scheduler; empty for local processes.
    workers: local processes; 0 for one a core.
    """
    rows: dict[int, Row] = {}
    started = time.monotonic()
    journal.parent.mkdir(parents=True, exist_ok=True)
    with journal.open("w", encoding="utf-8") as file:
        try:
            for index, row in _results(trial, tasks, scheduler, workers):
                rows[index] = row
                file.write(json.dumps(row) + "\n")
                file.flush()
                mark = "ok  " if row.get("success") else "FAIL"
                print(
                    f"[{len(rows):3d}/{len(tasks)}] {mark} {row.get('scenario', '')} "
                    f"seed {row.get('seed')}: {row.get('reason', '')} "
                    f"({time.monotonic() - started:.0f} s)",
                    flush=True,
                )
        except KeyboardInterrupt:
            print(f"interrupted: {len(rows)} of {len(tasks)} trials are kept", file=sys.stderr)
    return [rows[i] for i in sorted(rows)]


def guarded(trial: Trial, task: Any) -> Row:
    """The trial's row, or a failed row that names the exception."""
    try:
        return trial(task)
    except Exception as error:
        return {
            "scenario": getattr(task, "scenario", ""),
            "seed": getattr(task, "seed", None),
            "success": False,
            "reason": f"{type(error).__name__}: {error}",
        }


def _results(
    trial: Trial, tasks: Sequence[Any], scheduler: str, workers: int
) -> Iterator[tuple[int, Row]]:
    if scheduler:
        try:
            from dask.distributed import Client
            from dask.distributed import as_completed as dask_completed
        except ImportError:
            raise SystemExit("--scheduler needs Dask: pip install 'distributed'") from None
        client = Client(scheduler)
        futures = {client.submit(guarded, trial, t, pure=False): i for i, t in enumerate(tasks)}
        for future in dask_completed(futures):
            yield futures[future], future.result()
        return
    count = workers or os.cpu_count() or 1
    context = multiprocessing.get_context("spawn")
    # One process a trial: no state of ROS or PyBullet survives from one to the next.
    with ProcessPoolExecutor(count, mp_context=context, max_tasks_per_child=1) as pool:
        local: dict[Future[Row], int] = {
            pool.submit(guarded, trial, task): i for i, task in enumerate(tasks)
        }
        try:
            for done in as_completed(local):
                yield local[done], done.result()
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
