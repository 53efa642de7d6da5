"""Trials in processes of their own: failures become rows, interruptions keep what is finished."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

from push_study.experiments.single_robot import aggregate
from push_study.trials import run_trials

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Task:
    seed: int
    what: str = "ok"
    scenario: str = "none"


def trial(task):
    if task.what == "raise":
        raise ValueError("no such thing")
    if task.what == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    if task.what == "hang":
        time.sleep(600)
    return {"scenario": task.scenario, "seed": task.seed, "success": True, "pid": os.getpid()}


def test_rows_come_in_the_order_of_the_tasks_and_failures_are_rows(tmp_path):
    tasks = [Task(1), Task(2, "raise"), Task(3, "die"), Task(4)]
    rows = run_trials(trial, tasks, tmp_path / "rows.jsonl", workers=2)
    assert [r["seed"] for r in rows] == [1, 2, 3, 4]
    assert [r["success"] for r in rows] == [True, False, False, True]
    assert rows[1]["reason"] == "ValueError: no such thing"
    assert "died" in rows[2]["reason"] and "-9" in rows[2]["reason"]
    assert rows[0]["pid"] != rows[3]["pid"] != os.getpid()
    assert aggregate(rows)["success"] == 0.5
    journal = [json.loads(line) for line in (tmp_path / "rows.jsonl").read_text().splitlines()]
    assert sorted(r["seed"] for r in journal) == [1, 2, 3, 4]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_keeps_finished_trials_and_leaves_no_process(tmp_path, number):
    """FAULTS 18 and 19."""
    code = (
        "from tests.push_study.test_trials import Task, trial\n"
        "from push_study.trials import run_trials\n"
        "if __name__ == '__main__':\n"
        "    from pathlib import Path\n"
        "    tasks = [Task(1), Task(2), Task(3, 'hang'), Task(4, 'hang'), Task(5)]\n"
        f"    rows = run_trials(trial, tasks, Path({str(tmp_path / 'rows.jsonl')!r}), workers=2)\n"
        "    print('kept', len(rows))\n"
    )
    script = tmp_path / "study.py"
    script.write_text(code)
    process = subprocess.Popen(
        [sys.executable, str(script)],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": f"{ROOT}:{os.environ.get('PYTHONPATH', '')}"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    journal = tmp_path / "rows.jsonl"
    end = time.monotonic() + 60.0
    while time.monotonic() < end and not (
        journal.exists() and len(journal.read_text().splitlines()) >= 2
    ):
        time.sleep(0.05)
    time.sleep(1.0)  # by now the other two hang
    process.send_signal(number)
    out, err = process.communicate(timeout=5.0)
    assert "kept 2" in out and "interrupted: 2 of 5" in err
    end = time.monotonic() + 2.0
    while time.monotonic() < end and group_exists(process.pid):
        time.sleep(0.05)
    assert not group_exists(process.pid)


def group_exists(number):
    try:
        os.killpg(number, 0)
    except ProcessLookupError:
        return False
    return True
