"""How the operating system schedules the process of a node.

The nodes between poses and commands have a real-time priority if the system permits it. Without it,
a process that computes, for example a browser or a planner, may finish its time slice of some
milliseconds before a node that has received poses runs.

A node with a real-time priority must not keep other processes from running. If it computes for
``LONGEST`` without waiting, the priority is suspended for ``PAUSE``, as soon as compiled code that
runs then returns. Processes that the node starts do not inherit the priority.
"""

import contextlib
import math
import os
import resource
import signal
import time
from collections.abc import Callable
from enum import Enum
from types import FrameType
from typing import Any

LONGEST = 0.2
"""[s] of computation without waiting after which the real-time priority is suspended."""
PAUSE = 5.0
"""[s] of wall time for which it is suspended."""
EVERY = 1.0
"""[s] of wall time after which threads that are new get the priority; an executor starts some."""
NICE = 5
"""Niceness of processes in the background."""

_REFUSED = (
    "no real-time priority ({error}): on a busy machine, commands may be late by some "
    "milliseconds; to permit it, see 'Real-time priority' in docs/ros.md"
)
_SUSPENDED = f"computed for {LONGEST:g} s without waiting; its real-time priority is suspended"


class Urgency(Enum):
    """How soon a node must run. The value is its real-time priority (1 to 99); not positive: none.

    WORLD: it measures and moves robots, and stops them when no command comes. CONTROL: it answers
    poses with commands, or with the heartbeat without which a robot stops. BACKGROUND: it plans,
    plays a bag or shows, and gives way to other processes. ORDINARY: it records.
    """

    WORLD = 11
    CONTROL = 10
    ORDINARY = 0
    BACKGROUND = -1


def go_to_background(folder: str = "/proc/self") -> None:
    """Give way to other processes. Threads that exist already keep their priority.

    If the kernel groups processes by session (autogroup), a niceness acts within a session only.
    The group of a session that this process leads therefore gets the niceness too.
    """
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, max(NICE, os.getpriority(os.PRIO_PROCESS, 0)))
    if os.getsid(0) == os.getpid():
        with contextlib.suppress(OSError), open(f"{folder}/autogroup", "w") as file:
            file.write(str(NICE))


class RealTimePriority:
    """The real-time priority of all threads of this process.

    held: whether they have it. refusal: why the system does not permit it; empty if it does, or if
    the urgency asks for none. tell: called with a sentence when it is suspended for the first time.
    """

    def __init__(self, urgency: Urgency, tell: Callable[[str], Any]) -> None:
        self.held, self.refusal = False, ""
        self._priority, self._tell = urgency.value, tell
        self._due: float | None = None  # [s] monotonic time to take it (again)
        self._told = False
        self._before: tuple[Any, tuple[int, int]] | None = None
        if self._priority <= 0 or not hasattr(os, "sched_setscheduler"):  # macOS has no such call
            return
        limits = resource.getrlimit(resource.RLIMIT_RTTIME)
        self._before = signal.signal(signal.SIGXCPU, self._suspend), limits
        try:
            self._take()
        except OSError as error:
            self.refusal = _REFUSED.format(error=error.strerror)
            self.close()
        else:
            self.held, self._due = True, -math.inf

    def look(self) -> None:
        """Give it to new threads, and take it again if it has been suspended for long enough.

        To be called after each spin.
        """
        if self._due is not None and time.monotonic() >= self._due:
            with contextlib.suppress(OSError):
                self._take()
                self.held = True
            self._due = time.monotonic() + EVERY

    def _take(self) -> None:
        """With the limit, which the kernel raises by 1 s each time that it sends the signal. It
        kills the process at the hard limit, so where the system sets one, half of it is taken."""
        _, hard = resource.getrlimit(resource.RLIMIT_RTTIME)
        soft = round(1e6 * LONGEST)  # [us]
        if hard != resource.RLIM_INFINITY:
            soft = min(soft, hard // 2)
        resource.setrlimit(resource.RLIMIT_RTTIME, (soft, hard))
        _schedule(os.SCHED_RR, self._priority)

    def close(self) -> None:
        """Give the priority back."""
        if self.held:
            _schedule(os.SCHED_OTHER, 0)
        self.held, self._due = False, None
        if self._before is not None:
            handler, limits = self._before
            resource.setrlimit(resource.RLIMIT_RTTIME, limits)
            signal.signal(signal.SIGXCPU, handler)
            self._before = None

    def _suspend(self, number: int, frame: FrameType | None) -> None:
        """The kernel sends this signal when a thread has computed for too long."""
        if not self.held:
            return
        _schedule(os.SCHED_OTHER, 0)
        self.held, self._due = False, time.monotonic() + PAUSE
        if not self._told:
            self._told = True
            self._tell(_SUSPENDED)


def _schedule(policy: int, priority: int) -> None:
    """Schedule all threads of this process. What they start later has the ordinary priority."""
    for thread in os.listdir("/proc/self/task"):
        with contextlib.suppress(ProcessLookupError):  # it has ended
            parameter = os.sched_param(priority)
            os.sched_setscheduler(int(thread), policy | os.SCHED_RESET_ON_FORK, parameter)
