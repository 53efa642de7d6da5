"""Trials in worker processes that stay: imports and compiled kernels are paid for once a worker.

A trial finds a process in which others ran before it. It must leave nothing behind, and does not:
its ROS context, domain and world are its own; rows are equal to the bit to those of fresh
processes, and a test says so.
"""

import multiprocessing
import multiprocessing.connection
import signal
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

from push_ros.process import die_with_parent

Row = dict[str, Any]
Trial = Callable[[Any], Row]

_TIDY = 2.0  # [s] that a worker has to end


def guarded(trial: Trial, task: Any) -> Row:
    """The trial's row, or a crashed one that names the exception."""
    try:
        return trial(task)
    except Exception as error:
        return crashed(task, f"{type(error).__name__}: {error}")


def crashed(task: Any, reason: str) -> Row:
    """The row of a trial that has no end of its own; it is run again when a study goes on.

    It says what was tried: all fields of the task that are texts, numbers or truth values, under
    their names. A field that tells cells of a study apart must therefore have the name of its
    column in the rows. The folder ``out`` and the ``digest`` of files are left out.
    """
    tried = {k: v for k, v in vars(task).items() if isinstance(v, (str, int, float))}
    for name in ("out", "digest"):
        tried.pop(name, None)
    return {
        **tried,
        "success": False,
        "reason": reason,
        "crashed": True,
    }


@dataclass
class _Worker:
    process: BaseProcess
    connection: Connection
    index: int
    task: Any


def local_results(
    trial: Trial, tasks: Iterable[tuple[int, Any]], workers: int
) -> Iterator[tuple[int, Row]]:
    """Index and row of each task, as they end. A worker that dies costs the trial that it ran.

    Close the iterator to end all workers at once.
    """
    waiting = list(tasks)[::-1]
    busy: dict[Connection, _Worker] = {}
    idle: list[_Worker] = []
    try:
        while waiting or busy:
            while waiting and len(busy) < workers:
                index, task = waiting.pop()
                worker = idle.pop() if idle else _started(trial)
                worker.index, worker.task = index, task
                busy[worker.connection] = worker
                try:
                    worker.connection.send(task)
                except OSError:  # it has just died; what it was is told by its connection
                    pass
            for ready in multiprocessing.connection.wait(list(busy)):
                assert isinstance(ready, Connection)
                worker = busy.pop(ready)
                try:
                    row = ready.recv()
                except (EOFError, OSError):
                    worker.process.join(_TIDY)
                    code = worker.process.exitcode
                    row = crashed(worker.task, f"the trial's process died (exit code {code})")
                    ready.close()
                else:
                    idle.append(worker)
                yield worker.index, row
    finally:
        _end([*busy.values(), *idle])


def _started(trial: Trial) -> _Worker:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(theirs, trial), daemon=True)
    process.start()
    theirs.close()
    return _Worker(process, ours, -1, None)


def _end(workers: list[_Worker]) -> None:
    for worker in workers:
        worker.process.terminate()
    for worker in workers:
        worker.process.join(_TIDY)
        if worker.process.is_alive():
            worker.process.kill()
            worker.process.join()
        worker.connection.close()


def _work(connection: Connection, trial: Trial) -> None:
    """In the worker, which a key press does not reach and which outlives nobody."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    die_with_parent()
    while True:
        try:
            task = connection.recv()
        except (EOFError, OSError):
            return
        connection.send(guarded(trial, task))
