"""Outlines against cells and against each other: brute force on hundreds of random cases."""

import numpy as np
import pytest

from push_model import se2
from push_model.occupancy import OccupancyGrid
from push_model.shapes import polygon, rectangle
from push_planner import DistanceField, PlannerSettings, PushScene
from push_supervisor.footprint import gap, overlaps

L_SHAPE = polygon(np.array([[0, 0], [0.2, 0], [0.2, 0.08], [0.08, 0.08], [0.08, 0.2], [0, 0.2]]))
SHAPES = [rectangle(0.09, 0.09).outline, rectangle(0.3, 0.04).outline, L_SHAPE.outline]


def inside(outline, points):
    """Winding numbers, one point at a time."""
    found = []
    for p in points:
        a = outline - p
        b = np.roll(a, -1, axis=0)
        turn = np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1)).sum()
        found.append(abs(turn) > np.pi)
    return np.array(found)


def random_map(random):
    """Few cells, walls all round."""
    occupied = random.random((30, 40)) < random.uniform(0.0, 0.02)
    occupied[[0, -1]] = True
    occupied[:, [0, -1]] = True
    return OccupancyGrid(occupied, 0.02, np.array([-0.4, -0.3]))


def dense(points, count):
    return np.vstack(
        [
            a + np.linspace(0.0, 1.0, count)[:, None] * (b - a)
            for a, b in zip(points, np.roll(points, -1, axis=0), strict=True)
        ]
    )


def test_overlap_with_cells_against_brute_force():
    """Points of the outline and of the area, and the corners of cells, looked up one by one."""
    random = np.random.default_rng(1)
    hits = 0
    for _ in range(250):
        grid, outline = random_map(random), SHAPES[random.integers(3)]
        pose = np.array([*random.uniform([-0.35, -0.25], [0.35, 0.25]), random.uniform(-4, 4)])
        points = se2.transform(pose, outline)
        rows, columns = np.nonzero(grid.occupied)
        low = grid.origin + np.column_stack([columns, rows]) * grid.resolution
        edge = dense(points, 200)
        deepest = np.inf  # [m] from the closed squares to the outline, sampled from above
        for corner in low[np.hypot(*(low - pose[:2]).T) < 0.35]:
            beyond = np.maximum(np.maximum(corner - edge, edge - corner - grid.resolution), 0.0)
            deepest = min(deepest, float(np.hypot(*beyond.T).min()))
            if deepest > 0.0 and inside(points, [corner + 0.5 * grid.resolution])[0]:
                deepest = 0.0
        outside = (np.abs(points) >= [0.4, 0.3]).any()
        answer = overlaps(grid, outline, pose)
        hits += answer
        if outside or deepest == 0.0:
            assert answer
        elif deepest > 0.002:  # beyond what counts as touching, and the sampling
            assert not answer
    assert 100 < hits < 230


def test_never_laxer_than_the_planner(robot, box):
    """A goal that passes the door is no goal that the planner finds occupied."""
    random = np.random.default_rng(2)
    refused = 0
    for _ in range(30):
        grid = random_map(random)
        scene = PushScene(DistanceField(grid), robot, box, PlannerSettings())
        for _ in range(30):
            pose = np.array([*random.uniform([-0.5, -0.4], [0.5, 0.4]), random.uniform(-4, 4)])
            if scene.object_clearance(pose) <= 0.0:
                refused += 1
                assert overlaps(grid, box.outline, pose)
    assert refused > 200


def test_a_pillar_inside_the_outline_is_an_overlap():
    occupied = np.zeros((101, 101), dtype=bool)
    occupied[50, 50] = True
    grid = OccupancyGrid(occupied, 0.01, np.array([-0.505, -0.505]))
    assert overlaps(grid, rectangle(0.4, 0.4).outline, np.zeros(3))
    assert not overlaps(grid, rectangle(0.4, 0.4).outline, np.array([0.3, 0.0, 0.0]))
    # in the notch of an L nothing is touched
    assert not overlaps(grid, L_SHAPE.outline, np.array([-0.08, -0.08, 0.0]))


def test_gap_against_dense_points():
    random = np.random.default_rng(3)
    touching = 0
    for _ in range(200):
        first, second = SHAPES[random.integers(3)], SHAPES[random.integers(3)]
        a = np.array([0.0, 0.0, random.uniform(-4, 4)])
        b = np.array([*random.uniform(-0.25, 0.25, 2), random.uniform(-4, 4)])
        p, q = se2.transform(a, first), se2.transform(b, second)
        away = dense(p, 40)[:, None] - dense(q, 40)[None]
        sampled = float(np.hypot(away[..., 0], away[..., 1]).min())
        if inside(p, dense(q, 12)).any() or inside(q, dense(p, 12)).any():
            sampled = 0.0
        found = gap(first, a, second, b)
        touching += found == 0.0
        assert found == pytest.approx(gap(second, b, first, a), abs=1e-12)
        assert found == pytest.approx(sampled, abs=6e-3) and found <= sampled + 1e-12
    assert 40 < touching < 170


def test_a_cross_of_two_bars_touches_though_no_corner_is_inside():
    bar = rectangle(0.3, 0.04).outline
    assert gap(bar, np.zeros(3), bar, np.array([0.0, 0.0, np.pi / 2])) == 0.0
    assert gap(bar, np.zeros(3), bar, np.array([0.0, 0.05, 0.0])) == pytest.approx(0.01)
