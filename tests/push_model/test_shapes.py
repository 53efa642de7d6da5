import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from push_model import SettingsError, ellipse, flower, polygon, rectangle, shape_from_mapping
from push_model.shape_specs import PolygonShape


def test_rectangle_against_textbook():
    r = rectangle(0.3, 0.2)
    assert r.area == pytest.approx(0.06)
    assert r.inertia_per_mass == pytest.approx((0.3**2 + 0.2**2) / 12)
    assert r.inradius == pytest.approx(0.1)
    assert r.circumradius == pytest.approx(math.hypot(0.15, 0.1))
    side = r.sides[0]
    assert side.inward_normal == pytest.approx([1.0, 0.0])
    assert side.distance == pytest.approx(0.15)
    assert side.length == pytest.approx(0.2)


def test_ellipse_against_textbook():
    e = ellipse(0.25, 0.17)
    assert e.area == pytest.approx(math.pi * 0.25 * 0.17, rel=1e-9)
    assert e.inertia_per_mass == pytest.approx((0.25**2 + 0.17**2) / 4, rel=2e-3)
    assert e.sides == () and e.convex


def test_flower_area_and_concavity():
    f = flower(0.2, 0.04, 5)
    assert f.area == pytest.approx(math.pi * (0.2**2 + 0.04**2 / 2), rel=1e-3)
    assert not f.convex


@given(st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), min_size=3, max_size=7))
def test_polygons_are_centred_counterclockwise_or_refused(vertices):
    try:
        shape = polygon(np.array(vertices))
    except SettingsError:
        return
    assert shape.area > 0
    if shape.area < 1e-3:
        return  # too thin for the rounding of a second pass
    again = polygon(shape.outline + 3.0)
    assert np.allclose(again.outline, shape.outline, atol=1e-7)
    assert shape.inertia_per_mass > 0


@pytest.mark.parametrize(
    "bad",
    [
        {},
        {"polygon": {"vertices": [[0, 0], [1, 1]]}},
        {"circle": {"radius": 1}},
        {"rectangle": {"length": -1, "width": 1}},
        {"flower": {"radius": 1, "amplitude": 2, "petals": 5}},
        {"polygon": {"vertices": [[0, 0], [1, 1], [1, 0], [0, 1]]}},
        "box",
        3,
    ],
)
def test_bad_shapes_are_refused(bad):
    with pytest.raises(SettingsError):
        shape_from_mapping(bad)


def segments_meet(a, b, c, d):
    """Whether two closed segments with whole coordinates have a point in common."""

    def turn(p, q, r):
        value = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
        return (value > 0) - (value < 0)

    def between(p, q, r):
        return all(min(p[i], q[i]) <= r[i] <= max(p[i], q[i]) for i in (0, 1))

    signs = turn(a, b, c), turn(a, b, d), turn(c, d, a), turn(c, d, b)
    if signs[0] != signs[1] and signs[2] != signs[3]:
        return True
    ends = zip(signs, ((a, b, c), (a, b, d), (c, d, a), (c, d, b)), strict=True)
    return any(s == 0 and between(*p) for s, p in ends)


@given(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=4, max_size=8))
def test_crossing_sides_are_found_and_sides_on_one_line_are_let_be(vertices):
    n = len(vertices)
    sides = [(vertices[i], vertices[(i + 1) % n]) for i in range(n)]
    crossing = any(
        segments_meet(*sides[i], *sides[j])
        for i in range(n)
        for j in range(i + 2, n)
        if (i, j) != (0, n - 1)
    )
    try:
        polygon(np.array(vertices, dtype=float))
        refused = False
    except SettingsError as error:
        refused = True
        assume("cross" in str(error))  # others repeat a vertex or have no area
    assert refused == crossing


def test_sides_on_one_line_do_not_cross():
    u = [[0, 0], [3, 0], [3, 2], [2, 2], [2, 1], [1, 1], [1, 2], [0, 2]]
    assert polygon(np.array(u)).area == pytest.approx(5.0)
    moved = polygon(np.array(u)).about((0.1, -0.2))
    assert moved.sides[0].distance == pytest.approx(polygon(np.array(u)).sides[0].distance - 0.2)


def test_a_polygon_keeps_the_frame_of_its_corners_where_that_is_asked_for():
    corners = np.array([[0.0, 0.0], [0.2, 0.0], [0.2, 0.1], [0.0, 0.1]])
    assert polygon(corners, moved=False).outline == pytest.approx(corners)
    assert polygon(corners[::-1], moved=False).outline == pytest.approx(corners)
    assert polygon(corners).outline == pytest.approx(corners - [0.1, 0.05])
    vertices = tuple(map(tuple, corners.tolist()))
    assert PolygonShape(vertices, frame="given").shape().outline == pytest.approx(corners)
    with pytest.raises(SettingsError, match="frame"):
        PolygonShape(vertices, frame="corner")
