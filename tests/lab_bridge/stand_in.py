"""The lab without hardware: the two programs of examples/lab, on ports that are free."""

import contextlib
import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "examples" / "lab"


def free_port(kind=socket.SOCK_STREAM):
    with socket.socket(socket.AF_INET, kind) as made:
        made.bind(("127.0.0.1", 0))
        return made.getsockname()[1]


def free_ports(count):
    """That many free ports in a row."""
    for _ in range(50):
        first = free_port()
        try:
            with contextlib.ExitStack() as stack:
                for i in range(count):
                    made = stack.enter_context(socket.socket())
                    made.bind(("127.0.0.1", first + i))
            return first
        except OSError:
            continue
    raise RuntimeError("no free ports in a row")


class StandIn:
    """Runs the two programs for a scenario file; ``scenario`` is that file with its own ports."""

    def __init__(self, file, folder, change=lambda values: None, tells=None):
        """change: edits the suite's copy of the scenario. tells: names that motion capture uses,
        as in the file when it is not given."""
        values = yaml.safe_load((FOLDER / file).read_text())
        lab = values["lab"]
        self.robots = list(lab["robots"])
        self.port = free_ports(len(self.robots))
        self.light = self.shines_to = free_port(socket.SOCK_DGRAM)
        for i, robot in enumerate(self.robots):
            lab["robots"][robot]["port"] = self.port + i
        self.table = folder / "table.yaml"
        self.table.write_text(yaml.safe_dump(values))
        self.markers = {b: [e["name"], *e["offset"]] for b, e in lab["bodies"].items()}
        self.markers.update(tells or {})
        self.source = lab["poses"]
        change(values)
        self.scenario = folder / file
        self.scenario.write_text(yaml.safe_dump(values))
        self._stack = contextlib.ExitStack()

    def __enter__(self):
        self.start_robots()
        self.start_capture()
        self.ready()
        return self

    def __exit__(self, *_):
        self._stack.close()

    def start_robots(self, *words):
        names = [str(self.table), "--port", self.port, "--light", self.shines_to, *words]
        self.robots_process = self._start("fake_robots.py", names, stdout=subprocess.PIPE)
        self._stack.callback(self.robots_process.stdout.close)
        return self.robots_process

    def ready(self):
        """Wait until the robots are on their table: their program says so."""
        assert b"robots from port" in self.robots_process.stdout.readline()

    def start_capture(self, *words):
        names = ["--bodies", json.dumps(self.markers), "--light", self.light]
        names += ["--type", self.source["kind"], "--topic", self.source["topic"], *words]
        self.capture_process = self._start("fake_motion_capture.py", names)
        return self.capture_process

    def _start(self, file, words, **options):
        line = [sys.executable, str(FOLDER / file), *map(str, words)]
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        made = subprocess.Popen(line, env=environment, start_new_session=True, **options)
        self._stack.callback(end, made)
        return made


def end(process):
    """SIGTERM, and SIGKILL where that is not enough."""
    if process.poll() is None:
        process.terminate()
        try:
            process.wait(3.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
