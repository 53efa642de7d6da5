import numpy as np
import pytest

from push_model import SettingsError
from sim_bridge.motion_capture import MotionCapture
from sim_bridge.pace import Lockstep, RealTime
from sim_bridge.settings import MotionCaptureSettings, PhysicsSettings, steps_per_tick


def test_noise_has_the_given_spread_and_comes_from_the_seed():
    settings = MotionCaptureSettings(position_noise=2e-4, orientation_noise=2e-3)
    truth = {"a": np.array([1.0, 2.0, 0.5])}

    def run(seed):
        capture = MotionCapture(settings, seed)
        return np.array([capture.observe(k, truth).poses["a"] for k in range(4000)])

    poses = run(3)
    assert poses.std(axis=0) == pytest.approx([2e-4, 2e-4, 2e-3], rel=0.05)
    assert poses.mean(axis=0) == pytest.approx(truth["a"], abs=1e-4)
    assert np.array_equal(poses, run(3)) and not np.array_equal(poses, run(4))


def test_latency_delays_publication_not_the_stamp():
    capture = MotionCapture(MotionCaptureSettings(latency=0.03), 1)
    frames = [capture.observe(k, {"a": np.full(3, float(k))}) for k in range(1, 10)]
    assert frames[:3] == [None] * 3
    for k, frame in enumerate(frames[3:], start=1):
        assert frame.stamp == k and frame.poses["a"][0] == k


def test_dropouts_leave_bodies_out():
    capture = MotionCapture(MotionCaptureSettings(dropout=0.25), 1)
    seen = [
        set(capture.observe(k, {"a": np.zeros(3), "b": np.zeros(3)}).poses) for k in range(4000)
    ]
    assert np.mean(["a" in s for s in seen]) == pytest.approx(0.75, abs=0.03)
    assert {"a"} in seen and {"b"} in seen  # independent per body


def test_rates_must_divide():
    assert steps_per_tick(PhysicsSettings(), MotionCaptureSettings(rate=100.0)) == 10
    with pytest.raises(SettingsError, match="divisor"):
        steps_per_tick(PhysicsSettings(), MotionCaptureSettings(rate=300.0))


def test_lockstep_waits_for_everybody_and_only_for_the_newest_frame():
    lockstep = Lockstep()
    lockstep.expect(7, ["a", "b"], now=1.0)
    lockstep.answer(7, "a")
    lockstep.answer(6, "b")
    assert not lockstep.ready and lockstep.overdue(3.0, 1.0) == ["b"]
    lockstep.answer(7, "b")
    assert lockstep.ready and lockstep.overdue(9.0, 1.0) == []


def test_real_time_pace_catches_up_a_little_and_never_in_a_burst():
    pace = RealTime(0.01, 2.0)  # twice as fast: a tick every 5 ms
    assert pace.due(10.0) == 1
    assert pace.due(10.004) == 0
    assert pace.due(10.0051) == 1
    assert pace.due(10.0201) == 3
    assert pace.due(99.0) == 1 and pace.stalls == 1
    total = sum(pace.due(99.0 + 0.001 * k) for k in range(1, 1001))
    assert total == pytest.approx(200, abs=1)
