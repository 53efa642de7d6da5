"""Trials in worker processes: failures become rows, interruptions keep what is finished, and a
study goes on where it ended."""

import io
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

from push_study.experiments.group_goals import GoalTask
from push_study.experiments.own_sensing import SensingTask
from push_study.leaderboard.match import Match
from push_study.progress import Progress, title
from push_study.summary import aggregate
from push_study.swarm.maps import MapTask
from push_study.trials import identity, read_journal, run_trials

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Task:
    seed: int
    what: str = "ok"
    scenario: str = "none"
    out: str = ""


def trial(task):
    if task.what == "raise":
        raise ValueError("no such thing")
    if task.what == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    if task.what == "hang":
        time.sleep(600)
    return {"scenario": task.scenario, "seed": task.seed, "success": True, "pid": os.getpid()}


@pytest.mark.long
def test_rows_come_in_the_order_of_the_tasks_and_failures_are_rows(tmp_path):
    tasks = [Task(1), Task(2, "raise"), Task(3, "die"), Task(4)]
    rows = run_trials(trial, tasks, tmp_path / "rows.jsonl", workers=2)
    assert [r["seed"] for r in rows] == [1, 2, 3, 4]
    assert [r["success"] for r in rows] == [True, False, False, True]
    assert rows[1]["reason"] == "ValueError: no such thing"
    assert "died" in rows[2]["reason"] and "-9" in rows[2]["reason"]
    assert os.getpid() not in {rows[0]["pid"], rows[3]["pid"]}
    assert aggregate(rows)["success"] == 0.5
    lines = [json.loads(line) for line in (tmp_path / "rows.jsonl").read_text().splitlines()]
    assert sorted(line["row"]["seed"] for line in lines) == [1, 2, 3, 4]


@pytest.mark.long
def test_a_worker_stays_and_one_that_dies_costs_only_its_trial(tmp_path):
    tasks = [Task(1), Task(2), Task(3, "die"), Task(4), Task(5, "raise"), Task(6)]
    rows = run_trials(trial, tasks, tmp_path / "rows.jsonl", workers=1)
    first, second = rows[0]["pid"], rows[3]["pid"]
    assert rows[1]["pid"] == first != second == rows[5]["pid"]
    assert [r["success"] for r in rows] == [True, True, False, True, False, True]
    assert not Path(f"/proc/{first}").exists() and not Path(f"/proc/{second}").exists()


@pytest.mark.long
def test_a_study_goes_on_and_repeats_nothing_that_is_finished(tmp_path, capsys):
    journal = tmp_path / "rows.jsonl"
    done = run_trials(trial, [Task(1), Task(2, "die"), Task(3)], journal, workers=1)
    with journal.open("a") as file:
        file.write('{"task": "cut o')
    tasks = [Task(1, out="elsewhere"), Task(2), Task(3), Task(4)]
    rows = run_trials(trial, tasks, journal, workers=1)
    assert [r["seed"] for r in rows] == [1, 2, 3, 4] and all(r["success"] for r in rows)
    assert (rows[0], rows[2]) == (done[0], done[2])  # with the pids of the first run
    assert rows[1]["pid"] == rows[3]["pid"] != rows[0]["pid"]
    assert "2 of 4 trials are kept" in capsys.readouterr().out
    assert read_journal(journal) == {identity(t): r for t, r in zip(tasks, rows, strict=True)}
    again = run_trials(trial, tasks, journal, workers=1)
    assert again == rows


def test_another_setting_is_another_task():
    assert identity(Task(1)) == identity(Task(1, out="moved"))
    assert len({identity(t) for t in (Task(1), Task(2), Task(1, "hang"), Task(1, "ok", "x"))}) == 4


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_bar_on_a_terminal_and_plain_lines_elsewhere():
    row = {"success": True, "reason": "there"}
    for out in (Terminal(), io.StringIO()):
        with Progress(4, 1, out) as progress:
            progress.tell("s, seed 3", row)
            progress.tell("s, seed 3", {"success": False})
        text = out.getvalue()
        assert "1 of 4 trials are kept" in text
        assert "[  2/4] ok   s, seed 3: there (" in text and "[  3/4] FAIL s, seed 3 (" in text
        assert ("3/4, 1 succeed" in text and "\r" in text) == out.isatty()


def test_a_trial_is_told_by_what_tells_it_from_others():
    match = Match("env1", 3, "/out", "one robot", "planar", "mild", "digest")
    assert title(match) == "env1, one robot, seed 3"
    sensing = SensingTask("transport_middle", 5, "square", "planar", "mild")
    assert title(sensing) == "transport_middle, square, seed 5"
    assert title(GoalTask("a/b.yaml", 1, "/out", 4, 3, "planar", "none")) == (
        "b, robots 4, sides 3, seed 1"
    )
    either = [MapTask("m", 1, "", "square", 9, k, "planar", "mild", 9.0) for k in (True, False)]
    assert title(either[0]) != title(either[1])


@pytest.mark.live
@pytest.mark.parametrize(
    "number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long)]
)
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
        # As in the background of a script, where SIGINT is ignored from the start.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN),
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
