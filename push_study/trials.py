"""Many trials through one executor: local processes, or a Dask cluster by address.

Every finished trial is written down at once, so that an interrupted study keeps what it has.
"""

import json
import multiprocessing
import multiprocessing.connection
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from push_ros.process import die_with_parent

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
    with journal.open("w", encoding="utf-8") as file, ExitStack() as stack:
        stack.enter_context(_sigterm_as_interrupt())
        try:
            for index, row in stack.enter_context(
                closing(_results(trial, tasks, scheduler, workers))
            ):
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


@contextmanager
def _sigterm_as_interrupt() -> Iterator[None]:
    """SIGTERM ends a study as Ctrl-C does: what is finished is kept."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(number: int, frame: Any) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def guarded(trial: Trial, task: Any) -> Row:
    """The trial's row, or a failed row that names the exception."""
    try:
        return trial(task)
    except Exception as error:
        return _failed(task, f"{type(error).__name__}: {error}")


def _failed(task: Any, reason: str) -> Row:
    return {
        "scenario": getattr(task, "scenario", ""),
        "seed": getattr(task, "seed", None),
        "success": False,
        "reason": reason,
    }


def _results(
    trial: Trial, tasks: Sequence[Any], scheduler: str, workers: int
) -> Generator[tuple[int, Row], None, None]:
    if scheduler:
        try:
            from dask.distributed import Client
            from dask.distributed import as_completed as dask_completed
        except ImportError:
            raise SystemExit("--scheduler needs Dask: pip install distributed") from None
        with Client(scheduler) as client:
            futures = {
                client.submit(_isolated, trial, t, pure=False): i for i, t in enumerate(tasks)
            }
            for future in dask_completed(futures):
                index = futures[future]
                error = future.exception()
                yield (
                    index,
                    future.result() if error is None else _failed(tasks[index], repr(error)),
                )
        return
    yield from _local_results(trial, tasks, workers or os.cpu_count() or 1)


def _local_results(trial: Trial, tasks: Sequence[Any], workers: int) -> Iterator[tuple[int, Row]]:
    """One process a trial: no state of ROS or PyBullet survives from one to the next."""
    context = multiprocessing.get_context("spawn")
    waiting = list(enumerate(tasks))[::-1]
    running: dict[Connection, tuple[int, BaseProcess]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < workers:
                index, task = waiting.pop()
                receiver, sender = context.Pipe(duplex=False)
                process = context.Process(target=_in_process, args=(sender, trial, task))
                process.start()
                sender.close()
                running[receiver] = (index, process)
            for ready in multiprocessing.connection.wait(list(running)):
                assert isinstance(ready, Connection)
                index, process = running.pop(ready)
                try:
                    row = ready.recv()
                except (EOFError, OSError):
                    _end(process)
                    text = f"the trial's process died (exit code {process.exitcode})"
                    row = _failed(tasks[index], text)
                yield index, row
                _end(process)
    finally:
        for _, process in running.values():
            process.terminate()
        for _, process in running.values():
            process.join(2.0)
            if process.is_alive():
                process.kill()


def _end(process: BaseProcess) -> None:
    """Its row is here; it has a few seconds to tidy up."""
    process.join(5.0)
    if process.is_alive():
        process.kill()
        process.join()


def _isolated(trial: Trial, task: Any) -> Row:
    """The trial in a process of its own, from a Dask worker, which must not have children."""
    done = subprocess.run(
        [sys.executable, "-m", "push_study.trials"],
        input=pickle.dumps((trial, task)),
        stdout=subprocess.PIPE,
        check=False,
    )
    if done.returncode != 0:
        return _failed(task, f"the trial's process died (exit code {done.returncode})")
    row: Row = pickle.loads(done.stdout)
    return row


def _in_process(sender: Connection, trial: Trial, task: Any) -> None:
    """In a process of its own, which a key press does not reach and which outlives nobody."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    die_with_parent()
    sender.send(guarded(trial, task))


if __name__ == "__main__":  # a trial for _isolated: the task comes in, nothing but the row goes out
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    answer.write(pickle.dumps(guarded(*pickle.load(sys.stdin.buffer))))
    answer.close()
