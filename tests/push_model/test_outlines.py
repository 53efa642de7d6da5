import math

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from push_model import se2
from push_model.outlines import (
    cells_hit,
    convex_hull,
    distance,
    inside,
    inside_convex,
    overlap,
    overlaps_disc,
)

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
L_SHAPE = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=float)


def test_hull_against_another_library():
    random = np.random.default_rng(1)
    for _ in range(200):
        points = random.normal(size=(int(random.integers(3, 40)), 2))
        hull = convex_hull(points)
        expected = points[ConvexHull(points).vertices]
        first = int(np.argmin(np.abs(expected - hull[0]).sum(axis=1)))
        assert np.array_equal(np.roll(expected, -first, axis=0), hull)
    grid = np.stack(np.meshgrid(range(4), range(3)), axis=-1).reshape(-1, 2)
    assert convex_hull(grid).tolist() == [[0, 0], [3, 0], [3, 2], [0, 2]]  # no corner in a line


def test_inside_and_distance_of_a_concave_outline():
    points = np.array([[0.5, 0.5], [1.5, 0.5], [0.5, 1.5], [1.5, 1.5], [-1, 0.5], [1.2, 1.1]])
    assert inside(L_SHAPE, points).tolist() == [True, True, True, False, False, False]
    assert inside(L_SHAPE[::-1], points).tolist() == inside(L_SHAPE, points).tolist()
    expected = [0.5, 0.5, 0.5, 0.5, 1.0, 0.1]
    assert distance(L_SHAPE, points) == pytest.approx(expected)
    assert inside_convex(SQUARE, points, 0.4).tolist() == [True] + [False] * 5


@pytest.mark.parametrize(
    ("move", "meets"),
    [
        ((0.0, 0.0, 0.0), True),  # the very same
        ((1.0, 0.0, 0.0), False),  # edge on edge
        ((1.0, 1.0, 0.0), False),  # corner on corner
        ((0.999, 0.0, 0.0), True),
        ((0.3, 0.2, 0.4), True),
        ((1.5, 0.0, math.pi / 4), True),
        ((1.75, -0.2, math.pi / 4), False),
    ],
)
def test_squares_overlap_or_touch(move, meets):
    other = se2.transform(np.array(move), SQUARE)
    assert overlap(SQUARE, other) == overlap(other, SQUARE) == meets


def test_one_outline_within_another_and_within_a_recess():
    small = 0.2 * SQUARE
    assert overlap(L_SHAPE, small + 0.3) and overlap(small + 0.3, L_SHAPE)
    assert not overlap(L_SHAPE, small + 1.4) and not overlap(L_SHAPE, 0.9 * SQUARE + 1.0)
    assert overlap(L_SHAPE, 0.9 * SQUARE + 0.95)
    assert overlap(L_SHAPE, L_SHAPE)
    cross = np.array([[-1.0, 0.4], [3.0, 0.4], [3.0, 0.6], [-1.0, 0.6]])
    assert overlap(SQUARE, cross)  # no corner of either in the other


def test_discs():
    assert overlaps_disc(SQUARE, np.array([0.5, 0.5]), 0.01)
    assert overlaps_disc(SQUARE, np.array([1.1, 0.5]), 0.11)
    assert not overlaps_disc(SQUARE, np.array([1.1, 0.5]), 0.1)
    assert not overlaps_disc(L_SHAPE, np.array([1.5, 1.5]), 0.49)


def test_cells_against_the_overlap_of_their_squares():
    random = np.random.default_rng(5)
    corners = 0.1 * np.stack(np.meshgrid(range(-25, 25), range(-25, 25)), axis=-1).reshape(-1, 2)
    hits = 0
    for _ in range(8):
        pose = random.uniform([-1, -1, -3], [1, 1, 3])
        outline = se2.transform(pose, 0.7 * L_SHAPE)
        hit = cells_hit(outline, corners, 0.1)
        expected = [overlap(outline, c + 0.1 * SQUARE) for c in corners]
        assert hit.tolist() == expected
        hits += int(hit.sum())
    assert hits > 500
