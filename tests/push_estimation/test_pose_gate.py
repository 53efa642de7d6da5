import math

import numpy as np
import pytest

from push_estimation.pose_gate import PoseGate, PoseGateSettings, Stamp


def feed(tracker, stamp, pose):
    verdict = tracker.begin(stamp)
    if verdict is Stamp.REFUSED:
        return None
    return tracker.accept("a", np.array(pose, dtype=float))


def test_stamp_policy():
    """FAULTS 10 and 12."""
    t = PoseGate()
    assert t.begin(0.0) is Stamp.REFUSED and t.begin(math.nan) is Stamp.REFUSED
    assert t.begin(5.0) is Stamp.OK
    assert t.begin(5.0) is Stamp.REFUSED and t.begin(4.99) is Stamp.REFUSED
    assert t.begin(5.01) is Stamp.OK
    assert t.begin(6.0) is Stamp.RESUMED
    t.accept("a", np.zeros(3))
    assert [t.begin(1.0 + 0.01 * k) for k in range(2)] == [Stamp.REFUSED] * 2
    assert t.begin(1.02) is Stamp.RESET and t.pose("a") is None
    assert t.begin(1.03) is Stamp.OK


@pytest.mark.parametrize("wild", [0.5, 1e9, 4e3, 3.0])
def test_one_wild_stamp_is_refused_and_no_reset(wild):
    """FAULTS 25: now and then, for as long as one likes."""
    t = PoseGate()
    for k in range(1, 400):
        assert feed(t, 100.0 + 0.01 * k, [0.001 * k, 0, 0]), k
        if k % 5 < 2:
            assert t.begin(wild) is Stamp.REFUSED
            assert t.pose("a")[0] == 0.001 * k
    assert t.begin(100.0 + 0.01 * 400) is Stamp.OK


def test_random_wild_stamps_never_reset_nor_move_the_clock():
    random = np.random.default_rng(1)
    t = PoseGate()
    assert t.begin(50.0) is Stamp.OK
    now = 50.0
    for _ in range(3000):
        if random.random() < 0.3:
            wild = float(random.choice([random.uniform(-10, 49.4), random.uniform(80, 1e6), 1e-9]))
            verdict = t.begin(wild)
            assert verdict is Stamp.REFUSED, wild
        else:
            now += 0.01
            assert t.begin(now) in (Stamp.OK, Stamp.RESUMED)
            assert t.stamp == now


def test_a_stream_that_stays_ahead_is_believed():
    t = PoseGate()
    assert t.begin(1.0) is Stamp.OK
    verdicts = [t.begin(500.0 + 0.01 * k) for k in range(4)]
    assert verdicts == [Stamp.REFUSED] * 2 + [Stamp.RESUMED, Stamp.OK]


def test_only_wanted_bodies_are_kept():
    t = PoseGate(bodies=["a"])
    for k in range(1000):
        t.begin(1.0 + 0.01 * k)
        assert not t.accept(f"stranger{k}", np.zeros(3))
        assert t.accept("a", np.zeros(3))
    assert set(t._bodies) == {"a"}


def test_nan_is_refused_and_changes_nothing():
    t = PoseGate()
    assert feed(t, 1.0, [1, 2, 3])
    assert feed(t, 1.01, [math.nan, 2, 3]) is False
    assert t.refused == 1 and t.pose("a") == pytest.approx([1, 2, 3])
    assert t.age("a") == pytest.approx(0.01)


def test_pose_goes_stale():
    t = PoseGate()
    feed(t, 1.0, [0, 0, 0])
    t.begin(1.1)
    assert t.pose("a") is not None
    t.begin(1.2)
    assert t.pose("a") is None


def test_jump_is_gated_until_it_persists():
    """FAULTS 9: never chased, accepted only after it persists."""
    t = PoseGate(PoseGateSettings(persistence=10))
    feed(t, 1.0, [0, 0, 0])
    accepted = [feed(t, 1.0 + 0.01 * k, [1.0, 0, 0]) for k in range(1, 11)]
    assert accepted == [False] * 9 + [True]
    assert t.pose("a")[0] == 1.0 and t.jumps == 10


def test_single_outliers_never_get_in():
    t = PoseGate()
    random = np.random.default_rng(0)
    for k in range(500):
        outlier = k % 3 == 1
        pose = random.uniform(-1, 1, 3) if outlier else [0.0005 * k, 0, 0]
        ok = feed(t, 1.0 + 0.01 * k, pose)
        if not outlier:
            assert ok
        held = t.pose("a")
        assert abs(held[0] - 0.0005 * k) < 0.2 and abs(held[1]) < 0.15


def test_ordinary_motion_with_noise_is_never_gated():
    t = PoseGate()
    random = np.random.default_rng(0)
    for k in range(1000):
        x = 0.13 * 0.01 * k
        noise = random.normal(size=3) * [2e-4, 2e-4, 2e-3]
        assert feed(t, 1.0 + 0.01 * k, np.array([x, 0, 0.04 * k]) + noise)
