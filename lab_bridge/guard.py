"""Stops e-puck2 robots when the program that drives them has ended without doing so.

An e-puck2 goes on with its last speeds when its connection ends: the maker's firmware waits for
the next client and keeps the motors as they are. A program that drives them therefore starts this
small process and holds a pipe to it. When the pipe closes without the word "done", because the
program was killed or could not reach a robot, the guard connects to each robot and commands a stop.
``python -m lab_bridge.guard HOST:PORT ...`` reads the pipe from its standard input.
"""

import contextlib
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor

from lab_bridge.epuck2_packets import encode

_LIMIT = 30.0  # [s] of wall time, for a network that is away for a while
_TRY = 0.5  # [s] of wall time for a connection or an answer
_PAUSE = 0.05  # [s]
_DONE = b"done"


class Guard:
    """The pipe to the process, on the side of the program that drives robots."""

    def __init__(self, addresses: Sequence[tuple[str, int]]) -> None:
        words = [f"{host}:{port}" for host, port in addresses]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "lab_bridge.guard", *words],
            stdin=subprocess.PIPE,
            start_new_session=True,
        )

    def dismiss(self) -> None:
        """All robots stand, and have said so; the process ends."""
        with contextlib.suppress(OSError, ValueError):
            assert self._process.stdin is not None
            self._process.stdin.write(_DONE)
        self.leave()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(1.0)

    def release(self, drivers: Mapping[str, object]) -> str:
        """End with the program: ``dismiss`` if all robots stand as far as their drivers know, else
        ``leave``. Returns which do not and what becomes of them, for people; empty if all stand."""
        moving = [r for r, driver in drivers.items() if not getattr(driver, "standing", True)]
        if not moving:
            self.dismiss()
            return ""
        self.leave()
        return (
            f"{', '.join(moving)} did not answer the stop command; the guard, a process in the "
            f"background, tries for {_LIMIT:g} s to stop them; switch off those that still move"
        )

    def leave(self) -> None:
        """The program ends, and has not heard from every robot that it stands: the process goes on
        and stops them."""
        with contextlib.suppress(OSError, ValueError):
            assert self._process.stdin is not None
            self._process.stdin.close()


def stop(address: tuple[str, int]) -> bool:
    """Command a stop; whether the robot has answered."""
    try:
        with socket.create_connection(address, _TRY) as link:
            link.settimeout(_TRY)
            link.sendall(encode(0, 0))
            return bool(link.recv(1))
    except OSError:
        return False


def main(words: Sequence[str] | None = None) -> int:
    """Wait for the end of the standard input; then stop the robots, unless they stand already."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)  # it ends with its pipe
    given = sys.argv[1:] if words is None else words
    if sys.stdin.buffer.read().endswith(_DONE):
        return 0
    robots = [(host, int(port)) for host, _, port in (w.rpartition(":") for w in given)]
    with ThreadPoolExecutor(
        max(1, len(robots))
    ) as pool:  # an absent robot must not delay the others
        stopped = list(pool.map(_stop_in_time, robots))
    for (host, port), done in zip(robots, stopped, strict=True):
        if not done:
            text = f"the e-puck2 at {host}:{port} was not reached and may still move: switch it off"
            print(text, file=sys.stderr, flush=True)
    return 0 if all(stopped) else 1


def _stop_in_time(address: tuple[str, int]) -> bool:
    end = time.monotonic() + _LIMIT
    while not stop(address):
        if time.monotonic() > end:
            return False
        time.sleep(_PAUSE)
    return True


if __name__ == "__main__":
    sys.exit(main())
