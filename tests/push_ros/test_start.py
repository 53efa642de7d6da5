"""A node's process that is told to end while it loads."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from push_ros.process import prepare_environment
from push_ros.start import command_of

SCENARIO = ["--ros-args", "-p", "scenario:=short"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_a_node_loads_ends_it_without_a_traceback(domain, number):
    environment = prepare_environment(dict(os.environ))
    line = command_of("push_planner.node", SCENARIO)
    for moment in (0.0, 0.2, 0.4, 0.8, 1.2):  # [s] after it catches signals
        process = subprocess.Popen(line, env=environment, stderr=subprocess.PIPE, text=True)
        while not catches(process.pid, signal.SIGTERM):
            assert process.poll() is None
            time.sleep(0.005)
        time.sleep(moment)
        process.send_signal(number)
        _, said = process.communicate(timeout=60)
        assert process.returncode == 0 and "Traceback" not in said, said


def catches(pid, number):
    """Whether a process has a handler of a signal."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    caught = next(int(line.split()[1], 16) for line in lines if line.startswith("SigCgt:"))
    return bool(caught >> (number - 1) & 1)


def test_a_module_that_cannot_be_loaded_says_so(domain):
    done = subprocess.run(
        command_of("push_planner.atlantis", []), capture_output=True, text=True, check=False
    )
    assert done.returncode != 0 and "atlantis" in done.stderr


@pytest.mark.parametrize("given", ["", "2"])
def test_blas_that_was_loaded_before_has_one_thread_or_as_many_as_are_asked_for(given):
    """With more, it rounds in another way, and runs of equal seeds differ between machines."""
    code = (
        "import numpy, scipy.linalg\n"
        "from push_ros.process import prepare_environment\n"
        "from threadpoolctl import threadpool_info\n"
        "prepare_environment()\n"
        "print(*(i['num_threads'] for i in threadpool_info() if i['user_api'] == 'blas'))\n"
    )
    environment = {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"}
    environment |= {"OPENBLAS_NUM_THREADS": given} if given else {}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    threads = done.stdout.split()
    assert len(threads) >= 2 and set(threads) == {given or "1"}
