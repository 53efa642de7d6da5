"""What tests of live processes share: who runs, who is a child of whom, whether a bag is whole."""

import os
import subprocess
import sys
import time

import yaml
from mcap.reader import make_reader

from push_bringup.launcher import Launcher
from push_bringup.preparation import prepare
from push_record.bag import bag_file


def launcher_of(folder, scenario="short", said=None, respawn=False, **words):
    """A launcher of the suite's processes; what it reads is in ``folder``."""
    folder.mkdir(exist_ok=True)
    say = (lambda text: None) if said is None else said.append
    return Launcher(prepare(scenario, **words).write(folder), respawn, say)


def command(*words, **options):
    """The command line in a process of its own."""
    line = [sys.executable, "-m", "planar_push", *words]
    return subprocess.Popen(line, start_new_session=True, text=True, **options)


def alive(group):
    return [c for c in group if c.process is not None and c.process.poll() is None]


def until(condition, limit):
    end = time.monotonic() + limit
    while time.monotonic() < end and not condition():
        time.sleep(0.05)
    return condition()


def children_of(pid):
    found = []
    for entry in os.listdir("/proc"):
        if entry.isdigit():
            try:
                with open(f"/proc/{entry}/stat") as file:
                    if int(file.read().rsplit(")", 1)[1].split()[1]) == pid:
                        found.append(int(entry))
            except OSError:
                continue
    return found


def running(pids):
    """Those of the processes that have not ended."""
    return [p for p in pids if os.path.exists(f"/proc/{p}") and not _zombie(p)]


def _zombie(pid):
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rsplit(")", 1)[1].split()[0] == "Z"
    except OSError:
        return True


def assert_closed(bag):
    """By a strict reader: footer, summary and metadata are there and agree."""
    with bag_file(bag).open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None and summary.statistics is not None
        count = summary.statistics.message_count
    information = yaml.safe_load((bag / "metadata.yaml").read_text())
    assert information["rosbag2_bagfile_information"]["message_count"] == count
