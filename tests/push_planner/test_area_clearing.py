"""Sweeps, and the tour that takes all objects out of an area."""

import itertools

import numpy as np
import pytest

from push_model import se2
from push_model.outlines import distance, inside, overlap
from push_planner.area_clearing import AreaClearing
from push_planner.covering_tour import covering_tour
from push_planner.sweeps import Area, Front, run_up, shifts, sweeps

FRONT = Front(0.72, 0.72, 1.22)
CORNERS = 5.0 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
EDGES = tuple(np.array([CORNERS[k], CORNERS[(k + 1) % 4]]) for k in range(4))
OPEN = Area(CORNERS, EDGES, np.array([8.0, 8.0]), (), 1.05)
BOX = 0.1 * CORNERS


def drawn(random, count, turned=False):
    """Boxes of 1 m at least 1.5 m apart, with sides along the axes or turned anyhow."""
    found = []
    while len(found) < count:
        at = random.uniform(-4.0, 4.0, 2)
        if all(np.hypot(*(at - other)) > 1.5 for other in found):
            found.append(at)
    turns = random.uniform(0.0, np.pi, count) if turned else np.zeros(count)
    return [BOX @ se2.rotation_matrix(t).T + at for t, at in zip(turns, found, strict=True)]


def cheapest(first, between, takes, last):
    """By trying all sequences in which each push takes something new."""
    every, best = int(np.bitwise_or.reduce(takes)), np.inf
    for count in range(1, len(first) + 1):
        for order in itertools.permutations(range(len(first)), count):
            taken = [int(t) for t in np.bitwise_or.accumulate(takes[list(order)])]
            if taken[-1] == every and len(set(taken)) == count:
                cost = first[order[0]] + sum(between[a, b] for a, b in itertools.pairwise(order))
                best = min(best, cost + last[order[-1]])
    return best


@pytest.mark.parametrize("seed", range(100))
def test_no_sequence_of_pushes_is_cheaper_than_the_tour(seed):
    random = np.random.default_rng(seed)
    pushes, objects = int(random.integers(1, 6)), int(random.integers(1, 5))
    first, between = random.uniform(0.1, 9.0, pushes), random.uniform(0.1, 9.0, (pushes, pushes))
    takes = random.integers(1, 1 << objects, pushes)
    last = random.uniform(0.0, 9.0, pushes)
    for home in (None, last):
        order = covering_tour(first, between, takes, home)
        assert int(np.bitwise_or.reduce(takes[order])) == int(np.bitwise_or.reduce(takes))
        back = 0.0 * last if home is None else home
        told = first[order[0]] + sum(between[a, b] for a, b in itertools.pairwise(order))
        best = cheapest(first, between, takes, back)
        assert told + back[order[-1]] == pytest.approx(best)


def test_of_no_pushes_the_tour_is_empty_and_one_of_too_many_objects_is_refused():
    nothing = np.zeros(0)
    assert covering_tour(nothing, np.zeros((0, 0)), nothing.astype(int)) == []
    with pytest.raises(ValueError, match="at most 16 objects, got 17"):
        covering_tour(np.ones(1), np.ones((1, 1)), np.array([1 << 16]))


@pytest.mark.parametrize("seed", range(100))
def test_a_sweep_takes_what_lies_before_the_front_and_touches_nothing_else(seed):
    """The swept strip, from the robot's rear to the edge, beside every box."""
    boxes = drawn(np.random.default_rng(seed), 10, turned=seed % 2 > 0)
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


@pytest.mark.parametrize("seed", range(100))
def test_a_robot_that_turns_at_the_start_of_a_run_up_touches_nothing_before_it(seed):
    """A sweep is the same but for its start. Where there is room, that is so far back that the
    circle of the robot's corners keeps off what the sweep takes. It always keeps off walls and
    columns. Nothing lies in the run-up."""
    random = np.random.default_rng(seed)
    boxes = drawn(random, 10, turned=seed % 2 > 0)
    column = BOX + random.uniform(-6.5, 6.5, 2)
    area = Area(CORNERS, EDGES, np.array([7.0, 7.0]), (column,), 1.05)
    corner = np.hypot(FRONT.ahead, FRONT.half_width)
    lengths = []
    for sweep in sweeps(area, FRONT, boxes, 0.12):
        longer = run_up(area, FRONT, sweep, boxes, 0.12)
        out = np.array([np.cos(sweep.heading), np.sin(sweep.heading)])
        back = sweep.start - longer.start
        assert longer.end is sweep.end and longer.takes == sweep.takes
        swing = FRONT.corner - FRONT.ahead
        assert np.allclose(back, (back @ out) * out) and -1e-9 < back @ out < swing + 1e-9
        lengths.append(round(float(back @ out) / swing, 9))
        across = FRONT.half_width * np.array([-out[1], out[0]])
        rear, front = longer.start - FRONT.behind * out, sweep.start + FRONT.ahead * out
        strip = np.array([rear - across, rear + across, front + across, front - across])
        assert (np.abs(strip) < 7.0).all()
        assert not any(overlap(strip, body) for body in (column, *boxes))
        if lengths[-1] > 0.0:
            assert (np.abs(longer.start) + corner <= 7.0).all()
            assert distance(column, longer.start[None])[0] >= corner
        if lengths[-1] == 1.0:
            taken = [box for k, box in enumerate(boxes) if sweep.takes >> k & 1]
            assert all(distance(box, longer.start[None])[0] > corner for box in taken)
    assert set(lengths) <= {0.0, 0.25, 0.5, 0.75, 1.0} and max(lengths) == 1.0


