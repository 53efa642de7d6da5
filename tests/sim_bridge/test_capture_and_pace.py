import math

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


def straight(rate, speed=0.3, turn=2.0):
    """Truth at tick k: along x at a speed [m/s], turning [rad/s] through the seam at pi."""

    def at(tick):
        t = tick / rate
        theta = np.pi - (np.pi - turn * t) % (2.0 * np.pi)
        return BodyPoses(("a", "b"), np.array([[speed * t, 0.0, theta], [1.0, 2.0, 0.5]]))

    return at


@pytest.mark.parametrize("rate", [30.0, 60.0, 77.0, 100.0, 240.0])
@pytest.mark.parametrize("latency", [0.0, 0.0123, 0.02, 0.0437, 0.06])
def test_latency_is_what_is_asked_for_at_any_rate(rate, latency):
    """The age of every frame, and the pose of its instant, from the exact motion."""
    capture = MotionCapture(MotionCaptureSettings(rate=rate, latency=latency), 1)
    truth, frames = straight(rate), 0
    for tick in range(1, 300):
        frame = capture.observe(tick, truth(tick))
        if frame is None:
            assert tick < latency * rate + 1.0  # nothing is known of before the first tick
            continue
        frames += 1
        assert (tick - frame.stamp) / rate == pytest.approx(latency, abs=1e-8)
        seconds = frame.stamp / rate
        assert frame.poses["a"][0] == pytest.approx(0.3 * seconds, abs=1e-9)
        assert math.remainder(frame.poses["a"][2] - 2.0 * seconds, math.tau) == pytest.approx(
            0.0, abs=1e-9
        )
        assert abs(frame.poses["a"][2]) <= np.pi
    assert frames >= 299 - latency * rate - 1.0
    assert capture.applied_latency == pytest.approx((latency, 0.0), abs=1e-7)


@pytest.mark.parametrize("jitter", [0.004, 0.02, 0.04])
def test_jitter_spreads_the_latency_and_no_frame_overtakes(jitter):
    """Uniform: its standard deviation is the half width over the root of three."""
    settings = MotionCaptureSettings(rate=60.0, latency=0.04, latency_jitter=jitter)

    def run(seed):
        capture, truth = MotionCapture(settings, seed), straight(60.0)
        frames = [(k, capture.observe(k, truth(k))) for k in range(1, 4000)]
        return capture, [(k, f) for k, f in frames if f is not None]

    capture, frames = run(7)
    stamps = np.array([f.stamp for _, f in frames])
    ages = np.array([(k - f.stamp) / 60.0 for k, f in frames])
    assert np.diff(stamps).min() > 0.0 and ages.min() >= 0.0 and ages.max() <= 0.04 + jitter
    assert np.array([f.poses["a"][0] for _, f in frames]) == pytest.approx(0.3 * stamps / 60.0)
    assert capture.applied_latency == pytest.approx((ages.mean(), ages.std()), rel=1e-9)
    if 2.0 * jitter < 1.0 / 60.0:  # none can overtake: the distribution is untouched
        assert ages.mean() == pytest.approx(0.04, abs=2e-4)
        assert ages.std() == pytest.approx(jitter / np.sqrt(3.0), rel=0.03)
    again, other = run(7)[1], run(8)[1]
    assert [f.stamp for _, f in again] == stamps.tolist() != [f.stamp for _, f in other]


def test_a_body_that_is_removed_between_two_ticks_is_not_seen_after_its_end():
    capture = MotionCapture(MotionCaptureSettings(rate=100.0, latency=0.005), 1)
    truth = straight(100.0)
    names = []
    for tick in range(1, 10):
        poses = truth(tick)
        if tick >= 5:
            poses = BodyPoses(("a",), poses.table[:1])
        frame = capture.observe(tick, poses)
        names.append(None if frame is None else frame.poses.names)
    assert names == [None, *[("a", "b")] * 3, *[("a",)] * 5]


def test_what_is_hidden_is_hidden_from_its_instant_on_not_from_its_publication():
    capture = MotionCapture(MotionCaptureSettings(rate=100.0, latency=0.025), 1)
    truth, seen = straight(100.0), {}
    for tick in range(1, 20):
        if tick == 6:
            capture.hide(["b"], 10)
        frame = capture.observe(tick, truth(tick))
        if frame is not None:
            seen[frame.stamp] = "b" in frame.poses
    assert [s for s, there in seen.items() if not there] == [5.5, 6.5, 7.5, 8.5, 9.5]


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
