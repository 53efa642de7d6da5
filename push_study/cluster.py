"""Trials on a Dask cluster, by the address of its scheduler."""

import os
import pickle
import subprocess
import sys
from collections.abc import Iterable, Iterator
from typing import Any

from push_model.settings import SettingsError
from push_study.pool import Row, Trial, crashed, guarded


def check_cluster() -> None:
    """Raise SettingsError where Dask is not installed."""
    try:
        import dask.distributed  # noqa: F401
    except ImportError:
        raise SettingsError("--scheduler needs Dask: pip install distributed") from None


def cluster_results(
    trial: Trial, tasks: Iterable[tuple[int, Any]], scheduler: str
) -> Iterator[tuple[int, Row]]:
    """Index and row of each task, as they end."""
    check_cluster()
    from dask.distributed import Client, as_completed

    with Client(scheduler) as client:
        futures = {client.submit(isolated, trial, t, pure=False): (i, t) for i, t in tasks}
        for future in as_completed(futures):
            index, task = futures[future]
            error = future.exception()
            yield index, (future.result() if error is None else crashed(task, repr(error)))


def isolated(trial: Trial, task: Any) -> Row:
    """The trial in a process of its own, from a Dask worker, which must not have children."""
    done = subprocess.run(
        [sys.executable, "-m", "push_study.cluster"],
        input=pickle.dumps((trial, task)),
        stdout=subprocess.PIPE,
        check=False,
    )
    if done.returncode != 0:
        return crashed(task, f"the trial's process died (exit code {done.returncode})")
    row: Row = pickle.loads(done.stdout)
    return row


if __name__ == "__main__":  # the task comes in, nothing but the row goes out
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    answer.write(pickle.dumps(guarded(*pickle.load(sys.stdin.buffer))))
    answer.close()
