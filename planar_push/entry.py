"""Entry of the process. Until the command line has been loaded, a signal ends it at once.

Loading takes a second. An exception that a signal raises meanwhile can get lost (Python ignores one
in a destructor or a weak reference's callback), and the command would then go on. Nothing has been
started yet, so there is nothing to stop.
"""

import os
import signal

INTERRUPTED = 130  # exit code


def command() -> None:
    """Run the command line of this process; does not return."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: os._exit(INTERRUPTED))
    from planar_push import main  # loads everything

    main.command()
