"""Distances are never more than exact geometry's, and hardly less."""

import numpy as np
import pytest

from push_model.distance_field import DistanceField, between_samples, piece_square
from push_model.occupancy import OccupancyGrid, rasterise
from push_model.shapes import densified, rectangle
from tests.push_planner.exact_geometry import (
    body_distance,
    convex_distance,
    placed,
    points_distance,
    random_world,
)

BODIES = (
    rectangle(0.09, 0.09).outline,
    rectangle(0.16, 0.03).outline,
    np.array([[-0.03, -0.04], [0.07, 0.0], [-0.03, 0.05]]),
)


def test_values_are_exact_distances_to_the_squares_of_occupied_cells():
    random = np.random.default_rng(1)
    for _ in range(100):
        rows, columns = random.integers(2, 14, 2)
        occupied = random.random((rows, columns)) < random.choice([0.02, 0.1, 0.4])
        field = DistanceField(OccupancyGrid(occupied, 0.1, np.zeros(2)))
        i, j = np.mgrid[: 2 * rows + 1, : 2 * columns + 1]
        exact = np.minimum(np.minimum(i, 2 * rows - i), np.minimum(j, 2 * columns - j)) ** 2.0
        for row, column in np.argwhere(occupied):
            di = np.maximum(np.abs(i - 2 * row - 1) - 1, 0)
            dj = np.maximum(np.abs(j - 2 * column - 1) - 1, 0)
            exact = np.minimum(exact, di**2 + dj**2)
        assert np.array_equal(field.values, exact)


@pytest.mark.parametrize("resolution", [0.01, 0.05])
def test_points_bodies_and_segments_against_exact_geometry(resolution):
    """200 worlds. What is lacking is a cell's diagonal, for obstacles that cells only touch, and
    little more."""
    random = np.random.default_rng(2)
    lacking = {"point": [], "body": [], "segment": []}
    for number in range(100):
        world = random_world(random, 1 + number % 9, resolution)
        field = DistanceField(rasterise(world))
        spots = random.uniform([-1.5, -1.0], [1.5, 1.0], (30, 2))
        found = np.array([field.at(x, y) for x, y in spots])
        lacking["point"].extend(points_distance(world, spots) - found)
        body = BODIES[number % 3]
        poses = np.column_stack([spots[:4], random.uniform(-np.pi, np.pi, 4)])
        outline = densified(body, 0.01)
        found = np.array([field.clearance(outline, pose) for pose in poses])
        lacking["body"].extend(body_distance(world, placed(poses, body)) - found)
        t = np.linspace(0.0, 1.0, 100)[:, None, None]
        exact = points_distance(world, spots[:4] + t * (spots[4:8] - spots[:4]))
        exact = exact.reshape(100, 4).min(axis=0)  # never less than the segments' own
        ends = zip(spots[:4], spots[4:8], strict=True)
        lacking["segment"].extend(exact - [field.segment(a, b) for a, b in ends])
    for what, gaps in lacking.items():
        gaps = np.array(gaps)
        print(f"{resolution}: {what}: {gaps.max():.5f} mean {gaps.mean():.5f} of {len(gaps)}")
        assert gaps.min() > -1e-9, what
        assert gaps.max() < (np.sqrt(2.0) + 0.05) * resolution, what
        assert gaps.mean() < 0.4 * resolution, what


def test_hardly_less_than_exact_on_the_map_itself():
    """Where obstacles fill their cells nothing is lost but the interpolation: under half a
    millimetre of cells of ten, also with points of the outline a centimetre apart."""
    random = np.random.default_rng(3)
    lost = []
    for _ in range(80):
        occupied = np.zeros((200, 300), dtype=bool)
        for _ in range(random.integers(1, 8)):
            row, column = random.integers(0, 180), random.integers(0, 280)
            occupied[
                row : row + random.integers(1, 40), column : column + random.integers(1, 40)
            ] = True
        grid = OccupancyGrid(occupied, 0.01, np.array([-1.5, -1.0]))
        field = DistanceField(grid)
        squares = [np.array([[a, c], [b, c], [b, d], [a, d]]) for a, b, c, d in grid.rectangles()]
        empty = random_world(random, 0)
        body = BODIES[random.integers(3)]
        poses = random.uniform([-1.4, -0.9, -4.0], [1.4, 0.9, 4.0], (10, 3))
        bodies = placed(poses, body)
        exact = np.min(
            [body_distance(empty, bodies), *(convex_distance(bodies, s) for s in squares)], axis=0
        )
        outline = densified(body, 0.01)
        lost.extend(exact - [field.clearance(outline, pose) for pose in poses])
    lost = np.array(lost)
    print(f"lost {lost.max():.6f} mean {lost.mean():.6f}")
    assert lost.min() > -1e-9 and lost.max() < 0.0005 and lost.mean() < 0.0002


def test_an_obstacle_inside_a_body_that_its_outline_does_not_touch():
    occupied = np.zeros((40, 40), dtype=bool)
    occupied[20, 20] = True
    field = DistanceField(OccupancyGrid(occupied, 0.01, np.zeros(2)))
    body = densified(rectangle(0.09, 0.09).outline, 0.01)
    for x in np.linspace(0.175, 0.235, 13):
        assert field.clearance(body, np.array([x, 0.205, 0.3])) == 0.0
    assert field.clearance(body, np.array([0.1, 0.1, 0.3])) > 0.01


def test_pieces_between_samples_against_many_points():
    random = np.random.default_rng(5)
    for _ in range(500):
        obstacles = random.uniform(-1.0, 1.0, (random.integers(1, 6), 2))
        a, b = random.uniform(-1.0, 1.0, (2, 2))
        t = np.linspace(0.0, 1.0, 101)[:, None]
        exact = np.hypot(*np.moveaxis((a + t * (b - a))[:, None] - obstacles, -1, 0)).min(axis=1)
        gap = float(np.hypot(*(b - a)))
        low = piece_square(exact[0] ** 2, exact[-1] ** 2, gap**2)
        assert low <= exact.min() ** 2 + 1e-12
        assert between_samples(min(exact[0], exact[-1]), gap) ** 2 <= max(low, 0.0) + 1e-12
        if len(obstacles) == 1:
            assert low == pytest.approx(exact.min() ** 2, abs=gap**2 / 100**2)
