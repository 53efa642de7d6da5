"""Run-time estimates: whether intervals hold and shrink, and what bad input gets."""

import numpy as np
import pytest

from push_estimation.line_push_model import Bumper
from push_estimation.push_estimates import PushEstimates
from push_estimation.push_windows import PushWindows
from push_model import se2
from push_model.belief import Interval
from push_scenario.bodies import load_object, load_robot
from tests.push_estimation.weaving import HARD, NAMES, PRIOR, RATE, weave

BOX, EPUCK = load_object("box9"), load_robot("epuck")
BUMPER = Bumper(EPUCK.push_distance, EPUCK.bumper.width / 2.0)


def test_a_weaving_push_shows_friction_and_centre_of_mass():
    """Seeds 0 to 4; the study ``calibration`` has hundreds."""
    found = [weave(seed) for seed in range(5)]
    assert sum(sum(w.holds().values()) for w in found) >= 13
    ratios = np.array([[w.ratios()[n] for n in NAMES] for w in found])
    assert np.median(ratios, axis=0) == pytest.approx(0.0, abs=1 / 3)
    assert all(w.estimates.push.widened == 0 for w in found)


def test_the_noise_is_estimated_from_the_stream():
    for noise in ((2e-4, 0.0017453), HARD):
        windows, luck = PushWindows(BOX.outline, BUMPER), np.random.default_rng(3)
        for k in range(600):
            at = 0.05 * k / RATE
            pair = np.array([[at, 0.0, 0.0], [at + 0.095, 0.0, 0.0]])
            pair += luck.standard_normal((2, 3)) * [noise[0], noise[0], noise[1]]
            windows.add(k / RATE, *pair)
        # The bumper's middle along the side: both positions, and the object's heading at its arm.
        aside = np.hypot(np.sqrt(2.0) * noise[0], 0.045 * noise[1])
        assert windows.scatter[0] == pytest.approx(aside, rel=0.35)
        assert windows.scatter[1] == pytest.approx(np.sqrt(2.0) * noise[1], rel=0.35)


def test_frozen_poses_say_nothing_of_the_noise():
    windows, luck = PushWindows(BOX.outline, BUMPER), np.random.default_rng(3)
    for k in range(600):
        pair = np.array([[0.05 * k / RATE, 0.0, 0.0], [0.05 * k / RATE + 0.095, 0.0, 0.0]])
        pair += luck.standard_normal((2, 3)) * [2e-4, 2e-4, 0.0017453]
        windows.add(k / RATE, *pair)
    before = windows.scatter
    for k in range(600, 600 + 60 * round(RATE)):
        windows.add(k / RATE, *pair)
    assert windows.scatter == pytest.approx(before, rel=0.1)


def test_without_contact_nothing_counts():
    windows = PushWindows(BOX.outline, BUMPER)
    for k in range(500):
        at = 0.05 * k / RATE  # the object runs away at the same speed, 6 mm ahead
        robot, item = np.array([at, 0.0, 0.0]), np.array([at + 0.107, 0.0, 0.0])
        assert windows.add(k / RATE, robot, item) is None
        assert windows.add(k / RATE + 1e-4, robot, np.array([0.3, 0.3, 0.0])) is None


def _prior(estimates):
    found, prior = estimates.intervals(), estimates.priors()
    return all(found[n] == prior[n] for n in NAMES)


@pytest.mark.parametrize("kind", ["object frozen", "robot frozen", "both frozen", "swapped", "nan"])
def test_poses_that_are_wrong_teach_nothing(kind):
    first = []

    def meddle(world, time, table):
        first.append(table.copy())
        shown = table.copy()
        if kind == "object frozen" or kind == "both frozen":
            shown[1] = first[0][1]
        if kind == "robot frozen" or kind == "both frozen":
            shown[0] = first[0][0]
        if kind == "swapped":
            shown = shown[::-1].copy()
        if kind == "nan":
            shown[1, 2] = np.nan
        return shown

    found = weave(4, way=0.4, meddle=meddle)
    assert _prior(found.estimates)
    latency = found.estimates.intervals()["latency"]
    if kind not in ("robot frozen", "both frozen", "swapped"):
        assert latency.low <= 1e-6  # the truth in this world
    else:
        assert latency == found.estimates.priors()["latency"]


