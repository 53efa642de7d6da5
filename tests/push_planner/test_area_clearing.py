"""Sweeps, and the tour that takes all objects out of an area."""

import itertools

import numpy as np
import pytest

from push_model.outlines import overlap
from push_planner.area_clearing import AreaClearing
from push_planner.covering_tour import covering_tour
from push_planner.sweeps import Area, Front, shifts, sweeps

FRONT = Front(0.72, 0.72, 1.2)
CORNERS = 5.0 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
EDGES = tuple(np.array([CORNERS[k], CORNERS[(k + 1) % 4]]) for k in range(4))
OPEN = Area(CORNERS, EDGES, np.array([8.0, 8.0]), (), 1.05)
BOX = 0.1 * CORNERS


def drawn(random, count):
    """Boxes of 1 m at least 1.5 m apart, as the rooms of benchnpin draw them."""
    found = []
    while len(found) < count:
        at = random.uniform(-4.0, 4.0, 2)
        if all(np.hypot(*(at - other)) > 1.5 for other in found):
            found.append(at)
    return [BOX + at for at in found]


def cheapest(first, between, takes):
    """By trying all sequences in which each push takes something new."""
    every, best = int(np.bitwise_or.reduce(takes)), np.inf
    for count in range(1, len(first) + 1):
        for order in itertools.permutations(range(len(first)), count):
            taken = [int(t) for t in np.bitwise_or.accumulate(takes[list(order)])]
            if taken[-1] == every and len(set(taken)) == count:
                cost = first[order[0]] + sum(between[a, b] for a, b in itertools.pairwise(order))
                best = min(best, cost)
    return best


@pytest.mark.parametrize("seed", range(100))
def test_no_sequence_of_pushes_is_cheaper_than_the_tour(seed):
    random = np.random.default_rng(seed)
    pushes, objects = int(random.integers(1, 6)), int(random.integers(1, 5))
    first, between = random.uniform(0.1, 9.0, pushes), random.uniform(0.1, 9.0, (pushes, pushes))
    takes = random.integers(1, 1 << objects, pushes)
    order, cost = covering_tour(first, between, takes)
    assert int(np.bitwise_or.reduce(takes[order])) == int(np.bitwise_or.reduce(takes))
    told = first[order[0]] + sum(between[a, b] for a, b in itertools.pairwise(order))
    assert cost == pytest.approx(told) == pytest.approx(cheapest(first, between, takes))


def test_of_no_pushes_the_tour_is_empty():
    nothing = np.zeros(0)
    assert covering_tour(nothing, np.zeros((0, 0)), nothing.astype(int)) == ([], 0.0)


@pytest.mark.parametrize("seed", range(100))
def test_a_sweep_takes_what_lies_before_the_front_and_touches_nothing_else(seed):
    """The swept strip, from the robot's rear to the edge, beside every box."""
    boxes = drawn(np.random.default_rng(seed), 10)
    found = sweeps(OPEN, FRONT, boxes, 0.12)
    assert found
    for sweep in found:
        out = np.round([np.cos(sweep.heading), np.sin(sweep.heading)])
        across = np.array([-out[1], out[0]])
        wide = FRONT.half_width * across
        ends = sweep.start - FRONT.behind * out, sweep.end + FRONT.ahead * out
        strip = np.array([ends[0] - wide, ends[1] - wide, ends[1] + wide, ends[0] + wide])
        robot = np.array(
            [*strip[[0, 3]], *(sweep.start + FRONT.ahead * out + [[wide], [-wide]])[:, 0]]
        )
        for k, box in enumerate(boxes):
            assert overlap(strip, box) == bool(sweep.takes >> k & 1)
            assert not overlap(robot, box)


@pytest.mark.parametrize("seed", range(30))
def test_boxes_that_move_with_the_front_are_all_taken_out(seed):
    """A tour to its end, where each sweep takes out what it says."""
    boxes = drawn(np.random.default_rng(seed), 10)
    planner, pose = AreaClearing(OPEN, FRONT), np.array([0.0, -4.0, 1.57])
    made = 0
    while any(overlap(CORNERS, box) for box in boxes):
        way, sweep, _ = planner.next_sweep(pose, boxes)
        assert np.allclose(way[-1], sweep.start) and sweep.takes
        for k in range(len(boxes)):
            if sweep.takes >> k & 1:
                assert overlap(CORNERS, boxes[k])
                boxes[k] = boxes[k] + 20.0
        pose, made = np.array([*sweep.end, sweep.heading]), made + 1
    assert made < 8  # of ten boxes, several at once
    assert planner.next_sweep(pose, boxes) is None


def test_a_box_between_columns_is_first_brought_out():
    """No sweep has room for it; after the shift one has."""
    column = BOX * 2.0
    fixed = (column + [0.0, 2.5], column + [0.0, -2.5])
    edges = (EDGES[0], EDGES[2])  # over the others nothing leaves
    area = Area(CORNERS, edges, np.array([8.0, 8.0]), fixed, 1.05)
    boxes = [BOX + [0.0, 0.2]]
    assert not sweeps(area, FRONT, boxes, 0.12)
    found = shifts(area, FRONT, boxes, 0.12)
    assert found and all(abs(np.cos(s.heading)) > 0.99 for s in found)
    _, shift, left = AreaClearing(area, FRONT).next_sweep(np.array([-4.0, 0.0, 0.0]), boxes)
    assert shift.takes == 0 and left == 0
    length = np.linalg.norm(shift.end - shift.start) - 0.12
    moved = boxes[0] + length * np.array([np.cos(shift.heading), np.sin(shift.heading)])
    assert any(s.takes for s in sweeps(area, FRONT, [moved], 0.12))


def test_a_box_that_nothing_brings_out_ends_the_plan():
    walls = tuple(np.array([a, a + 0.1, b + 0.1, b]) for a, b in EDGES)
    shut = Area(CORNERS, EDGES, np.array([8.0, 8.0]), walls, 1.05)
    assert AreaClearing(shut, FRONT).next_sweep(np.zeros(3), [BOX + [2.0, 2.0]]) is None
