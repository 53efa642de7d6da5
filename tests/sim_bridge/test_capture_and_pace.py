import numpy as np
import pytest

from sim_bridge.motion_capture import MotionCapture
from sim_bridge.pace import Lockstep, RealTime
from sim_bridge.settings import MotionCaptureSettings
from sim_bridge.world import BodyPoses
from sim_bridge.worlds import steps_of


def test_noise_has_the_given_spread_and_comes_from_the_seed():
    settings = MotionCaptureSettings(position_noise=2e-4, orientation_noise=2e-3)
    truth = BodyPoses(("a",), np.array([[1.0, 2.0, 0.5]]))

    def run(seed):
        capture = MotionCapture(settings, seed)
        return np.array([capture.observe(k, truth).poses["a"] for k in range(4000)])

    poses = run(3)
    assert poses.std(axis=0) == pytest.approx([2e-4, 2e-4, 2e-3], rel=0.05)
    assert poses.mean(axis=0) == pytest.approx([1.0, 2.0, 0.5], abs=1e-4)
    assert np.array_equal(poses, run(3)) and not np.array_equal(poses, run(4))


def test_latency_delays_publication_not_the_stamp():
    capture = MotionCapture(MotionCaptureSettings(latency=0.03), 1)
    frames = [
        capture.observe(k, BodyPoses(("a",), np.full((1, 3), float(k)))) for k in range(1, 10)
    ]
    assert frames[:3] == [None] * 3
    for k, frame in enumerate(frames[3:], start=1):
        assert frame.stamp == k and frame.poses["a"][0] == k


def test_dropouts_leave_bodies_out():
    capture = MotionCapture(MotionCaptureSettings(dropout=0.25), 1)
    truth = BodyPoses(("a", "b"), np.zeros((2, 3)))
    seen = [set(capture.observe(k, truth).poses) for k in range(4000)]
    assert np.mean(["a" in s for s in seen]) == pytest.approx(0.75, abs=0.03)
    assert {"a"} in seen and {"b"} in seen  # independent per body


@pytest.mark.parametrize("rate", [25.0, 30.0, 60.0, 77.0, 100.0, 120.0, 144.0, 240.0, 1000.0])
def test_a_tick_of_any_rate_is_a_whole_number_of_steps_that_are_short_enough(rate):
    steps = steps_of(1.0 / rate, 1e-3)
    assert 1.0 / rate / steps <= 1e-3 * (1.0 + 1e-9)
    assert steps == 1 or 1.0 / rate / (steps - 1) > 1e-3
    if 1000.0 % rate == 0.0:
        assert 1.0 / rate / steps == 1e-3


def test_lockstep_waits_for_everybody_and_only_for_the_newest_frame():
    lockstep = Lockstep(3)
    lockstep.expect(7, np.array([True, True, False]), now=1.0)
    lockstep.answer(7, np.array([0]))
    lockstep.answer(6, np.array([1]))
    assert not lockstep.ready and lockstep.waiting.tolist() == [1]
    assert not lockstep.due_to_tell(1.5, 1.0)
    assert [lockstep.due_to_tell(t, 1.0) for t in (3.0, 4.0, 1e6)] == [True, False, False]
    assert not lockstep.ready and lockstep.waiting.tolist() == [1]  # for any time
    lockstep.answer(7, np.array([1, 2]))
    assert lockstep.ready and not lockstep.due_to_tell(9.0, 1.0)
    lockstep.expect(8, np.array([False, False, True]), now=9.0)
    assert not lockstep.ready
    lockstep.release(np.array([2]))  # it has gone
    assert lockstep.ready


def test_real_time_pace_catches_up_a_little_and_never_in_a_burst():
    pace = RealTime(0.01, 2.0)  # twice as fast: a tick every 5 ms
    assert pace.due(10.0) == 1
    assert pace.due(10.004) == 0
    assert pace.due(10.0051) == 1
    assert pace.due(10.0201) == 3
    assert pace.due(99.0) == 1 and pace.stalls == 1
    total = sum(pace.due(99.0 + 0.001 * k) for k in range(1, 1001))
    assert total == pytest.approx(200, abs=1)


@pytest.mark.parametrize(
    ("rate", "latency", "ticks"),
    [(100.0, 0.0, 0), (100.0, 0.01, 1), (30.0, 0.01, 1), (60.0, 0.05, 3), (240.0, 0.01, 3)],
)
def test_a_frame_comes_out_at_the_first_tick_at_which_its_latency_has_passed(rate, latency, ticks):
    capture = MotionCapture(MotionCaptureSettings(rate=rate, latency=latency), 1)
    assert capture.delay == ticks and ticks / rate >= latency - 1e-9
    assert ticks == 0 or (ticks - 1) / rate < latency


def test_noise_of_a_body_does_not_depend_on_who_else_is_there():
    settings = MotionCaptureSettings(position_noise=1e-3, orientation_noise=1e-2, dropout=0.2)
    many = BodyPoses(tuple(f"d{i}" for i in range(1000)), np.zeros((1000, 3)))
    few = BodyPoses(("d7", "other"), np.zeros((2, 3)))
    left = BodyPoses(many.names[5:], many.table[5:])  # some are removed in between
    crowd, pair = MotionCapture(settings, 5), MotionCapture(settings, 5)
    values = []
    for k in range(200):
        a = crowd.observe(k, many if k < 90 else left).poses
        b = pair.observe(k, few).poses
        assert ("d7" in a) == ("d7" in b)
        if "d7" in a:
            assert np.array_equal(a["d7"], b["d7"])
        values.append(len(a) / (1000 if k < 90 else 995))
    assert np.mean(values) == pytest.approx(0.8, abs=0.01)


def test_hidden_bodies_are_not_seen_until_their_time():
    capture = MotionCapture(MotionCaptureSettings(), 1)
    truth = BodyPoses(("a", "b"), np.zeros((2, 3)))
    capture.hide(["b"], 5)
    seen = ["b" in capture.observe(k, truth).poses for k in range(1, 8)]
    assert seen == [False] * 4 + [True] * 3