def test_a_stream_that_freezes_in_mid_push_leaves_what_was_learned():
    frozen = []

    def meddle(world, time, table):
        if time < 8.0:
            return table
        frozen.append(table.copy())
        return frozen[0]

    found = weave(2, way=0.8, meddle=meddle)
    assert all(found.holds().values())
    assert found.estimates.push.widened == 0


def test_a_hand_that_drags_the_object_along_the_bumper_is_found_out():
    """The object is pulled sideways for 2 s while the robot pushes; afterwards nobody touches it.

    The truth is held at the end, and somebody was told of what could not be explained.
    """

    def meddle(world, time, table):
        if 6.0 <= time < 8.0:
            poses = world.poses()
            side = np.array([-np.sin(poses["robot"][2]), np.cos(poses["robot"][2])])
            moved = np.array(poses["item"])
            moved[:2] += 0.02 / RATE * side * (1.0 if time < 7.0 else -1.0)
            world.place("item", moved)
        return table

    for seed in (1, 5, 6):
        found = weave(seed, way=1.0, meddle=meddle)
        assert all(found.holds().values()), found.estimates.intervals()
        assert found.estimates.contradictions


def test_another_friction_widens_the_interval_and_is_learned():
    """Somebody wets the bumper: what was believed does not hold any more."""
    truth = {"contact_friction": 0.45, "com_x": 0.004, "com_y": -0.003}
    first = weave(7, truth=truth)
    assert first.holds()["contact_friction"]
    narrow = first.estimates.intervals()["contact_friction"]
    assert narrow.low > 0.3
    first.estimates.interrupted()
    first.estimates.latency.reset()
    other = weave(8, truth={**truth, "contact_friction": 0.15}, estimates=first.estimates)
    assert other.estimates.push.widened >= 1
    assert other.holds()["contact_friction"]
    told = [c for c in other.estimates.contradictions if c.widened]
    assert told and "contradicts" in told[0].sentence
    assert "contact_friction" in told[0].quantities


def test_little_knowledge_leaves_the_value_of_the_file():
    estimates = PushEstimates(EPUCK, BOX, PRIOR)
    believed = estimates.believed()
    assert believed["contact_friction"].value == BOX.contact_friction
    assert (believed["com_x"].value, believed["com_y"].value) == BOX.com
    assert "latency" not in believed
    known = weave(3).estimates
    narrow = known.believed()["contact_friction"]
    assert narrow == known.intervals()["contact_friction"]


@pytest.mark.parametrize(
    ("interval", "value"),
    [
        ((0.13, 0.077, 0.285), 0.13),  # likely to be lower than the 0.2 of the file
        ((0.30, 0.077, 0.50), 0.2),  # not likely
        ((0.40, 0.25, 0.60), 0.25),  # higher for sure: no more than that
        ((0.33, 0.05, 0.66), 0.2),  # about the prior
    ],
)
def test_a_friction_that_is_likely_to_be_lower_is_not_trusted(interval, value, monkeypatch):
    """A box slid off the bumper four times: its friction was 0.08, and the interval, 0.077 to 0.28,
    contained the 0.2 of its file."""
    estimates = PushEstimates(EPUCK, BOX, PRIOR)
    others = estimates.push.intervals()[1:]
    monkeypatch.setattr(estimates.push, "intervals", lambda: (Interval(*interval), *others))
    told = estimates.believed()["contact_friction"]
    assert told == Interval(value, *interval[1:])


def test_a_ring_bumper_has_no_line_contact():
    estimates = PushEstimates(load_robot("epuck_ring"), BOX)
    assert estimates.push is None and set(estimates.intervals()) == {"latency"}
    assert not estimates.frame(1.0, se2.pose(0.0, 0.0, 0.0), se2.pose(0.1, 0.0, 0.0))
