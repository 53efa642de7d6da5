"""Searches for objects' ways: in slices, as wide as was asked for, found where there is one."""

import math

import numpy as np
import pytest
import shapely
from shapely import affinity

from push_model import se2
from push_model.free_space import FreeSpace, Obstacles
from push_model.object_way import NoObjectWay, WayFinder, pieces
from push_model.occupancy import rasterise
from push_model.screws import screw_poses
from push_model.specs import BoxSpec, CircleSpec, EnvironmentSpec
from push_scenario.bodies import load_object

BODIES = ("plate_hexagon", "transport_square", "transport_l", "plate_ellipse")
FREE = Obstacles()


def problem(seed):
    """A room with pillars, thin walls at any angle, or a door; discs that stand about."""
    random, size = np.random.default_rng([77, seed]), (4.0, 3.0)
    circles, boxes = [], []
    if seed % 3 == 0:
        circles = [
            CircleSpec(tuple(random.uniform(-1.3, 1.3, 2)), float(random.uniform(0.02, 0.2)))
            for _ in range(random.integers(2, 7))
        ]
    if seed % 3 == 1:
        boxes = [
            BoxSpec(
                tuple(random.uniform(-1.2, 1.2, 2)),
                (float(random.uniform(0.3, 1.2)), float(random.choice([0.02, 0.1]))),
                float(random.uniform(-3, 3)),
            )
            for _ in range(random.integers(1, 5))
        ]
    if seed % 3 == 2:
        x, gap, y = random.uniform([-0.4, 0.7, -0.5], [0.4, 1.2, 0.5]).tolist()
        up, down = 1.5 - y - 0.5 * gap, 1.5 + y - 0.5 * gap
        boxes = [
            BoxSpec((x, 1.5 - 0.5 * up), (0.1, up)),
            BoxSpec((x, -1.5 + 0.5 * down), (0.1, down)),
        ]
    room = EnvironmentSpec(size, tuple(boxes), tuple(circles), resolution=(0.01, 0.02)[seed % 2])
    discs = random.uniform([-1.2, -1.2, 0.05], [1.2, 1.2, 0.05], (2 * (seed % 5 == 0), 3))
    start, goal = random.uniform([-1.7, -1.2, -3.1], [1.7, 1.2, 3.1], (2, 3))
    if seed % 7 == 0:
        goal[2] = math.nan
    return room, discs, start, goal, float(random.choice([0.05, 0.102, 0.13]))


def exact_room(room, discs, outline, pose):
    """By another library; no grid."""
    body = shapely.Polygon(se2.transform(pose, outline))
    away = 9.0
    for box in room.boxes:
        x, y = 0.5 * np.array(box.size)
        flat = affinity.rotate(shapely.box(-x, -y, x, y), box.yaw, (0, 0), use_radians=True)
        away = min(away, body.distance(affinity.translate(flat, *box.centre)))
    x, y = 0.5 * np.array(room.size)
    away = min(away, shapely.box(-x, -y, x, y).exterior.distance(body))
    solid = [(*c.centre, c.radius) for c in room.circles] + discs.tolist()
    return min([away, *(body.distance(shapely.Point(a, b)) - r for a, b, r in solid)])


def check(seeds):
    """Ways keep what was asked for between any poses; how many were found, of how many."""
    found = bent = tried = 0
    for seed in seeds:
        room, discs, start, goal, need = problem(seed)
        outline = load_object(BODIES[seed % 4]).geometry.outline
        end = np.array([*goal[:2], start[2]]) if math.isnan(goal[2]) else goal
        ends = [exact_room(room, discs, outline, p) for p in (start, end)]
        if min(ends) < need + 0.04:
            continue
        tried += 1
        finder = WayFinder(FreeSpace(rasterise(room)), outline, need)
        try:
            way = finder.way(start, goal, Obstacles(discs=discs))
        except NoObjectWay:
            continue
        found, bent = found + 1, bent + (len(way.motions) > 1)
        parts = pieces(way)
        for pose, motion in parts:
            length = math.hypot(*motion[:2]) + 0.3 * abs(motion[2])
            poses = screw_poses(pose, motion, np.linspace(0.0, 1.0, 2 + int(length / 0.02)))
            assert min(exact_room(room, discs, outline, p) for p in poses) >= need - 1e-9, seed
        last = screw_poses(*parts[-1], np.ones(1))[0]
        assert np.hypot(*(last - goal)[:2]) < 1e-9
        assert math.isnan(goal[2]) or abs(se2.wrap(float(last[2] - goal[2]))) < 1e-9
    print(f"{found} of {tried} found, {bent} of more than one piece")
    return found, bent, tried


def test_ways_keep_the_room_that_was_asked_for():
    found, bent, tried = check(range(60))
    assert tried > 20 and found >= 0.9 * tried and bent > 8


@pytest.mark.study
def test_ways_keep_the_room_that_was_asked_for_on_many_maps():
    found, bent, tried = check(range(60, 1000))
    assert tried > 300 and found >= 0.9 * tried and bent > 120


def snake(size, resolution=0.02):
    """Walls from alternate sides: the way leads up and down the room."""
    half = 0.5 * size
    boxes = tuple(
        BoxSpec((x * half, side * 0.15 * half), (0.1, 0.85 * size))
        for x, side in ((-0.6, 1), (-0.2, -1), (0.2, 1), (0.6, -1))
    )
    room = EnvironmentSpec((size, size), boxes, resolution=resolution)
    start, goal = (np.array([s * 0.8 * half, s * 0.8 * half, 0.3]) for s in (-1, 1))
    return FreeSpace(rasterise(room)), start, goal


def test_a_search_in_slices_finds_what_it_finds_at_once_and_a_slice_is_short():
    space, start, goal = snake(8.0)
    outline = load_object("transport_l").geometry.outline
    at_once = WayFinder(space, outline, 0.12).way(start, goal, FREE)
    for budget in (100, 2500):
        finder = WayFinder(space, outline, 0.12)
        search, count = finder.search(start, goal, FREE), 1
        while not search.step(budget):
            count += 1
        assert np.array_equal(search.way.motions, at_once.motions)
        assert count > (100 if budget == 100 else 5)
    # again, where the room at poses is known already
    assert np.array_equal(finder.way(start, goal, FREE).motions, at_once.motions)
    length = sum(math.hypot(*motion[:2]) for motion in at_once.motions)
    assert 4 * 0.6 * 8.0 < length < 4 * 8.0  # up and down four times


def test_that_there_is_no_way_is_known_without_looking_at_every_pose():
    room = EnvironmentSpec((16.0, 16.0), (BoxSpec((0.0, 0.0), (0.1, 16.0)),), resolution=0.02)
    outline = load_object("transport_square").geometry.outline
    finder = WayFinder(FreeSpace(rasterise(room)), outline, 0.12)
    search, count = finder.search(np.array([-3.0, 0, 0]), np.array([3.0, 0, 0]), FREE), 1
    while not search.step(2500):
        count += 1
    with pytest.raises(NoObjectWay, match="no way for the object"):
        _ = search.way
    assert count < 20  # of a budget of 2500: a million poses are on this side of the wall
