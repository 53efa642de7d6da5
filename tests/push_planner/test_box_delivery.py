"""Pushes that bring boxes to a receptacle: they keep off what is fixed, and end in it."""

import math
from functools import cache

import numpy as np
import pytest

from push_model import se2
from push_model.outlines import inside, overlap
from push_planner.box_delivery import BoxDelivery, DeliveryRoom, StraightDelivery

ROBOT = np.array([[-0.42, -0.25], [0.38, -0.35], [0.38, 0.35], [-0.42, 0.25]])
LIMITS = np.array([4.0, 2.5])
SIDE, GROWN = 0.44, 0.02
COLUMN = np.array([[-0.5, -1.4], [0.5, -1.4], [0.5, -0.4], [-0.5, -0.4]])
RECEPTACLE = np.array([[2.5, 1.0], [4.0, 1.0], [4.0, 2.5], [2.5, 2.5]])


def room(fixed=(COLUMN,), receptacle=RECEPTACLE):
    return DeliveryRoom(LIMITS, tuple(fixed), receptacle, ROBOT, SIDE, GROWN)


@cache
def planner():
    return BoxDelivery(room())


def box(x, y, theta, side=SIDE):
    half = 0.5 * side
    corners = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    return se2.transform(np.array([x, y, theta]), corners)


def drawn(random):
    """A box that may touch a wall, clear of column and receptacle, and a pose of the robot that is
    clear of both."""
    while True:
        x, y = random.uniform(-LIMITS, LIMITS)
        outline = box(x, y, random.uniform(0.0, 2.0 * math.pi))
        if random.random() < 0.5:  # flat at a wall, or nearly
            beyond = LIMITS - 0.5 * SIDE - GROWN - random.uniform(0.0, 0.1)
            at = (
                (math.copysign(beyond[0], x), y)
                if random.random() < 0.5
                else (x, math.copysign(beyond[1], y))
            )
            outline = box(*at, 0.0)
        pose = np.array([*random.uniform(-LIMITS + 0.6, LIMITS - 0.6), random.uniform(-3.0, 3.0)])
        robot = se2.transform(pose, ROBOT)
        if (
            (np.abs(outline) <= LIMITS - GROWN).all()
            and not any(overlap(outline, other) for other in (COLUMN, RECEPTACLE, robot))
            and not overlap(robot, 1.1 * COLUMN)
        ):
            return outline, pose


def clear(outline):
    """Of walls and column."""
    return (np.abs(outline) <= LIMITS).all() and not overlap(outline, COLUMN)


def in_front(push, outline):
    """The pose of the box in the frame of the robot when it lies flat against the front."""
    _, aside = se2.transform(se2.inverse(push.path[0]), outline).mean(axis=0)
    return np.array([ROBOT[:, 0].max() + GROWN + 0.5 * SIDE, aside, 0.0])


def test_pushes_of_random_boxes_keep_off_what_is_fixed_and_end_in_the_receptacle():
    """Two hundred, half of them at walls; all but those in corners, behind which no robot fits."""
    random = np.random.default_rng(1)
    found, at_walls = 0, 0
    for _ in range(200):
        outline, pose = drawn(random)
        push = planner().next_push(pose, [outline])
        if push is None:
            assert (LIMITS - np.abs(outline.mean(axis=0)) < 0.9).all()
            continue
        found += 1
        at_walls += (LIMITS - np.abs(outline.mean(axis=0))).min() < 0.35
        assert push.box == 0
        assert np.hypot(*(push.way[0] - pose)[:2]) < 0.2
        gap = se2.transform(se2.inverse(push.way[-1]), outline)[:, 0].min() - ROBOT[:, 0].max()
        assert GROWN + 0.02 - 1e-9 <= gap <= GROWN + 0.2 + 1e-9
        assert np.allclose(push.way[-1], push.path[0])
        assert all(clear(se2.transform(p, ROBOT)) for p in (*push.way, *push.path))
        held = in_front(push, outline)
        # It may lie 0.07 m off the place for which the costs were computed (_NEAR_ASIDE).
        assert all(clear(b) for b in (box(*se2.compose(p, held), SIDE - 0.14) for p in push.path))
        assert inside(
            1.1 * (RECEPTACLE - [3.25, 1.75]) + [3.25, 1.75], box(*se2.compose(push.path[-1], held))
        ).all()
    assert found >= 170 and at_walls >= 60


