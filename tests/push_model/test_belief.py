"""Beliefs: intervals, what they change, and what cannot be believed."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from push_model.belief import POSES, QUANTITIES, Belief, BeliefError, Interval
from push_scenario.bodies import load_object, load_robot

BOX, ROBOT = load_object("box9"), load_robot("epuck")
FILES = Belief({"box": BOX}, {"e": ROBOT})


def test_what_nobody_says_is_as_the_files_have_it():
    assert FILES.object("box") is BOX and FILES.robot("e") is ROBOT
    assert FILES.interval("box", "mass") == Interval.exact(BOX.mass)
    assert FILES.latency == Interval.exact(0.0)
    assert FILES.interval("e", "wheel_friction").value == ROBOT.drive.wheel_friction


def test_values_reach_the_object_the_robot_and_the_limit_surface():
    told = FILES.updated(
        {
            ("box", "mass"): Interval(0.2, 0.1, 0.3),
            ("box", "floor_friction"): Interval(0.5, 0.4, 0.6),
            ("box", "com_x"): Interval(0.01, 0.0, 0.02),
            ("e", "wheel_friction"): Interval(0.7, 0.6, 0.8),
            (POSES, "latency"): Interval(0.03, 0.02, 0.04),
        }
    )
    box = told.object("box")
    assert (box.mass, box.floor_friction, box.com) == (0.2, 0.5, (0.01, 0.0))
    assert box.limit_surface().max_force == pytest.approx(0.2 * 0.5 * 9.81)
    assert told.robot("e").drive.wheel_friction == 0.7 and told.latency.width == pytest.approx(0.02)
    assert FILES.object("box") is BOX, "the belief before is as it was"
    assert told != FILES and told == FILES.updated(told.values)


def test_an_outline_replaces_the_shape():
    square = 0.1 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    told = FILES.updated({}, {"box": square})
    assert told.object("box").outline == pytest.approx(square)
    for wrong in (square[:2], square * math.nan, square[[0, 2, 1, 3]]):
        with pytest.raises(BeliefError):
            FILES.updated({}, {"box": wrong})


def test_an_outline_stays_where_it_is_in_the_frame_of_the_object():
    """Motion capture gives poses of that frame, wherever the centroid of the outline is."""
    random = np.random.default_rng(1)
    angle = np.arange(7) * 2.0 * np.pi / 7
    for _ in range(50):
        radius = random.uniform(0.05, 0.2, (7, 1))
        outline = radius * np.column_stack([np.cos(angle), np.sin(angle)])
        told = FILES.updated({}, {"box": outline}).object("box")
        assert np.array_equal(told.outline, outline)
        assert told.mass_pose(np.array([1.0, 2.0, 0.5])) == pytest.approx([1.0, 2.0, 0.5])


@pytest.mark.parametrize(
    ("body", "quantity", "ends", "why"),
    [
        ("box", "charm", (1.0, 1.0, 1.0), "unknown quantity"),
        ("nobody", "mass", (1.0, 1.0, 1.0), "unknown object"),
        ("nobody", "wheel_friction", (1.0, 1.0, 1.0), "unknown robot"),
        ("box", "latency", (0.1, 0.1, 0.1), "pose stream"),
        ("box", "mass", (0.2, -1.0, 0.3), "outside"),
        ("box", "contact_friction", (0.2, 0.1, 9.0), "outside"),
        ("box", "com_x", (0.5, 0.5, 0.5), "tip over"),
    ],
)
def test_what_cannot_be_is_refused_with_the_reason(body, quantity, ends, why):
    with pytest.raises(BeliefError, match=why):
        FILES.updated({(body, quantity): Interval(*ends)})


@given(st.lists(st.floats(), min_size=3, max_size=3))
def test_an_interval_holds_its_value_or_is_none(ends):
    value, low, high = ends
    if all(map(math.isfinite, ends)) and low <= value <= high:
        assert Interval(value, low, high).width >= 0.0
    else:
        with pytest.raises(BeliefError):
            Interval(value, low, high)


def test_a_table_has_a_row_for_each_quantity_of_objects_and_of_the_poses():
    rows = FILES.rows()
    assert {q for _, q, _, _ in rows} == {k for k, q in QUANTITIES.items() if q.kind != "robot"}
