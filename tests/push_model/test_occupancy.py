"""Grids of environments: nothing solid is left out, and little is added."""

import math

import numpy as np

from push_model.occupancy import rasterise
from push_model.specs import BoxSpec, EnvironmentSpec
from tests.push_planner.exact_geometry import points_distance, random_world


def test_every_cell_that_an_obstacle_reaches_into_is_occupied_and_no_other():
    random = np.random.default_rng(1)
    for number in range(200):
        r = (0.01, 0.02, 0.037)[number % 3]
        world = random_world(random, 1 + number % 6, r)
        grid = rasterise(world)
        spots = random.uniform([-1.5, -1.0], [1.5, 1.0], (2000, 2))
        column, row = ((spots - grid.origin) / r).astype(int).T
        solid = points_distance(world, spots) == 0.0
        assert grid.occupied[row[solid], column[solid]].all()
        # A point of an occupied cell is a diagonal from an obstacle at most.
        far = points_distance(world, spots) > math.sqrt(2.0) * r + 1e-6
        assert not grid.occupied[row[far], column[far]].any()


def test_obstacles_that_fill_their_cells_take_no_others():
    grid = rasterise(EnvironmentSpec((3.0, 2.0), boxes=(BoxSpec((0.1, -0.2), (0.3, 0.1)),)))
    assert grid.occupied.sum() == 304 * 204 - 300 * 200 + 30 * 10
    turned = BoxSpec((0.1, -0.2), (0.3, 0.1), math.pi / 2)
    assert rasterise(EnvironmentSpec((3.0, 2.0), boxes=(turned,))).occupied.sum() == (
        304 * 204 - 300 * 200 + 10 * 30
    )


def test_an_arena_that_ends_within_a_cell_ends_before_it():
    grid = rasterise(EnvironmentSpec((1.005, 1.0)))
    free = np.flatnonzero(~grid.occupied.all(axis=0))
    assert grid.origin[0] + free[0] * 0.01 >= -0.5025 - 1e-9
    assert grid.origin[0] + (free[-1] + 1) * 0.01 <= 0.5025 + 1e-9
    assert len(free) == 99


def test_rectangles_are_few_and_cover_every_occupied_cell_once():
    random = np.random.default_rng(2)
    for _ in range(100):
        grid = rasterise(random_world(random, 5, 0.02))
        count = np.zeros(grid.occupied.shape, dtype=int)
        rectangles = grid.rectangles()
        for x0, x1, y0, y1 in rectangles:
            c0, c1 = np.round((np.array([x0, x1]) - grid.origin[0]) / 0.02).astype(int)
            r0, r1 = np.round((np.array([y0, y1]) - grid.origin[1]) / 0.02).astype(int)
            count[r0:r1, c0:c1] += 1
        assert (count == grid.occupied).all()
        assert len(rectangles) < 4 * grid.occupied.shape[0]
