"""Straight lines of round robots, of any length: none leads through a wall, however thin."""

import math

import numpy as np
import pytest
import shapely

from push_model import se2
from push_model.flood import Flood
from push_model.free_space import FreeSpace, Obstacles
from push_model.occupancy import rasterise
from push_model.specs import BoxSpec, CircleSpec, EnvironmentSpec
from push_scenario.bodies import load_object

R = 0.05


@pytest.mark.parametrize(("size", "thick", "resolution"), [(12.0, 0.1, 0.02), (6.0, 0.02, 0.01)])
def test_no_line_leads_through_a_wall_across_the_room(size, thick, resolution):
    """400 lines each from one side of a wall to the other."""
    half = 0.5 * size
    wall = BoxSpec((0.0, 0.0), (thick, size))
    space = FreeSpace(rasterise(EnvironmentSpec((size, size), (wall,), resolution=resolution)))
    random = np.random.default_rng(1)
    here = random.uniform([-half + 0.1, -half + 0.1], [-0.2, half - 0.1], (400, 2))
    there = random.uniform([0.2, -half + 0.1], [half - 0.1, half - 0.1], (400, 2))
    assert not space.sees(here, there, R, 0.5 * R).any()
    assert not any(space.line_keeps(a, b, R) for a, b in zip(here, there, strict=True))
    beside = there * [-1.0, 1.0]
    assert space.sees(here, beside, R, 0.5 * R).all()


def test_lines_keep_their_room_as_another_library_says():
    """Among boxes and circles; those that keep a cell's diagonal more are seen."""
    random, seen_ones, hidden = np.random.default_rng(2), 0, 0
    for _ in range(20):
        boxes = tuple(
            BoxSpec(tuple(random.uniform(-2.5, 2.5, 2)), (float(random.uniform(0.2, 2)), 0.02))
            for _ in range(3)
        )
        circles = tuple(
            CircleSpec(tuple(random.uniform(-2.5, 2.5, 2)), float(random.uniform(0.01, 0.2)))
            for _ in range(6)
        )
        space = FreeSpace(rasterise(EnvironmentSpec((6.0, 6.0), boxes, circles)))
        solid = shapely.union_all(
            [shapely.box(*np.subtract(b.centre, np.divide(b.size, 2)),
                         *np.add(b.centre, np.divide(b.size, 2))) for b in boxes]
        )  # fmt: skip
        ends = random.uniform(-2.9, 2.9, (2, 100, 2))
        roomy = np.minimum(*(space.clearance(e) for e in ends)) > R
        here, there = ends[0][roomy], ends[1][roomy]
        told = space.sees(here, there, R, 0.5 * R)
        for a, b, seen in zip(here, there, told, strict=True):
            line = shapely.LineString([a, b])
            away = min(line.distance(solid), 3.0 - np.abs([a, b]).max())
            for circle in circles:
                away = min(away, line.distance(shapely.Point(circle.centre)) - circle.radius)
            assert not seen or away >= R - 1e-3
            assert seen or away < R + 0.01 * math.sqrt(2.0) + 1e-3
            seen_ones, hidden = seen_ones + seen, hidden + (not seen)
    assert seen_ones > 300 and hidden > 300


def test_lines_keep_clear_of_outlines_and_discs_that_are_not_on_the_map():
    random = np.random.default_rng(3)
    space = FreeSpace(rasterise(EnvironmentSpec((4.0, 4.0), resolution=0.02)))
    outline = load_object("transport_l").geometry.outline
    kept = 0
    for _ in range(300):
        placed = se2.transform(random.uniform([-1, -1, -3], [1, 1, 3]), outline)
        disc = np.array([[*random.uniform(-1.5, 1.5, 2), random.uniform(0.02, 0.2)]])
        a, b = random.uniform(-1.8, 1.8, (2, 2))
        line = shapely.LineString([a, b])
        point = shapely.Point(disc[0, :2])
        away = min(line.distance(shapely.Polygon(placed)), line.distance(point) - disc[0, 2])
        ends = [
            min(shapely.Point(p).distance(shapely.Polygon(placed)),
                shapely.Point(p).distance(point) - disc[0, 2]) for p in (a, b)
        ]  # fmt: skip
        if min(ends) < R:
            continue
        told = space.line_keeps(a, b, R, Obstacles((placed,), disc))
        assert told == (away >= R) or abs(away - R) < 1e-3
        kept += told
    assert kept > 50


def test_a_flood_in_slices_is_the_flood_at_once():
    wall = BoxSpec((0.3, -0.2), (0.05, 1.6))
    space = FreeSpace(rasterise(EnvironmentSpec((3.0, 2.0), (wall,))))
    tip, nothing = space.field.lattice(np.array([-0.5, 0.1])), space.capsules(Obstacles())
    whole, sliced = (
        Flood.of_disc(space.field.values, nothing, tip, 12.0, space.stride) for _ in range(2)
    )
    whole.step(1 << 30)
    count = 0
    while not sliced.step(37):
        count += 1
    assert count > 50
    assert np.array_equal(whole.lengths, sliced.lengths)
    # round the wall's end, by the octile metric of the lattice at most a twelfth too long
    goal = np.array([1.0, 0.1])
    i, j = whole.nearest(space.field.lattice(goal))
    told = whole.lengths[i, j] * space.field.spacing
    corner = np.array([0.3, 0.6 + 0.06])
    true = math.dist((-0.5, 0.1), corner) + math.dist(corner, goal)
    assert true - 0.05 < told < 1.09 * true + 0.1
