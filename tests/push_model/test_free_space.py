"""Room on a map, and ways of discs through it, on random maps."""

import math

import numpy as np
import pytest

from push_model import se2
from push_model.free_space import FreeSpace, Obstacles
from push_model.occupancy import OccupancyGrid, rasterise
from push_model.outlines import distance
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object


def random_map(random) -> EnvironmentSpec:
    circles = tuple(
        {"centre": tuple(random.uniform(-1.3, 1.3, 2)), "radius": random.uniform(0.05, 0.3)}
        for _ in range(int(random.integers(0, 8)))
    )
    return EnvironmentSpec((3.0, 3.0), resolution=0.02, circles=circles)


def dense(points):
    parts = [
        a + np.linspace(0.0, 1.0, 2 + math.ceil(np.hypot(*(b - a)) / 0.004))[:, None] * (b - a)
        for a, b in zip(points[:-1], points[1:], strict=True)
    ]
    return np.vstack(parts)


def true_distance(grid: OccupancyGrid, points):
    """To the squares of occupied cells, one by one."""
    rows, columns = np.nonzero(grid.occupied)
    low = np.column_stack([columns, rows]) * grid.resolution + grid.origin
    gap = np.maximum(low[None] - points[:, None], points[:, None] - low[None] - grid.resolution)
    return np.hypot(*np.maximum(gap, 0.0).transpose(2, 0, 1)).min(axis=1)


def test_the_clearance_is_never_more_than_it_is_and_hardly_less():
    random = np.random.default_rng(1)
    for _ in range(10):
        grid = rasterise(random_map(random))
        points = random.uniform(-1.4, 1.4, (300, 2))
        told, true = FreeSpace(grid).clearance(points), true_distance(grid, points)
        assert (told <= true + 1e-9).all()
        assert (told >= true - 2.0 * grid.resolution).all()


def test_ways_keep_clear_of_everything_and_are_found_where_there_is_room():
    random = np.random.default_rng(2)
    plate = load_object("plate_hexagon").geometry.outline
    found = missing = 0
    for _ in range(60):
        space = FreeSpace(rasterise(random_map(random)))
        pose = random.uniform(-1.0, 1.0, 3)
        discs = np.column_stack([random.uniform(-1.3, 1.3, (3, 2)), np.full(3, 0.05)])
        among = Obstacles((se2.transform(pose, plate),), discs)
        ends = random.uniform(-1.4, 1.4, (2, 2))
        if space.room(ends, among).min() < 0.07:
            continue
        way = space.from_here(ends[0], 0.06, among).way_to(ends[1])
        if way is None:
            missing += 1
            continue
        found += 1
        points = dense(way)
        assert np.array_equal(way[0], ends[0]) and np.array_equal(way[-1], ends[1])
        assert space.room(points, among).min() >= 0.055
        assert distance(among.outlines[0], points).min() >= 0.055
        for x, y, radius in discs:
            assert (np.hypot(points[:, 0] - x, points[:, 1] - y) >= radius + 0.055).all()
    assert found > 20 and found > 4 * missing


def test_a_wall_across_leaves_no_way_and_a_start_beside_something_only_comes_away():
    occupied = np.zeros((100, 100), dtype=bool)
    occupied[:, 50] = True
    space = FreeSpace(OccupancyGrid(occupied, 0.02, np.array([-1.0, -1.0])))
    assert (
        space.from_here(np.array([-0.5, 0.0]), 0.06, Obstacles()).way_to(np.array([0.5, 0])) is None
    )
    near = np.array([-0.07, 0.0])  # 5 cm from the wall, 6 are wanted
    way = space.from_here(near, 0.06, Obstacles()).way_to(np.array([-0.5, 0.3]))
    assert way is not None and np.array_equal(way[0], near)
    assert (np.diff(space.clearance(dense(way)[:10])) >= -1e-9).all()


def test_in_the_open_a_way_is_a_straight_line():
    space = FreeSpace(rasterise(EnvironmentSpec((3.0, 3.0), resolution=0.02)))
    a, b = np.array([-1.0, -1.0]), np.array([1.2, 0.7])
    assert np.array_equal(space.from_here(a, 0.06, Obstacles()).way_to(b), [a, b])
    reach = space.from_here(a, 0.06, Obstacles())
    straight = np.hypot(*(space.places - a).T)
    known = np.isfinite(reach.lengths)
    assert (reach.lengths[known] >= straight[known] - 1e-9).all()
    assert (reach.lengths[known] <= 1.09 * straight[known] + 0.1).all()
    assert known.sum() > 0.8 * len(space.places)
    assert reach.way_to_place(int(np.argmax(np.where(known, straight, 0.0)))) == pytest.approx(
        np.array([a, space.places[int(np.argmax(np.where(known, straight, 0.0)))]])
    )
