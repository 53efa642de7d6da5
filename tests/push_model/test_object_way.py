"""Motions with one twist, and ways of them round obstacles."""

import math

import numpy as np
import pytest

from push_model import se2
from push_model.free_space import FreeSpace, Obstacles
from push_model.object_way import NoObjectWay, WayFinder, pieces
from push_model.occupancy import OccupancyGrid, rasterise
from push_model.screws import screw_between, screw_poses
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object

PLATE = load_object("plate_hexagon").geometry.outline


def test_a_screw_leads_from_pose_to_pose_with_one_twist():
    random = np.random.default_rng(1)
    for _ in range(500):
        start, goal = random.uniform(-2.0, 2.0, (2, 3)) * [1.0, 1.0, 1.5]
        motion = screw_between(start, goal)
        ends = screw_poses(start, motion, np.array([0.0, 1.0]))
        assert ends[0] == pytest.approx(start, abs=1e-12) and abs(motion[2]) <= math.pi + 1e-9
        assert se2.between(goal, ends[1]) == pytest.approx(np.zeros(3), abs=1e-9)
        half = screw_poses(start, motion, np.array([0.5]))[0]
        assert screw_between(start, half) == pytest.approx(0.5 * motion, abs=1e-9)


def test_ways_keep_their_room_and_lead_to_the_goal():
    random = np.random.default_rng(3)
    found = several = 0
    for _ in range(40):
        circles = tuple(
            {"centre": tuple(random.uniform(-1.5, 1.5, 2)), "radius": random.uniform(0.08, 0.2)}
            for _ in range(4)
        )
        space = FreeSpace(rasterise(EnvironmentSpec((4.0, 3.0), resolution=0.02, circles=circles)))
        finder = WayFinder(space, PLATE, 0.13)
        start, goal = random.uniform(-1.0, 1.0, (2, 3)) * [1.6, 1.1, math.pi]
        if finder.clearance(np.array([start, goal]), Obstacles()).min() < 0.14:
            continue
        try:
            way = finder.way(start, goal, Obstacles())
        except NoObjectWay:
            continue
        found += 1
        several += len(way.motions) > 1
        parts = pieces(way)
        for pose, motion in parts:
            poses = screw_poses(pose, motion, np.linspace(0.0, 1.0, 200))
            assert finder.clearance(poses, Obstacles()).min() > 0.125
        end = screw_poses(*parts[-1], np.ones(1))[0]
        assert se2.between(goal, end) == pytest.approx(np.zeros(3), abs=1e-6)
    assert found > 15 and several > 3


def test_no_way_through_a_gap_that_is_too_narrow_and_none_from_a_corner():
    occupied = np.zeros((100, 200), dtype=bool)
    occupied[:35, 100] = occupied[65:, 100] = True  # 60 cm
    space = FreeSpace(OccupancyGrid(occupied, 0.02, np.array([-2.0, -1.0])))
    start, goal = np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    with pytest.raises(NoObjectWay, match=r"no way for the object with 0\.13 m"):
        WayFinder(space, PLATE, 0.13).way(start, goal, Obstacles())
    assert len(WayFinder(space, PLATE, 0.06).way(start, goal, Obstacles()).motions) >= 1
    with pytest.raises(NoObjectWay, match="where the object is to go"):
        WayFinder(space, PLATE, 0.13).way(start, np.array([1.95, 0.75, 0.0]), Obstacles())


def test_an_object_beside_something_only_comes_away_from_it():
    space = FreeSpace(rasterise(EnvironmentSpec((4.0, 3.0), resolution=0.02)))
    finder = WayFinder(space, PLATE, 0.13)
    reach = float(PLATE[:, 0].max())
    robot = np.array([[-reach - 0.056, 0.0, 0.05]])  # 6 mm from it
    beside = Obstacles(discs=robot)
    assert finder.keeps(np.zeros(3), np.array([0.5, 0.0, 0.0]), beside)
    assert not finder.keeps(np.zeros(3), np.array([-0.5, 0.0, 0.0]), beside)
    assert not finder.keeps(np.zeros(3), np.array([-0.003, 0.0, 0.0]), beside)