@pytest.mark.parametrize(("x", "y"), [(-1.0, 2.25), (-1.0, -2.25), (-3.75, 0.0), (3.75, -0.5)])
def test_a_box_flat_at_a_wall_is_pushed_along_it(x, y):
    push = planner().next_push(np.array([0.0, 0.5, 0.0]), [box(x, y, 0.0)])
    assert push is not None
    along = abs(math.cos(push.path[0, 2])) if abs(y) > 2.0 else abs(math.sin(push.path[0, 2]))
    assert along > 0.9
    aside = in_front(push, box(x, y, 0.0))[1]
    assert abs(aside) > 0.05  # else the robot would be in the wall


@pytest.mark.parametrize("seed", range(30))
def test_the_cheapest_of_several_boxes_comes_first(seed):
    """In an empty room, a box that has another one behind it, seen from robot and receptacle."""
    random = np.random.default_rng(seed)
    empty = empty_room()
    near, far = box(1.0, random.uniform(0.0, 1.0), 0.0), box(-3.0, random.uniform(-1.0, 1.0), 0.0)
    pose = np.array([0.0, random.uniform(0.0, 1.5), 0.0])
    first = int(random.integers(2))
    boxes = [near, far] if first == 0 else [far, near]
    assert empty.next_push(pose, boxes).box == first


@cache
def empty_room():
    return BoxDelivery(room(()))


def test_pushes_that_have_failed_are_not_planned_again():
    pose, outline = np.array([0.0, 0.5, 0.0]), box(-2.0, 0.5, 0.3)
    tried = set()
    for _ in range(20):
        push = planner().next_push(pose, [outline], tried)
        assert (0, push.node) not in tried
        tried.add((0, push.node))


def test_the_way_leads_round_other_boxes_where_there_is_room():
    pose, outline = np.array([-3.0, 0.5, 0.0]), box(1.5, 0.5, 0.0)
    other = box(-1.2, 0.5, 0.0)
    with_it = empty_room().next_push(pose, [outline, other], {(1, n) for n in range(400000)})
    for p in with_it.way:
        assert not overlap(se2.transform(p, ROBOT), other)
    without = empty_room().next_push(pose, [outline])
    assert any(overlap(se2.transform(p, ROBOT), other) for p in without.way)


def test_there_is_no_push_into_a_receptacle_behind_a_wall():
    wall = np.array([[2.2, -2.5], [2.4, -2.5], [2.4, 2.5], [2.2, 2.5]])
    shut = BoxDelivery(room((wall,)))
    assert shut.next_push(np.array([0.0, 0.5, 0.0]), [box(-2.0, 0.5, 0.3)]) is None
    assert planner().next_push(np.array([0.0, 0.5, 0.0]), []) is None


def test_a_straight_push_leads_to_the_middle_of_the_receptacle():
    random, found = np.random.default_rng(4), 0
    straight = StraightDelivery(room(()))
    for _ in range(50):
        outline, pose = drawn(random)
        push = straight.next_push(pose, [outline])
        if push is None:
            continue
        found += 1
        way = np.array([3.25, 1.75]) - outline.mean(axis=0)
        off = se2.wrap(push.path[0, 2] - math.atan2(way[1], way[0]))
        assert abs(off) < 0.3
        ends = push.path[-1, :2] + 0.6 * np.array(
            [math.cos(push.path[-1, 2]), math.sin(push.path[-1, 2])]
        )
        assert np.hypot(*(ends - [3.25, 1.75])) < 0.1
    assert found >= 15  # none of a box at a wall, behind which the robot would stand in it
