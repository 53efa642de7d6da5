"""Stops e-puck2 robots when the bridge has died without doing so.

An e-puck2 goes on with its last speeds when its connection ends: the maker's firmware waits for
the next client and keeps the motors as they are. The bridge therefore starts this small process and
holds a pipe to it. When the pipe closes without the word "done", the guard connects to each robot
and commands a stop. ``python -m lab_bridge.guard HOST:PORT ...`` reads the pipe from its standard
input.
"""

import contextlib
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Sequence

from lab_bridge.epuck2_packets import encode

_LIMIT = 5.0  # [s] of wall time for all robots
_TRY = 0.5  # [s] of wall time for a connection or an answer
_PAUSE = 0.05  # [s]
_DONE = b"done"


class Guard:
    """The pipe to the process, on the bridge's side."""

    def __init__(self, addresses: Sequence[tuple[str, int]]) -> None:
        words = [f"{host}:{port}" for host, port in addresses]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "lab_bridge.guard", *words],
            stdin=subprocess.PIPE,
            start_new_session=True,
        )

    def dismiss(self) -> None:
        """The robots have been stopped by the bridge itself; the process ends."""
        with contextlib.suppress(OSError, ValueError):
            assert self._process.stdin is not None
            self._process.stdin.write(_DONE)
            self._process.stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(1.0)


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
    waiting = [(host, int(port)) for host, _, port in (w.rpartition(":") for w in given)]
    end = time.monotonic() + _LIMIT
    while waiting and time.monotonic() < end:
        waiting = [address for address in waiting if not stop(address)]
        time.sleep(_PAUSE)
    return 1 if waiting else 0


if __name__ == "__main__":
    sys.exit(main())
