"""Walls of a map: where robots have room, their ways round corners, and objects' ways."""

import math

import numpy as np
import pytest
import shapely

from push_model import se2
from push_model.jobs import JobError
from push_model.object_way import NoObjectWay
from push_model.occupancy import rasterise
from push_model.specs import BoxSpec, EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from push_study.swarm.maps import MAPS, MapTask, load_map, run
from swarm_push.object_track import ObjectTrack, TrackSettings
from swarm_push.region import covered_region, is_open
from swarm_push.swarm_job import SwarmJob, SwarmJobSettings
from swarm_push.walls import Walls
from tests.samples import slice_and_study

R = 0.05
NONE = np.zeros((0, 3))


def solid(room):
    """Free places of a room's centre of a robot, by another library."""
    x, y = 0.5 * np.array(room.size)
    boxes = [
        shapely.box(*(np.array(b.centre) - 0.5 * np.array(b.size)),
                    *(np.array(b.centre) + 0.5 * np.array(b.size)))
        for b in room.boxes
    ]  # fmt: skip
    return shapely.box(-x, -y, x, y).difference(shapely.union_all(boxes))


@pytest.mark.parametrize("name", list(MAPS))
def test_places_and_lines_are_clear_as_another_library_says(name):
    room = load_map(name)
    walls, free = Walls(rasterise(room), R), solid(room)
    random = np.random.default_rng(1)
    points = random.uniform(-1.6, 1.6, (1000, 2))
    said = walls.free(points)
    away = np.array([free.exterior.distance(shapely.Point(p)) for p in points])
    away = np.minimum(away, [free.boundary.distance(shapely.Point(p)) for p in points])
    inside = np.array([free.contains(shapely.Point(p)) for p in points])
    clear = inside & (away > R)
    assert not (said & ~clear).any()  # never said to be free that is not
    assert (said | ~(inside & (away > R + 0.02))).all()
    moved = walls.into_room(points)
    assert walls.free(moved).all() and np.array_equal(moved[said], points[said])
    here, there = points[said][::2], points[said][1::2]
    n = min(len(here), len(there))
    seen = walls.sees(here[:n], there[:n])
    lines = [shapely.LineString([a, b]) for a, b in zip(here[:n], there[:n], strict=True)]
    gap = np.array([free.boundary.distance(line) for line in lines])
    assert not (seen & (gap < R - 0.03)).any() and (seen | (gap < R + 0.03)).all()


def test_robots_come_round_corners_to_the_object_and_never_into_a_wall():
    for name in ("transport_middle", "transport_two_corners"):
        room = load_map(name)
        walls, free = Walls(rasterise(room), R), solid(room)
        item = np.array(MAPS[name][0])
        random = np.random.default_rng(2)
        robots = random.uniform(-1.4, 1.4, (200, 2))
        robots = robots[walls.free(robots)]
        gone, goal = np.zeros(len(robots)), np.repeat(item[None], len(robots), axis=0)
        straight = np.hypot(*(goal - robots).T)
        for _ in range(10):  # ways are looked for in slices
            first = walls.round_corners(robots, goal, straight, item)[1]
        for _ in range(400):
            aims, _ = walls.round_corners(robots, goal, straight, item)
            step = aims - robots
            step *= np.minimum(1.0, 0.02 / np.maximum(np.hypot(*step.T), 1e-9))[:, None]
            robots, gone = robots + step, gone + np.hypot(*step.T)
        assert np.hypot(*(robots - item).T).max() < 1e-6
        assert (gone < 1.1 * first + 0.1).all()
        assert all(free.contains(shapely.Point(p)) for p in robots)


