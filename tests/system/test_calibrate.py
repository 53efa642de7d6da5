"""``planar-push calibrate`` in the lab without hardware: what is wrong in the scenario is found."""

import subprocess
import sys

import numpy as np
import pytest
import yaml

from push_estimation.calibration_file import read_values
from push_model import se2
from tests.lab_bridge.stand_in import StandIn

pytestmark = [pytest.mark.live, pytest.mark.long]


def forget(values):
    """The suite's copy knows nothing of the robot's marker frame, and a wrong bumper."""
    values["lab"]["bodies"]["epuck1"]["offset"] = [0.0, 0.0, 0.0]
    values["robots"]["epuck1"]["bumper"] = {"distance": 0.053}
    values["objects"]["box"]["contact_friction"] = 0.35


def test_offset_bumper_and_frictions_are_found(domain, tmp_path):
    with StandIn("lab-single.yaml", tmp_path, forget) as lab:
        truth = np.array(lab.markers["epuck1"][1:])
        out = tmp_path / "found.yaml"
        words = ["calibrate", "--scenario", str(lab.scenario), "--out", str(out)]
        words += ["--straight", "5", "--curves", "4"]
        line = [sys.executable, "-m", "planar_push", *words]
        done = subprocess.run(line, capture_output=True, text=True, timeout=400.0)
    print(done.stdout, done.stderr)
    assert done.returncode == 0, done.stderr
    found = yaml.safe_load(out.read_text())["robots"]["epuck1"]
    assert np.abs(np.array(found["offset"][:2]) - truth[:2]).max() < 1e-3
    assert abs(se2.wrap(found["offset"][2] - truth[2])) < 0.01
    assert abs(found["bumper_distance"]["value"] - 0.05) < 1e-3
    _, values = read_values(out)
    contact, floor = values["box", "contact_friction"], values["box", "floor_friction"]
    # few pushes, in real time; how often the intervals hold the truth is a study of its own
    assert abs(contact.value - 0.2) < 0.02 and contact.width < 0.08
    assert abs(floor.value - 0.3) < 0.1 and floor.low > 0.1
