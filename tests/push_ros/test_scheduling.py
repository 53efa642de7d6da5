"""How the system schedules nodes: who goes first, who gives way, and that nobody inherits it."""

import os
import re
import resource
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from push_ros import scheduling
from push_ros.scheduling import EVERY, NICE, PAUSE, RealTimePriority, Urgency, go_to_background

CHILD = [sys.executable, "-c", "import os; print(os.sched_getscheduler(0), os.nice(0))"]
ROOT = Path(__file__).resolve().parents[2]


def policy(thread=0):
    return os.sched_getscheduler(thread) & ~os.SCHED_RESET_ON_FORK


def child():
    """Policy and niceness of a process that this thread starts."""
    done = subprocess.run(CHILD, capture_output=True, text=True, check=True)
    return tuple(map(int, done.stdout.split()))


@pytest.fixture
def scheduled(monkeypatch):
    """The requests to the system, which grants them all; yields the policies asked for."""
    asked = []
    monkeypatch.setattr(
        os, "sched_setscheduler", lambda thread, policy, parameter: asked.append((thread, policy))
    )
    return asked


def permitted():
    priority = RealTimePriority(Urgency.CONTROL, print)
    held = priority.held
    priority.close()
    return held


def test_every_thread_goes_first_and_a_process_that_it_starts_does_not(monkeypatch):
    if not permitted():
        pytest.skip("the system permits no real-time priority")
    asleep, awake = threading.Event(), threading.Event()
    thread = threading.Thread(target=lambda: (asleep.set(), awake.wait()))
    thread.start()
    asleep.wait()
    priority = RealTimePriority(Urgency.CONTROL, print)
    try:
        assert priority.held and not priority.refusal
        assert policy() == policy(thread.native_id) == os.SCHED_RR
        assert os.sched_getparam(0).sched_priority == Urgency.CONTROL.value
        assert child()[0] & ~os.SCHED_RESET_ON_FORK == os.SCHED_OTHER
        priority.look()  # as after the first spin
        late = threading.Thread(target=awake.wait)
        late.start()
        assert policy(late.native_id) == os.SCHED_OTHER
        now = time.monotonic()
        monkeypatch.setattr(scheduling.time, "monotonic", lambda: now + EVERY)
        priority.look()
        assert policy(late.native_id) == os.SCHED_RR
    finally:
        priority.close()
        awake.set()
        thread.join()
        late.join()
    assert policy() == os.SCHED_OTHER


def test_who_computes_without_waiting_loses_the_priority_for_a_while(scheduled, monkeypatch):
    """The kernel's signal; the time that follows is the test's."""
    now, told = [100.0], []
    monkeypatch.setattr(scheduling.time, "monotonic", lambda: now[0])
    before = resource.getrlimit(resource.RLIMIT_RTTIME)
    priority = RealTimePriority(Urgency.WORLD, told.append)
    assert resource.getrlimit(resource.RLIMIT_RTTIME)[0] == 200_000  # [us]
    for _ in range(2):
        os.kill(os.getpid(), signal.SIGXCPU)
        assert not priority.held and scheduled[-1][1] == os.SCHED_OTHER | os.SCHED_RESET_ON_FORK
        now[0] += PAUSE - 0.1
        priority.look()
        assert not priority.held
        now[0] += 0.2
        priority.look()
        assert priority.held and scheduled[-1][1] == os.SCHED_RR | os.SCHED_RESET_ON_FORK
    assert len(told) == 1 and "0.2 s" in told[0]
    priority.close()
    assert resource.getrlimit(resource.RLIMIT_RTTIME) == before
    assert signal.getsignal(signal.SIGXCPU) == signal.SIG_DFL


def test_the_kernel_sends_the_signal_to_who_computes_without_waiting():
    if not permitted():
        pytest.skip("the system permits no real-time priority")
    priority = RealTimePriority(Urgency.CONTROL, print)
    end = time.process_time() + 5.0
    while priority.held and time.process_time() < end:
        pass
    assert not priority.held and policy() == os.SCHED_OTHER
    priority.close()


def test_the_limit_of_computation_stays_the_same(scheduled, monkeypatch):
    """The kernel raises it by 1 s with each signal; it was 1.2 s, 2.2 s and so on afterwards."""
    now = [100.0]
    monkeypatch.setattr(scheduling.time, "monotonic", lambda: now[0])
    _, hard = resource.getrlimit(resource.RLIMIT_RTTIME)
    priority = RealTimePriority(Urgency.WORLD, str)
    for _ in range(2):
        resource.setrlimit(resource.RLIMIT_RTTIME, (1_200_000, hard))
        os.kill(os.getpid(), signal.SIGXCPU)
        assert not priority.held
        now[0] += PAUSE + 0.1
        priority.look()
        assert priority.held and resource.getrlimit(resource.RLIMIT_RTTIME)[0] == 200_000
    priority.close()


def test_the_signal_comes_before_the_hard_limit_of_the_system(scheduled, monkeypatch):
    """At the hard limit the kernel kills the process."""
    limits = [(150_000, 150_000)]
    monkeypatch.setattr(resource, "getrlimit", lambda _: limits[-1])
    monkeypatch.setattr(resource, "setrlimit", lambda _, pair: limits.append(pair))
    priority = RealTimePriority(Urgency.WORLD, print)
    assert priority.held and limits[-1] == (75_000, 150_000)
    priority.close()
    assert limits[-1] == limits[0]


def test_a_system_that_refuses_is_no_error(monkeypatch):
    def refuse(*_):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    priority = RealTimePriority(Urgency.WORLD, print)
    assert not priority.held and "Operation not permitted" in priority.refusal
    title, file = re.search(r"see '(.*)' in (\S+)", priority.refusal).groups()
    assert f"## {title}\n" in (ROOT / file).read_text()
    priority.look()
    assert not priority.held
    assert signal.getsignal(signal.SIGXCPU) == signal.SIG_DFL
    priority.close()


@pytest.mark.parametrize("urgency", [Urgency.ORDINARY, Urgency.BACKGROUND])
def test_who_is_not_urgent_asks_for_nothing(scheduled, urgency):
    priority = RealTimePriority(urgency, print)
    assert not priority.held and not priority.refusal
    priority.look()
    priority.close()
    assert not scheduled


def test_the_background_gives_way_and_an_earlier_thread_starts_ordinary_processes(tmp_path):
    """The page is in the background; the suite that is started on it is not."""
    code = f"""
import os, queue, subprocess, threading
from push_ros.scheduling import go_to_background
work, found = queue.Queue(), queue.Queue()
starter = lambda: found.put(subprocess.check_output({CHILD!r}, text=True, start_new_session=True))
threading.Thread(target=lambda: (work.get(), starter())).start()
go_to_background({str(tmp_path)!r})
work.put(0)
print(os.nice(0), found.get().split()[1])
"""
    (tmp_path / "autogroup").write_text("/autogroup-7 nice 0")
    words = [sys.executable, "-c", code]
    mine = os.nice(0)
    done = subprocess.run(
        words, capture_output=True, text=True, check=True, cwd=ROOT, start_new_session=True
    )
    assert done.stdout.split() == [str(max(NICE, mine)), str(mine)]
    assert (tmp_path / "autogroup").read_text() == str(NICE)


def test_the_group_of_a_session_of_others_is_left_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "getsid", lambda _: os.getpid() + 1)
    monkeypatch.setattr(os, "setpriority", lambda *_: None)
    (tmp_path / "autogroup").write_text("/autogroup-7 nice 0")
    go_to_background(str(tmp_path))
    assert (tmp_path / "autogroup").read_text() == "/autogroup-7 nice 0"
