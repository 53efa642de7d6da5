"""A calibration whose motion capture is interrupted, on the clock of the wall."""

import time
from types import SimpleNamespace

import numpy as np
import pytest

from lab_bridge.calibration_rig import LabRig, RigFailed
from lab_bridge.marker_mapping import Marker, MarkerMapping
from lab_bridge.observation import Observer
from push_scenario.scenario import load_scenario
from tests.lab_bridge.stand_in import FOLDER

pytestmark = pytest.mark.live
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])


class Interrupted(Observer):
    """An observer without a graph: poses every 8 ms, but for the holes (from, to) [s]."""

    def __init__(self, *holes):
        self.scenario = load_scenario(str(FOLDER / "lab-single.yaml"))
        self.lab = self.scenario.lab
        self.bodies = (*self.scenario.robots, *self.scenario.objects)
        self._mapping = MarkerMapping(self.lab, self.bodies)
        self.samples, self.commands, self.holes = [], [], holes
        self.robots = {"epuck1": SimpleNamespace(trouble="")}
        self.begun = time.monotonic()
        for _ in range(20):
            self.show()

    def show(self):
        for marker in self._mapping.bodies:
            self.part(marker, Marker(np.zeros(3), UPRIGHT), time.time())

    def poll(self):
        time.sleep(0.008)
        now = time.monotonic() - self.begun
        if not any(begin <= now < end for begin, end in self.holes):
            self.show()

    def command(self, robot, v, omega):
        self.commands.append((time.monotonic() - self.begun, v, omega))


@pytest.fixture
def rig():
    def made(*holes):
        observer = Interrupted(*holes)
        return observer, LabRig(observer, "epuck1", "box")

    return made


def test_a_short_hole_is_a_hole_in_the_track(rig):
    observer, lab = rig((0.2, 0.5))
    for _ in range(6):  # short runs, as on the way back
        lab.run(0.03, 0.0, 0.05)
        assert lab.robot.shape == lab.item.shape == (3,)
    track = lab.run(0.04, 0.0, 0.7)
    assert [v for _, v, _ in observer.commands] == [*[0.03] * 6, 0.04]
    assert track.time[-1] - track.time[0] == pytest.approx(0.5, abs=0.1)


def test_the_robot_stands_until_poses_are_back(rig):
    observer, lab = rig((0.3, 1.5))
    track = lab.run(0.05, 0.0, 1.2)
    (_, driven, _), (stopped, nothing, _) = observer.commands
    assert (driven, nothing) == (0.05, 0.0) and stopped == pytest.approx(0.7, abs=0.1)
    assert time.monotonic() - observer.begun == pytest.approx(1.7, abs=0.15)
    assert np.diff(track.time).max() > 1.0
    lab.run(0.05, 0.0, 0.1)
    assert observer.commands[-1][1] == 0.05


def test_poses_that_stay_away_end_the_calibration(rig, monkeypatch):
    monkeypatch.setattr("lab_bridge.calibration_rig._AWAY", 0.5)
    observer, lab = rig((0.1, 60.0))
    with pytest.raises(RigFailed, match="no usable poses of 'epuck1' arrive"):
        lab.run(0.05, 0.0, 5.0)
    assert observer.commands[-1][1] == 0.0
