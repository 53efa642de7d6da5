"""Outlines from where robots have been and were stopped: random objects, noise, and lies."""

import numpy as np
import pytest
from shapely import LinearRing, MultiPoint, Point, Polygon

from push_estimation.outline_estimate import OutlineEstimate
from push_estimation.outline_learner import OutlineLearner
from tests.samples import mostly_long, slice_and_study

R = 0.037  # [m]
NOISE = 1e-3  # [m] of one frame
FRAMES = 5  # in which a robot is seen within one cell


def random_outline(random, notched):
    """Convex, or a star that is not; 0.15 to 0.5 m across, about its centroid."""
    count = int(random.integers(3, 9)) if not notched else 2 * int(random.integers(3, 6))
    angle = np.sort(np.arange(count) + random.uniform(-0.25, 0.25, count)) * 2.0 * np.pi / count
    radius = random.uniform(0.1, 0.22) * random.uniform(0.8, 1.0, count)
    if notched:
        radius[::2] *= random.uniform(0.6, 0.8)
    found = Polygon(radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))
    if not notched:
        found = found.convex_hull
    points = np.array(found.exterior.coords)[:-1] - np.array(found.centroid.coords[0])
    return points if Polygon(points).exterior.is_ccw else points[::-1]


def firsts(outline):
    """First outlines: 20 % too small, 20 % too large, and the disc that holds the object."""
    angle = np.arange(48) * 2.0 * np.pi / 48
    disc = np.hypot(*outline.T).max() * np.column_stack([np.cos(angle), np.sin(angle)])
    return {"-20 %": 0.8 * outline, "+20 %": 1.2 * outline, "disc": disc}


def felt(outline):
    """What robots can feel of an outline: notches that they cannot enter are filled."""
    return Polygon(outline).buffer(R, quad_segs=64).buffer(-R, quad_segs=64)


def line_of_contact(outline, spacing=4e-3):
    """Places ``(n, 2)`` of robots that touch the object."""
    line = Polygon(outline).buffer(R, quad_segs=64).exterior
    at = np.arange(0.0, line.length, spacing)
    return np.array([line.interpolate(s).coords[0] for s in at])


def around(estimate, random, places, contacts=0.2):
    """Robots slide along places; the object stops some of them for half a second, and all that
    head for an estimated line which lies inside of the true one."""
    for _ in range(FRAMES):
        estimate.been(places + NOISE * random.standard_normal(places.shape))
    early = estimate.depth(places) < -4e-3
    for place in places[early | (random.random(len(places)) < contacts)]:
        estimate.stopped(place + (NOISE * random.standard_normal((30, 2))).mean(axis=0))


def error(outline, truth):
    """[m] greatest distance from one line to the other, both ways."""
    return LinearRing(outline).hausdorff_distance(LinearRing(truth.exterior.coords))


@pytest.mark.parametrize("seeds", slice_and_study([range(20), range(20, 80)], 1))
@pytest.mark.parametrize("first", ["disc", "-20 %", "+20 %"])
def test_all_round_any_object_the_outline_is_found(first, seeds):
    """80 objects. The worst errors are at tips sharper than 60 degrees, whose flanks robots feel
    but not their ends."""
    before, after = [], []
    for seed in seeds:
        random = np.random.default_rng(seed)
        outline = random_outline(random, notched=seed % 3 == 0)
        estimate = OutlineEstimate(firsts(outline)[first], R)
        for _ in range(3):
            around(estimate, random, line_of_contact(outline))
            assert estimate.fit()
        before.append(error(firsts(outline)[first], felt(outline)))
        after.append(error(estimate.outline, felt(outline)))
        assert estimate.explored() > 0.97 and estimate.forgotten == 0
    assert np.median(before) > 0.02
    assert np.median(after) < 4.5e-3 and max(after) < 0.01, (np.median(after), max(after))


