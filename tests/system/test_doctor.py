"""Eight mistakes in a lab without hardware, each named by ``planar-push doctor`` within 10 s."""

import subprocess
import sys
import time

import pytest

from push_bringup.suite import Suite
from tests.lab_bridge.stand_in import StandIn

pytestmark = [pytest.mark.live, pytest.mark.long]


def doctor(lab, *words):
    """Exit code and text; it has 10 s from its start to its end, imports included."""
    line = [sys.executable, "-m", "planar_push", "doctor", *words, "--scenario", str(lab.scenario)]
    began = time.monotonic()
    done = subprocess.run(line, capture_output=True, text=True, timeout=10.0)
    print(f"{time.monotonic() - began:.1f} s\n{done.stdout}{done.stderr}")
    return done.returncode, done.stdout


def setting(*path, value):
    def change(values):
        inner = values
        for key in path[:-1]:
            inner = inner[key]
        inner[path[-1]] = value

    return change


def nothing(values):
    """The scenario as it is."""


MISTAKES = {
    "wrong name": (setting("lab", "bodies", "box", "name", value="box"), (), (), "WRONG_NAME", ()),
    "millimetres": (setting("lab", "units", value="m"), (), (), "MILLIMETRES", ()),
    "swapped axes": (setting("lab", "axes", value="z_up"), (), (), "WRONG_AXES", ()),
    "stale clock": (nothing, (), ("--stale-clock",), "STALE_CLOCK", ()),
    "no poses": (nothing, (), ("--blind",), "NO_POSES", ()),
    "robot silent": (nothing, ("--deaf", "epuck1"), (), "ROBOT_SILENT", ()),
    "robot reversed": (nothing, ("--reversed", "epuck1"), (), "ROBOT_REVERSED", ("--drive",)),
}


def started(tmp_path, file, change, robots, capture):
    lab = StandIn(file, tmp_path, change)
    lab.start_robots(*robots)
    lab.start_capture(*capture)
    lab.ready()
    return lab


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named(domain, mistake, tmp_path):
    change, robots, capture, code, words = MISTAKES[mistake]
    lab = started(tmp_path, "lab-single.yaml", change, robots, capture)
    try:
        exit_code, text = doctor(lab, *words)
    finally:
        lab.__exit__()
    errors = [line.split(": ")[1] for line in text.splitlines() if line.startswith("error: ")]
    assert exit_code == 1 and set(errors) == {code}, text


def test_two_publishers_are_named(domain, tmp_path):
    lab = started(tmp_path, "lab-single.yaml", nothing, (), ())
    try:
        lab.start_capture("--light", str(lab.light + 1))  # blind, but it publishes
        exit_code, text = doctor(lab)
    finally:
        lab.__exit__()
    assert exit_code == 1 and "error: TWO_PUBLISHERS: 2 nodes publish on /vrpn/" in text


def test_a_good_lab_is_called_good(domain, tmp_path):
    lab = started(tmp_path, "lab-single.yaml", nothing, (), ())
    try:
        exit_code, text = doctor(lab, "--drive")
    finally:
        lab.__exit__()
    assert exit_code == 0 and "fact: DRIVES: epuck1 drives and turns as commanded" in text
    assert "0 errors" in text
    assert "NO_SUITE" not in text, "with --drive no suite may run"


def test_beside_a_suite_the_bridge_says_how_the_robots_are(domain, tmp_path):
    with StandIn("lab-single.yaml", tmp_path) as lab, Suite(str(lab.scenario)) as suite:
        exit_code, text = doctor(lab)
        assert exit_code == 0 and "fact: CONNECTED: epuck1 answers" in text
        assert suite.monitor().pose is not None
        lab.robots_process.kill()
        suite.monitor().wait(2.5, lambda: False)
        exit_code, text = doctor(lab)
        assert exit_code == 1 and "error: ROBOT_SILENT: epuck1: " in text
        assert "warning: PAUSED" in text