def test_no_robot_is_let_into_a_wall():
    room = load_map("transport_middle")
    walls, free = Walls(rasterise(room), R), solid(room)
    random = np.random.default_rng(3)
    points = random.uniform(-1.45, 1.45, (500, 2))
    points = points[walls.free(points)]
    velocities = random.uniform(-0.2, 0.2, points.shape)
    for _ in range(500):
        bound = walls.bounds(points, 3.0, 4e-3)
        excess = np.maximum((velocities * bound[:, :2]).sum(axis=1) - bound[:, 2], 0.0)
        points = points + 0.02 * (velocities - excess[:, None] * bound[:, :2])
    away = [free.boundary.distance(shapely.Point(p)) for p in points]
    assert min(away) > R - 2e-3 and all(free.contains(shapely.Point(p)) for p in points)


@pytest.mark.long
def test_a_track_leads_to_its_target_with_room_for_robots_all_the_way():
    random = np.random.default_rng(4)
    for name, (start, goal) in MAPS.items():
        for item in ("transport_square", "transport_l", "transport_rectangle"):
            outline = load_object(item).geometry.outline
            room = load_map(name)
            track, free = ObjectTrack(rasterise(room), outline, R, TrackSettings()), solid(room)
            pose = np.array([*start, random.uniform(-math.pi, math.pi)])
            target = np.array([*goal, random.choice([math.nan, random.uniform(-3.0, 3.0)])])
            assert track.fits(pose) and track.fits(target)
            track.plan(pose, target, NONE)
            before = track.left(pose)
            for _ in range(4000):
                aim, off = track.aim(pose)
                assert off < 0.06
                turn = 0.0 if math.isnan(aim[2]) else se2.wrap(float(aim[2] - pose[2]))
                step = np.array([*(aim - pose)[:2], turn])
                pose = pose + step * min(1.0, 0.005 / max(np.hypot(*step[:2]), 1e-9))
                body = shapely.Polygon(se2.transform(pose, outline))
                # corners and bends are cut a little, and the end may be close to a wall
                away = free.boundary.distance(body)
                assert away > 2.0 * R - 0.04 or (away > 0.02 and track.left(pose) < 0.15)
                if track.left(pose) < 1e-6:
                    break
            assert track.left(pose) < 1e-6 < before
            assert np.hypot(*(pose - target)[:2]) < 1e-6


def test_without_a_way_there_is_no_track_and_the_job_says_so():
    shut = EnvironmentSpec((3.0, 2.0), (BoxSpec((0.5, 0.0), (0.2, 1.6)),))
    item, robot = load_object("transport_square"), load_robot("epuck_ring")
    grid = rasterise(shut)
    track = ObjectTrack(grid, item.geometry.outline, R, TrackSettings())
    with pytest.raises(NoObjectWay):
        track.plan(np.array([-1.0, 0.0, 0.0]), np.array([1.1, 0.0, 0.0]), NONE)
    assert not track.fits(np.array([0.5, 0.0, math.nan]))
    region = covered_region(grid, R)
    assert not is_open(grid)
    job = SwarmJob(region, item, robot, SwarmJobSettings(), grid=grid)
    job.begin([np.array([1.1, 0.0, math.nan])])
    robots = {"e0": np.array([-0.5, 0.0, 0.0])}
    for now in np.arange(0.0, 3.0, 0.02):
        twists = job.step(now, np.array([-1.0, 0.0, 0.0]), robots, NONE)
        if not job.busy:
            break
    assert twists == {"e0": (0.0, 0.0)} and job.error is JobError.PLANNING_FAILED
    assert now < 1.0
    assert "no way" in job.reason


@pytest.mark.parametrize(
    ("name", "item", "turned", "seed"),
    slice_and_study(
        [
            ("transport_middle", "l", True, 11),
            ("transport_corner", "circle", False, 12),
            ("transport_two_corners", "square", True, 1),
        ],
        2,
    ),
)
def test_objects_come_round_walls(tmp_path, name, item, turned, seed):
    """A slice of the experiment swarm-maps."""
    task = MapTask(
        name, seed, str(tmp_path), f"transport_{item}", 20, turned, "planar", "mild", 1200.0
    )
    row = run(task)
    assert row["success"], row["reason"]
    assert row["position_error_m"] < 0.11
    assert not turned or row["orientation_error_rad"] < 0.11
