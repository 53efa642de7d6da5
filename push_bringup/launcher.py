"""One process per node: start, monitor and stop them, and report which one died."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from push_ros.job_memory import VARIABLE, new_memory
from push_ros.process import die_with_parent, prepare_environment
from push_ros.start import command_of

_GRACE = 2.5  # [s] after SIGINT, then SIGTERM
_MOST_DEATHS = 5  # restarts of one node before it is given up
_LAST = 0.8  # [s] after SIGTERM, then SIGKILL
_TAIL = 600  # [characters] kept of a dead node's output


@dataclass
class Child:
    """A node in a process of its own, see ``push_ros/start.py``.

    bag: folder that it writes, when it is a recorder. memory: file in which it keeps its job, for
    the one that is started in its place; see ``push_ros/job_memory.py``.
    """

    name: str
    module: str
    arguments: list[str]
    bag: Path | None = None
    process: "subprocess.Popen[bytes] | None" = None
    deaths: int = 0
    memory: int | None = None

    @property
    def words(self) -> list[str]:
        """Its command line; a restarted recorder writes to a new folder beside the old one."""
        words = list(self.arguments)
        if self.bag is not None and self.deaths:
            words += ["-p", f'out:="{self.bag}-{self.deaths + 1}"']
        return words


class Launcher:
    """Runs children until it is told to stop or one of them dies.

    respawn: start a dead child again instead of stopping.
    logs: folder for the output of the children; the terminal if not given.
    """

    def __init__(
        self,
        children: Sequence[Child],
        respawn: bool = False,
        say: Callable[[str], None] = lambda text: print(text, file=sys.stderr, flush=True),
        logs: Path | None = None,
        domain: int | None = None,
    ) -> None:
        """domain: ROS domain of the children; that of the environment if not given."""
        self.children = list(children)
        self._respawn = respawn
        self._say = say
        self._logs = logs
        self._stopping = False
        self._gave_up = False
        self._environment = prepare_environment(dict(os.environ))
        if domain is not None:
            self._environment["ROS_DOMAIN_ID"] = str(domain)

    def start(self) -> None:
        """Start all children."""
        for child in self.children:
            if not self._stopping:
                self._start(child)

    def _start(self, child: Child) -> None:
        command = command_of(child.module, child.words)
        if self._logs is None:
            self._open(child, command, None)
            return
        with self._log(child).open("ab") as file:
            self._open(child, command, file.fileno())

    def _open(self, child: Child, command: list[str], output: int | None) -> None:
        environment, passed = self._environment, list[int]()
        if self._respawn:
            child.memory = new_memory() if child.memory is None else child.memory
            environment, passed = {**environment, VARIABLE: str(child.memory)}, [child.memory]
        child.process = subprocess.Popen(
            command,
            env=environment,
            pass_fds=passed,
            start_new_session=True,
            preexec_fn=die_with_parent,
            stdout=output,
            stderr=output,
        )

    def _log(self, child: Child) -> Path:
        assert self._logs is not None
        return self._logs / f"{child.name.replace('/', '-')}.log"

    def last_words(self, name: str) -> str:
        """The last output of a child, if it is kept."""
        (child,) = (c for c in self.children if c.name == name)
        if self._logs is None or not self._log(child).is_file():
            return ""
        return self._log(child).read_text(errors="replace").strip()[-_TAIL:]

    def request_stop(self) -> None:
        """Ask the launcher to stop; may be called from a signal handler."""
        self._stopping = True

    @property
    def stopping(self) -> bool:
        """Whether it has been asked to stop."""
        return self._stopping

    def check(self) -> list[str]:
        """Names of children that died since the last check; restarts them if respawn is set."""
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

    def failed(self) -> list[str]:
        """Names of children that died since the last check and are not restarted."""
        dead = self.check()
        return dead if self._gave_up or not self._respawn else []

    def run(self, finished: Callable[[], bool] = lambda: False) -> int:
        """Monitor until stopped; 0 if asked to stop or finished, 1 if a child died."""
        code = 0
        while not self._stopping and not finished():
            if self.failed():
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
            (signal.SIGKILL, 0.7),
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
        for child in self.children:
            if child.memory is not None:
                os.close(child.memory)
                child.memory = None
