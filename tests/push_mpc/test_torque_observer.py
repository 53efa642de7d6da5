"""The estimate of speed and load from poses and wheels, against the model; how wheel states age."""

from dataclasses import replace

import numpy as np
import pytest

from push_model.torque_robot import TorqueRobot
from push_mpc.torque_friction import FrictionTrust, FrictionTrustSettings, wheel_slip
from push_mpc.torque_observer import TorqueObserver, TorqueObserverSettings
from push_mpc.torque_wheels import MAX_AGE, WheelFeed
from push_scenario.scenario import load_scenario

PIONEER = next(iter(load_scenario("pioneer").robots.values()))[0]
ROBOT = TorqueRobot.of(PIONEER)
DT = 0.01


def driven(observer, load, noise, seconds=4.0, wheels=True, sent=None):
    """Estimates less truth ``(n, 7)`` along a slalom with a load, noise [m], [rad] on the poses."""
    random = np.random.default_rng(5)
    q, off = np.array([0.0, 0.0, 0.0, 0.0, 0.0]), []
    observer.correct(q[:3])
    for k in range(round(seconds / DT)):
        torques = (0.5 + 0.3 * np.sin(0.05 * k), 0.5 - 0.3 * np.sin(0.05 * k + 0.4))
        for _ in range(10):
            a, eps = ROBOT.accelerations(q[3], q[4], *torques, load)
            rate = [np.cos(q[2]) * q[3], np.sin(q[2]) * q[3], q[4], a, eps]
            q = q + 0.1 * DT * np.array(rate)
        observer.predict(DT, sent or torques)
        observer.correct(q[:3] + random.normal(0.0, 1.0, 3) * noise)
        if wheels:
            rolling = (q[3] + q[4] * ROBOT.half_track * np.array([-1.0, 1.0])) / ROBOT.radius
            observer.correct_by_wheels(wheel_slip(ROBOT, rolling, observer.v, observer.omega))
        off.append(observer.state - [*q, *load])
    return np.array(off)


@pytest.mark.parametrize("wheels", [True, False])
@pytest.mark.parametrize("load", [(0.0, 0.0), (8.0, -1.2), (4.0, 0.8)])
def test_drag_and_moment_of_what_is_pushed_are_found(load, wheels):
    """With the noise of a motion capture: 0.2 mm, 0.1 degrees; the box needs 8.8 N."""
    observer = TorqueObserver(ROBOT, TorqueObserverSettings(), 0.5)
    off = driven(observer, load, np.array([2e-4, 2e-4, 1.75e-3]), wheels=wheels)[-150:]
    assert np.sqrt((off[:, 3] ** 2).mean()) < 0.012  # [m/s]
    assert np.sqrt((off[:, 4] ** 2).mean()) < (0.06 if wheels else 0.12)  # [rad/s]
    assert abs(off[:, 5].mean()) < 0.5 and off[:, 5].std() < 1.0  # [N]
    assert abs(off[:, 6].mean()) < 0.15 and off[:, 6].std() < 0.4  # [Nm]


def test_without_drifts_no_load_is_estimated():
    settings = replace(TorqueObserverSettings(), drag_drift=0.0, moment_drift=0.0)
    observer = TorqueObserver(ROBOT, settings, 0.5)
    driven(observer, (8.0, -1.0), np.zeros(3))
    assert observer.load == (0.0, 0.0)


def test_torques_that_only_spin_the_wheels_move_nothing_and_are_no_load():
    """It stands against a wall; 5 Nm a wheel are 105 N, of which the floor takes 27."""
    observer = TorqueObserver(ROBOT, TorqueObserverSettings(), 0.5)
    for _ in range(200):
        observer.predict(DT, (5.0, 5.0), slipping=True)
        observer.correct(np.zeros(3))
    assert abs(observer.v) < 0.3 and observer.load == (0.0, 0.0)


def test_however_long_a_wheel_slips_the_estimate_stays_with_the_poses():
    """Covariances stay positive: a robot that skids for ten seconds is still where it is."""
    observer = TorqueObserver(ROBOT, TorqueObserverSettings(), 0.5)
    random = np.random.default_rng(1)
    pose = np.zeros(3)
    for k in range(1000):
        pose = pose + [0.004 * np.cos(0.01 * k), 0.004 * np.sin(0.01 * k), 0.02]
        observer.predict(DT, tuple(random.uniform(-5, 5, 2)), slipping=k % 3 > 0)
        observer.correct(pose + random.normal(0.0, 1e-3, 3))
    turned = (observer.state[2] - pose[2] + np.pi) % (2 * np.pi) - np.pi
    assert np.hypot(*(observer.state[:2] - pose[:2])) < 0.01 and abs(turned) < 0.05
    assert np.linalg.eigvalsh(observer._P).min() > -1e-12


def test_torques_on_their_way_carry_the_estimate_to_now():
    observer = TorqueObserver(ROBOT, TorqueObserverSettings(), 0.5)
    observer.correct(np.zeros(3))
    now = observer.ahead([(0.02, (0.5, 0.5)), (0.02, (0.0, 0.0))])
    a = float(ROBOT.accelerations(0.0, 0.0, 0.5, 0.5)[0])
    assert now[3] == pytest.approx(0.02 * a)
    assert now[0] == pytest.approx(0.5 * a * 0.02**2 + 0.02 * now[3], rel=1e-6)


def test_slip_must_exceed_what_noise_looks_like():
    trust = FrictionTrust(FrictionTrustSettings())
    trust.update(DT, np.array([0.09, 0.0]), noise=0.03)  # three standard deviations
    assert not trust.slipping and trust.part == 1.0
    trust.update(DT, np.array([0.09, 0.0]), noise=0.005)
    assert trust.slipping and trust.part == pytest.approx(2.0**-0.1)
    trust.update(DT, None, noise=0.005)  # wheels that are not known: no slip, no more trust
    assert not trust.slipping and trust.part == pytest.approx(2.0**-0.1)


def test_wheel_states_that_are_late_or_frozen_expire():
    feed, speeds = WheelFeed(), np.array([3.0, 4.0])
    assert feed.at(1.0) is None
    angles = np.array([0.0, 0.0])
    for k in range(10):
        assert feed.take(1.0 + 0.01 * k, angles + 0.01 * k * speeds, speeds + k) == ""
    assert feed.at(1.05)[0] == 8.0  # those of the frame, not the newest
    assert feed.at(1.09 + 0.9 * MAX_AGE) is not None and feed.at(1.09 + 1.1 * MAX_AGE) is None
    # fresh stamps, but the wheels do not turn although they say so
    frozen = angles + 0.09 * speeds
    for k in range(10, 30):
        assert "frozen" in feed.take(1.0 + 0.01 * k, frozen, speeds)
    assert feed.at(1.29) is None
    assert feed.take(1.3, frozen + 0.1, speeds) == "" and feed.at(1.3) is not None
    for k in range(5):  # a wheel that stands may say the same for ever; so may one without angles
        assert feed.take(1.31 + 0.01 * k, frozen + 0.1, np.zeros(2)) == ""
        assert feed.take(1.40 + 0.01 * k, np.zeros(0), speeds) == ""
    assert feed.take(0.5, np.zeros(0), speeds) == ""  # the clock went back
    assert feed.at(0.5) is not None and feed.at(1.4) is None
