"""Signals before anything runs: they interrupt, and are not forgotten where that is swallowed."""

import os
import signal
import subprocess
import sys

import pytest

from planar_push import arguments


@pytest.fixture
def handlers(signal_handlers):
    yield
    arguments._asked.clear()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_something_swallowed_stops_what_is_started_later(handlers, number):
    arguments.hear_signals()
    with pytest.raises(KeyboardInterrupt):
        os.kill(os.getpid(), number)
    stopped = []
    arguments.stop_on_signals(lambda: stopped.append(True))
    assert stopped == [True]
    os.kill(os.getpid(), number)
    assert stopped == [True, True]


def test_without_a_signal_nothing_is_stopped(handlers):
    arguments.hear_signals()
    stopped = []
    arguments.stop_on_signals(lambda: stopped.append(True))
    assert not stopped


SWALLOW = """
import os, signal, sys
from planar_push import launch, main
import push_bringup.preparation as preparation
class Dropped:
    def __del__(self):
        os.kill(os.getpid(), signal.SIG{name})
def check(namespace="", context=None):
    Dropped()  # Python says "Exception ignored in", and goes on
preparation.check_domain = check
sys.argv[1:] = ["launch", "single", "--scenario", "short"]
main.command()
"""


@pytest.mark.parametrize("name", ["INT", "TERM"])
def test_a_launch_that_lost_its_interrupt_starts_nothing_and_ends(name):
    line = [sys.executable, "-c", SWALLOW.format(name=name)]
    done = subprocess.run(line, capture_output=True, text=True, timeout=60.0)
    assert "Exception ignored" in done.stderr and done.returncode == 0, done.stderr


LOADING = """
import os, signal, sys
class Dropped:
    def __del__(self):
        os.kill(os.getpid(), signal.SIG{name})
class Finder:  # the signal comes while the command line is loaded
    def find_spec(self, name, path=None, target=None):
        if name == "planar_push.main":
            Dropped()
sys.meta_path.insert(0, Finder())
sys.argv[1:] = ["launch", "single", "--scenario", "short"]
from planar_push import entry
entry.command()
"""


@pytest.mark.parametrize("name", ["INT", "TERM"])
def test_a_signal_while_the_command_line_is_loaded_ends_it_at_once(name):
    line = [sys.executable, "-c", LOADING.format(name=name)]
    done = subprocess.run(line, capture_output=True, text=True, timeout=60.0)
    assert done.returncode == 130 and not done.stderr, done.stderr
