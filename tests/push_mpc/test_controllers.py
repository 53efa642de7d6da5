"""A new predictive controller is a file and a line: nothing else knows which one it is."""

import numpy as np
import pytest

from push_model import DifferentialDrive, line, unicycle_step
from push_model.settings import SettingsError, bounded, from_mapping, settings
from push_mpc import (
    CONTROLLERS,
    ControllerKind,
    MpcResult,
    Task,
    TrackError,
    TrackerSettings,
    TrajectoryTracker,
    controller_kind,
)

DRIVE = DifferentialDrive(0.0205, 0.0265, 6.28)


@settings
class GainSettings:
    gain: float = bounded(3.0, low=0.1, high=10.0, doc="[1/s] of the speed errors")


class GainController:
    """Not predictive at all, and yet the tracker drives a line with it."""

    horizon, step, max_obstacles = 1, 0.1, 0

    def __init__(self, settings, drive):
        self.settings, self.drive = settings, drive

    def solve(self, error, reference, contact, circles):
        k = self.settings.gain
        turn = -k * (4.0 * k * error[1] + 2.0 * k * error[2] + error[4])
        return MpcResult((-k * (k * error[0] + error[3]), turn), True, 0.0, 0.0, "")

    def warm_up(self):
        pass

    def reset(self):
        pass


def test_a_registered_controller_is_made_by_its_name(monkeypatch):
    monkeypatch.setitem(CONTROLLERS, "gain", ControllerKind(GainSettings, GainController))
    kind = controller_kind("gain")
    tracker = TrajectoryTracker(
        TrackerSettings(), kind.make(from_mapping(kind.settings, {"gain": 2.0}), DRIVE)
    )
    tracker.start(Task(line(np.zeros(3), 0.3, 0.07, 0.05), None, np.zeros((0, 3)), 0.006, 0.03))
    robot = np.array([0.0, 0.003, 0.0])
    for _ in range(2000):
        tick = tracker.tick(0.01, robot, None)
        if tick.finished:
            break
        robot = unicycle_step(robot, tick.v, tick.omega, 0.01)
    assert tick.finished and tick.code is TrackError.NONE, tick.message
    assert robot[:2] == pytest.approx([0.3, 0.0], abs=6e-3)


OUTSIDE = ControllerKind(GainSettings, GainController)


def test_a_controller_from_outside_is_named_by_its_module():
    assert controller_kind(f"{__name__}:OUTSIDE") is OUTSIDE
    with pytest.raises(SettingsError, match="controller: 'nowhere:X': No module named 'nowhere'"):
        controller_kind("nowhere:X")
    with pytest.raises(SettingsError, match="which is no ControllerKind"):
        controller_kind(f"{__name__}:GainController")


def test_every_controller_offers_what_the_tracker_asks_for():
    for name, kind in CONTROLLERS.items():
        controller = kind.make(kind.settings(), DRIVE)
        controller.warm_up()
        assert controller.horizon >= 1 and controller.step > 0.0, name
        assert controller.max_obstacles >= 0 and controller.drive is DRIVE


def test_an_unknown_controller_is_refused_with_those_that_there_are():
    with pytest.raises(SettingsError, match="'pid'; expected one of: contact_force, ltv"):
        controller_kind("pid")