@pytest.mark.parametrize("seed", range(30))
def test_boxes_that_move_with_the_front_are_all_taken_out(seed):
    """A tour to its end, where each sweep takes out what it says."""
    boxes = drawn(np.random.default_rng(seed), 10)
    planner, pose = AreaClearing(OPEN, FRONT), np.array([0.0, -4.0, 1.57])
    made = 0
    while any(overlap(CORNERS, box) for box in boxes):
        way, sweep = planner.next_sweep(pose, boxes)
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
    _, shift = AreaClearing(area, FRONT).next_sweep(np.array([-4.0, 0.0, 0.0]), boxes)
    assert shift.takes == 0
    length = np.linalg.norm(shift.end - shift.start) - 0.12
    moved = boxes[0] + length * np.array([np.cos(shift.heading), np.sin(shift.heading)])
    assert any(s.takes for s in sweeps(area, FRONT, [moved], 0.12))


@pytest.mark.parametrize("seed", range(30))
def test_the_way_to_a_sweep_goes_round_a_column(seed):
    """All along the way, but for its end, where a sweep may begin beside the column."""
    random = np.random.default_rng(seed)
    column = BOX * 2.0 + random.uniform(-0.5, 0.5, 2)
    area = Area(CORNERS, EDGES[:1], np.array([9.0, 9.0]), (column,), 1.05)
    boxes = [BOX + [random.uniform(-1.0, 1.0), -3.4]]
    pose = np.array([random.uniform(-1.0, 1.0), 8.0, 0.0])
    way, sweep = AreaClearing(area, FRONT).next_sweep(pose, boxes)
    points = np.array([pose[:2], *way])
    steps = np.linspace(0.0, 1.0, 200)[:, None]
    dense = np.vstack([a + steps * (b - a) for a, b in itertools.pairwise(points)])
    clear = dense[np.hypot(*(dense - sweep.start).T) > 1.5]
    assert distance(column, clear).min() > 1.22 and not inside(column, clear).any()


@pytest.mark.parametrize(("beside", "together"), [(2.2, False), (1.2, True)])
def test_a_shift_moves_a_second_box_only_where_no_other_shift_is_left(beside, together):
    """The second box is far enough for the robot to stand between them, or it is not."""
    column = BOX * 2.0
    fixed = (column + [0.0, 2.5], column + [0.0, -2.5])
    area = Area(CORNERS, (EDGES[0], EDGES[2]), np.array([8.0, 8.0]), fixed, 1.05)
    boxes = [BOX + [-0.5, 0.2], BOX + [beside, 0.2]]
    found = shifts(area, FRONT, boxes, 0.12)
    assert found
    for shift in found:
        out = np.array([np.cos(shift.heading), np.sin(shift.heading)])
        front = shift.start @ out + FRONT.ahead
        near = [float((box @ out).min()) for box in boxes]
        far = [float((box @ out).max()) for box in boxes]
        aside = [float((box.mean(axis=0) - shift.start) @ [-out[1], out[0]]) for box in boxes]
        reached = [abs(a) < FRONT.half_width + 0.5 for a in aside]
        ahead = [n > front for n in near]
        astern = [f < front - FRONT.ahead - FRONT.behind for f in far]
        assert all(x or y or not z for x, y, z in zip(ahead, astern, reached, strict=True))
        pushed = [n < float(shift.end @ out) + FRONT.ahead + 1.0 for n in near]
        met = [all(three) for three in zip(ahead, pushed, reached, strict=True)]
        assert sum(met) == 1 + together


@pytest.mark.parametrize("off", np.linspace(-0.6, 0.6, 13))
def test_a_shift_is_found_wherever_a_box_lies_in_a_gap_that_is_hardly_wider_than_the_robot(off):
    """Columns 2.8 m apart, for a robot that needs 2.56 m; two boxes in a row between them."""
    column = BOX * 2.0
    fixed = (column + [0.0, 2.4], column + [0.0, -2.4])
    area = Area(CORNERS, (EDGES[0], EDGES[2]), np.array([8.0, 8.0]), fixed, 1.05)
    boxes = [BOX + [-0.6, off], BOX + [0.6, off]]
    assert not sweeps(area, FRONT, boxes, 0.12)
    assert shifts(area, FRONT, boxes, 0.12)


def test_a_box_that_nothing_brings_out_ends_the_plan():
    walls = tuple(np.array([a, a + 0.1, b + 0.1, b]) for a, b in EDGES)
    shut = Area(CORNERS, EDGES, np.array([8.0, 8.0]), walls, 1.05)
    assert AreaClearing(shut, FRONT).next_sweep(np.zeros(3), [BOX + [2.0, 2.0]]) is None
