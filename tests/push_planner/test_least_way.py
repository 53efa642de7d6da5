"""Ways about obstacles: never over-estimated, and not far below."""

import math

import numpy as np
import pytest
import shapely
from scipy.sparse.csgraph import dijkstra

from benchmarks.plan import cluttered
from push_model.distance_field import DistanceField
from push_model.free_space import FreeSpace
from push_model.occupancy import OccupancyGrid, rasterise
from push_planner.least_way import least_ways


def test_ways_about_obstacles_are_never_over_estimated(robot, box):
    """Against paths that a disc can take."""
    ratios = []
    for seed in range(12):
        grid = rasterise(cluttered(seed))
        field, random = DistanceField(grid), np.random.default_rng(seed)
        least = box.geometry.inradius + 0.012
        space = FreeSpace(grid)
        x0, x1, y0, y1 = grid.extent
        for _ in range(15):
            a, b = (random.uniform([x0, y0], [x1, y1]) for _ in range(2))
            if min(space.clearance(np.array([a, b]))) < least:
                continue
            reach = space.from_here(a, least)
            while not reach.settle(100000):
                pass
            way = reach.way_to(b)
            if way is None:
                continue
            length = float(np.hypot(*np.diff(way, axis=0).T).sum())
            lower = least_ways(field, a, least).at(b)
            assert lower <= length + 1e-9
            ratios.append(lower / length)
    assert len(ratios) > 60 and np.median(ratios) > 0.85


def rectangles(random, slalom):
    """``(100, 100)`` cells: nine rectangles, or thin walls of which each turns the way."""
    cells = np.zeros((100, 100), dtype=bool)
    if not slalom:
        for _ in range(9):
            (i, j), (height, width) = random.integers(10, 75, 2), random.integers(1, 20, 2)
            cells[i : i + height, j : j + width] = True
        return cells
    for k, column in enumerate(range(12, 88, random.integers(8, 13))):
        end = int(random.integers(48, 60))
        cells[slice(12, end) if k % 2 else slice(100 - end, 88), column] = True
    return cells


def shortest_ways(obstacles, ends, least):
    """``(n, n)`` [m] ways that keep a distance: at most 1 % longer than the shortest ones."""
    away = least / math.cos(math.pi / 32.0) + 1e-4  # eight chords about each quarter of a turn
    blocked = shapely.buffer(obstacles, away, quad_segs=8)
    corners = shapely.get_coordinates(blocked)
    points = np.concatenate([ends, corners])
    lines = shapely.linestrings(np.stack(np.broadcast_arrays(points[:, None], points), axis=2))
    within = shapely.buffer(blocked, -1e-6)
    shapely.prepare(within)
    apart = np.hypot(*(points[:, None] - points).transpose(2, 0, 1))
    apart[shapely.intersects(within, lines)] = 0.0  # no edge
    return dijkstra(apart, indices=range(len(ends)))[:, : len(ends)]


@pytest.mark.parametrize("slalom", [False, True])
def test_ways_about_rectangles_are_never_over_estimated(slalom):
    """Against the shortest ways of a visibility graph."""
    size, least, ratios, bent = 0.05, 0.112, [], 0
    for seed in range(4):
        random = np.random.default_rng(seed)
        cells = rectangles(random, slalom)
        field = DistanceField(OccupancyGrid(cells, size, np.zeros(2)))
        i, j = np.nonzero(cells)
        obstacles = shapely.union_all(
            shapely.box(j * size, i * size, (j + 1) * size, (i + 1) * size)
        )
        ends = random.uniform(0.4, 4.6, (40, 2))
        ends = ends[shapely.distance(obstacles, shapely.points(ends)) > least + 0.01]
        for a, ways in zip(ends, shortest_ways(obstacles, ends, least), strict=True):
            bounds = least_ways(field, a, least)
            for b, way in zip(ends, ways, strict=True):
                straight = float(np.hypot(*(b - a)))
                if straight > 0.5 and way < math.inf:
                    lower = bounds.at(b)
                    assert lower <= way
                    ratios.append(lower / way)
                    bent += way > 1.05 * straight
    assert len(ratios) > 2000 and bent > 200 and np.median(ratios) > 0.85
