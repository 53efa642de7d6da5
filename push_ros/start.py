"""Start a node's process: ``python -m push_ros.start MODULE WORDS``, as ``python -m MODULE WORDS``.

Loading a node's module takes a second or two. A signal that arrives meanwhile ends the process at
once and without a traceback: nothing has been started yet, so there is nothing to stop.
"""

import os
import signal
import sys
from collections.abc import Sequence


def command_of(module: str, words: Sequence[str]) -> list[str]:
    """The command line of a process for the node in a module. words: the node's arguments."""
    return [sys.executable, "-m", __name__, module, *words]


def main() -> None:
    """Run the module that the command line names; does not return."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: os._exit(0))
    import runpy

    del sys.argv[0]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
