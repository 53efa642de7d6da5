"""One process per node: start them, watch them, say which one died, stop them all."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

from push_ros.process import die_with_parent, prepare_environment

_GRACE = 2.5  # [s] after SIGINT, then SIGTERM
_MOST_DEATHS = 5  # of one node, until it is not started again
_LAST = 1.5  # [s] after SIGTERM, then SIGKILL


@dataclass
class Child:
    """A node in a process of its own."""

    name: str
    arguments: list[str]
    process: "subprocess.Popen[bytes] | None" = None
    deaths: int = 0

    @property
    def words(self) -> list[str]:
        """Its command line; one that was started again writes beside what is there."""
        words = list(self.arguments)
        if self.deaths and "--out" in words:
            words[words.index("--out") + 1] += f"-{self.deaths + 1}"
        return words


class Launcher:
    """Runs children until it is told to stop or one of them dies.

    respawn: start a dead child again instead of stopping.
    """

    def __init__(
        self,
        children: list[Child],
        respawn: bool = False,
        say: Callable[[str], None] = lambda text: print(text, file=sys.stderr, flush=True),
    ) -> None:
        self.children = children
        self._respawn = respawn
        self._say = say
        self._stopping = False
        self._gave_up = False
        self._environment = prepare_environment(dict(os.environ))

    def start(self) -> None:
        """Start all children."""
        for child in self.children:
            if not self._stopping:
                self._start(child)

    def _start(self, child: Child) -> None:
        command = [sys.executable, "-m", "planar_push.cli", "node", *child.words]
        child.process = subprocess.Popen(
            command, env=self._environment, start_new_session=True, preexec_fn=die_with_parent
        )

    def request_stop(self) -> None:
        """May be called from a signal handler."""
        self._stopping = True

    def check(self) -> list[str]:
        """Names of children that died since the last check; respawns them if so asked."""
        dead = []
        for child in self.children:
            code = None if child.process is None else child.process.poll()
            if code is None:
                continue
            child.deaths += 1
            dead.append(child.name)
            how = f"signal {-code}" if code < 0 else f"exit code {code}"
            self._say(f"{child.name} died ({how})")
            child.process = None
            if not self._respawn or self._stopping:
                continue
            if child.deaths > _MOST_DEATHS:
                self._say(f"{child.name} died {child.deaths} times; it is not started again")
                self._gave_up = True
                continue
            self._say(f"{child.name} is started again")
            self._start(child)
        return dead

    def run(self, finished: Callable[[], bool] = lambda: False) -> int:
        """Watch until stopped; 0 when asked to stop or finished, 1 when a child died."""
        code = 0
        while not self._stopping and not finished():
            if self.check() and (self._gave_up or not self._respawn):
                self._say("stopping the rest")
                code = 1
                break
            time.sleep(0.05)
        self.stop()
        return code

    def stop(self) -> None:
        """End all children: SIGINT, then SIGTERM, then SIGKILL; within five seconds."""
        self._stopping = True
        for number, limit in (
            (signal.SIGINT, _GRACE),
            (signal.SIGTERM, _LAST),
            (signal.SIGKILL, 1.0),
        ):
            alive = [c for c in self.children if c.process and c.process.poll() is None]
            for child in alive:
                assert child.process is not None
                child.process.send_signal(number)
            end = time.monotonic() + limit
            while time.monotonic() < end and any(
                c.process and c.process.poll() is None for c in alive
            ):
                time.sleep(0.02)


def single_robot(
    scenario: str, record: str = "", extra: dict[str, list[str]] | None = None
) -> list[Child]:
    """The children of a single-robot run; extra: further command-line words by node name."""
    extra = extra or {}
    children = [
        Child(name, [name, "--scenario", scenario, *extra.get(name, [])])
        for name in ("bridge", "planner", "controller", "supervisor")
    ]
    if record:
        children.insert(0, Child("recorder", ["recorder", "--scenario", scenario, "--out", record]))
    return children