@pytest.mark.parametrize("seed", range(30))
def test_where_no_robot_has_been_the_first_outline_stays(seed):
    random = np.random.default_rng(seed)
    outline = random_outline(random, notched=False)
    first = firsts(outline)["disc"]
    estimate = OutlineEstimate(first, R)
    places = line_of_contact(outline)
    around(estimate, random, places[places[:, 0] > 0.02])
    assert estimate.fit()
    seen, line = MultiPoint(places[places[:, 0] > 0.02]), LinearRing(estimate.outline)
    far = [Point(p) for p in first if seen.distance(Point(p)) > 0.16]
    assert not far or max(line.distance(p) for p in far) < 0.015
    assert estimate.explored() < 0.85


@pytest.mark.parametrize("seed", range(30))
def test_robots_that_only_pass_make_it_smaller_and_never_larger(seed):
    random = np.random.default_rng(seed)
    outline = random_outline(random, notched=seed % 3 == 0)
    first = firsts(outline)["disc"]
    estimate = OutlineEstimate(first, R)
    estimate.been(line_of_contact(outline)[: int(random.integers(20, 80))])
    assert estimate.fit()
    grown = Polygon(estimate.outline).difference(Polygon(first).buffer(2e-3))
    assert grown.area < 1e-6
    assert Polygon(estimate.outline).area < Polygon(first).area


@pytest.mark.parametrize("seed", range(30))
def test_a_place_where_a_robot_seemed_to_be_stopped_is_dropped_when_others_get_deeper(seed):
    """A robot that something else holds up beside the object."""
    random = np.random.default_rng(seed)
    outline = random_outline(random, notched=False)
    estimate = OutlineEstimate(outline, R)
    places = line_of_contact(outline)
    k = int(random.integers(len(places)))
    off = np.array(Polygon(outline).buffer(R + 0.02).exterior.coords)
    lie = off[np.hypot(*(off - places[k]).T).argmin()]
    estimate.stopped(lie)
    estimate.fit()
    assert error(estimate.outline, felt(outline)) > 0.012
    near = np.linspace(lie, places[k], 8)
    estimate.been(near)
    around(estimate, random, places)
    estimate.fit()
    assert error(estimate.outline, felt(outline)) < 0.01
    assert len(estimate.sightings.contacts) > 3 and estimate.forgotten == 0


@pytest.mark.parametrize("seed", mostly_long(range(20), 5))
def test_what_was_seen_with_a_frozen_pose_is_found_out_and_forgotten(seed):
    """FAULTS: the object moves on, its pose does not; robots seem to go through it."""
    random = np.random.default_rng(seed)
    outline = random_outline(random, notched=False)
    estimate = OutlineEstimate(outline, R)
    places = line_of_contact(outline)
    around(estimate, random, places)
    estimate.fit()
    way = np.linspace(0.0, 0.1, 60)[:, None] * random.uniform(-1.0, 1.0, 2)
    for step in way:
        estimate.been(places[::6] + step)
    estimate.fit()
    for _ in range(3):
        around(estimate, random, places)
        estimate.fit()
    assert estimate.forgotten >= 1
    for _ in range(3):
        around(estimate, random, places)
        estimate.fit()
    assert error(estimate.outline, felt(outline)) < 0.01


def test_without_sightings_it_is_the_first_outline():
    outline = random_outline(np.random.default_rng(1), notched=False)
    estimate = OutlineEstimate(outline, R)
    assert estimate.fit()
    assert np.array_equal(estimate.outline, outline)
    assert estimate.explored() == 0.0


def test_after_the_clock_was_reset_estimates_go_on():
    """Stamps begin at 0 again."""
    outline = random_outline(np.random.default_rng(1), notched=False)
    learner = OutlineLearner(outline, R, 1.0)
    robots = {"a": np.array([0.4, 0.0, 0.0])}

    def estimates(stamps):
        return [learner.frame(t, np.zeros(3), robots, np.zeros((0, 2))) for t in stamps]

    assert sum(estimates(np.arange(100.0, 103.0, 0.02))) == 3
    assert not any(estimates(np.arange(0.0, 3.0, 0.02)))
    learner.interrupted()
    assert sum(estimates(np.arange(0.0, 3.0, 0.02))) == 3
