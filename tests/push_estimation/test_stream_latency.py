"""The latency of a pose stream from commands and motion, with the motion capture of the bridge."""

import numpy as np
import pytest

from push_estimation.stream_latency import LatencySettings, StreamLatency
from push_model.kinematics import unicycle_step
from push_model.settings import SettingsError
from sim_bridge.motion_capture import MotionCapture
from sim_bridge.settings import MotionCaptureSettings
from sim_bridge.world import BodyPoses


def driven(
    latency,
    seed=1,
    seconds=30.0,
    rate=100.0,
    jitter=0.005,
    noise=(2e-4, 0.0017453),
    estimate=None,
    blocked=False,
):
    """A robot that follows a wavy path by feedback from late poses; its commands take effect at
    once. Returns the mean latency that was applied, and the estimate."""
    capture = MotionCapture(
        MotionCaptureSettings(
            rate=rate,
            latency=latency,
            latency_jitter=jitter,
            position_noise=noise[0],
            orientation_noise=noise[1],
        ),
        seed,
    )
    estimate = estimate or StreamLatency(LatencySettings(low=0.02, high=0.1))
    phase = np.random.default_rng(seed).uniform(0.0, 6.0)
    pose, command = np.zeros(3), (0.0, 0.0)
    for k in range(int(seconds * rate)):
        frame = capture.observe(k, BodyPoses(("robot",), pose[None].copy()))
        if frame is not None:
            time, seen = frame.stamp / rate, frame.poses["robot"]
            target = 0.8 * np.sin(1.1 * time + phase)
            command = (0.07 if np.sin(0.7 * time) > -0.5 else 0.0, 1.5 * (target - seen[2]))
            estimate.command(1.0 + time, *command)
            estimate.pose(1.0 + time, seen)
        if not blocked:
            pose = unicycle_step(pose, *command, 1.0 / rate)
    return capture.applied_latency[0], estimate


def test_the_interval_holds_the_latency():
    luck, held, ratios = np.random.default_rng(5), 0, []
    for seed in range(12):
        truth, found = driven(luck.uniform(0.02, 0.1), seed, seconds=20.0)
        i = found.interval()
        held += i.low <= truth <= i.high
        ratios.append(i.width / found.prior.width)
        assert found.strange == 0
    assert held >= 11
    assert np.median(ratios) < 1 / 3


def test_another_latency_widens_the_interval_and_is_learned():
    _, estimate = driven(0.03, seconds=20.0)
    assert estimate.interval().high < 0.05
    estimate.forget()
    truth, estimate = driven(0.08, seconds=40.0, estimate=estimate)
    assert estimate.widened >= 1
    assert estimate.interval().low <= truth <= estimate.interval().high


def test_a_robot_that_is_blocked_tells_nothing():
    _, estimate = driven(0.05, blocked=True)
    assert estimate.interval() == estimate.prior and estimate.strange > 0


def test_what_is_not_finite_is_left_out():
    estimate = StreamLatency()
    for k in range(300):
        estimate.command(1.0 + 0.01 * k, np.nan, 0.1)
        assert estimate.pose(1.0 + 0.01 * k, np.array([0.0, np.inf, 0.0])) is None
    assert estimate.interval() == estimate.prior


def test_the_lag_of_the_robot_is_taken_off():
    _, plain = driven(0.06, seconds=20.0)
    lagging = StreamLatency(LatencySettings(low=0.02, high=0.1, actuation_lag=0.02))
    driven(0.06, seconds=20.0, estimate=lagging)
    assert lagging.interval().value == pytest.approx(plain.interval().value - 0.02, abs=2e-3)
    with pytest.raises(SettingsError, match="two steps"):
        LatencySettings(low=0.1, high=0.1)


def test_without_noise_the_slip_of_the_wheels_decides_nothing():
    """Poses are exact and the robot turns steadily, by 1 % less than it is told, more or less."""
    for seed in range(30):
        draw = np.random.default_rng(seed)
        estimate = StreamLatency(LatencySettings(low=0.0, high=0.15))
        latency, phase = draw.uniform(0.0, 0.1), draw.uniform(0.0, 6.0, 4)
        pose, commands = np.zeros(3), []
        for k in range(2500):
            time = 0.01 * k
            turning = 0.3 + 0.004 * np.sin(1.3 * time + phase[0])
            commands.append((0.1, turning if time % 8.0 < 6.0 else -turning))
            estimate.command(1.0 + time, *commands[-1])
            estimate.pose(1.0 + time, pose.copy())
            v, omega = commands[max(0, k - round(100.0 * latency))]
            slip = 0.99 + 0.002 * np.sin(0.9 * time + phase[1:3])
            pose = unicycle_step(pose, slip[0] * v, slip[1] * omega, 0.01)
        interval = estimate.interval()
        assert interval.low <= round(100.0 * latency) / 100.0 <= interval.high, seed
        assert estimate.widened == 0
