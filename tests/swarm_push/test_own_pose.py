"""Where a robot believes that it is on its map: against the textbook's filter, and how well."""

import math
from dataclasses import replace

import numpy as np
import pytest

from push_model import se2
from push_model.free_space import FreeSpace
from push_model.occupancy import rasterise
from push_scenario.bodies import load_object, load_robot
from push_study.swarm.maps import MAPS, drawn, load_map
from swarm_push.own_pose import OwnPose, OwnPoseSettings
from swarm_push.robot_sensor import RobotSensor, RobotSensorSettings
from swarm_push.wall_sides import wall_sides

SQUARE, RADIUS = load_object("transport_square"), load_robot("epuck_ring").footprint_radius
GRIDS = {name: rasterise(load_map(name)) for name in MAPS}
SPACES = {name: FreeSpace(grid) for name, grid in GRIDS.items()}
SIDES = {name: wall_sides(grid) for name, grid in GRIDS.items()}
FAR = np.array([50.0, 50.0, 0.0])


def placed(name, seed, count):
    """Poses of robots at random places of a map."""
    return drawn(name, SQUARE, seed, count, turned=False)[2]


@pytest.mark.long
@pytest.mark.parametrize(("factor", "most", "turned"), [(1.0, 0.03, 0.03), (3.0, 0.06, 0.06)])
def test_a_robot_keeps_its_place_on_the_map(factor, most, turned):
    """200 robots walk 40 steps of 4 cm and turn: with errors at the start and of the sensor, and
    with three times these."""
    s = OwnPoseSettings()
    noisy = RobotSensorSettings()
    noisy = replace(
        noisy,
        distance_error=factor * noisy.distance_error,
        least_error=factor * noisy.least_error,
        odometry_error=factor * noisy.odometry_error,
    )
    worst = np.zeros(2)
    for seed in range(5):
        name = list(MAPS)[seed % 4]
        robots = placed(name, seed, 40)
        random = np.random.default_rng(seed)
        sides = SIDES[name]
        look = RobotSensor(SQUARE.geometry.outline, (3.0, 3.0), noisy, seed, sides)
        deviations = factor * np.array([s.start_position, s.start_position, s.start_heading])
        told = robots + random.normal(size=robots.shape) * deviations
        own = [OwnPose(sides, place, noisy.odometry_error, s) for place in told]
        for _ in range(40):
            walked = np.array([se2.compose(r, np.array([0.04, 0.0, 0.0])) for r in robots])
            free = SPACES[name].clearance(walked[:, :2]) > RADIUS
            walked[~free] = robots[~free]
            walked[:, 2] += random.normal(size=len(robots)) * 0.2
            robots = walked
            for pose, reading in zip(own, look.look(FAR, robots, np.ones(2)), strict=True):
                pose.step(reading.moved, reading.walls)
        off = np.array([p.pose for p in own]) - robots
        worst = np.maximum(
            worst, [np.hypot(*off[:, :2].T).max(), np.abs(se2.wrap(off[:, 2])).max()]
        )
    assert worst[0] < most and worst[1] < turned, worst


def innovations(sides, pose, scan, gate):
    """Numbers of the points and of their sides, and the points' distances from these: each from the
    nearest of all sides that face the robot, if this is not in doubt as it is beyond a corner."""
    start, unit = sides[:, 0], sides[:, 1] - sides[:, 0]
    length = np.hypot(*unit.T)
    unit = unit / length[:, None]
    normal = np.column_stack([-unit[:, 1], unit[:, 0]])
    to = se2.transform(pose, scan)[:, None] - start
    along, across = (to * unit).sum(axis=2), (to * normal).sum(axis=2)
    away = np.hypot(across, np.maximum(0.0, np.maximum(-along, along - length)))
    away[:, ((pose[:2] - start) * normal).sum(axis=1) <= 0.0] = math.inf
    best, ordered = away.argmin(axis=1), np.sort(away, axis=1)
    used = np.flatnonzero((ordered[:, 0] < gate) & (ordered[:, 0] < ordered[:, 1] - 1e-6))
    return used, best[used], across[used, best[used]]


def test_the_filter_of_the_pose_is_that_of_kalman():
    """60 steps against the textbook's form: with a gain, and derivatives from differences."""
    s, slip, least = OwnPoseSettings(), 0.02, np.array([2e-4, 2e-4, 5e-4])
    for seed in range(60):
        name, random = list(MAPS)[seed % 4], np.random.default_rng(seed)
        robots = placed(name, seed, 1)
        sides = SIDES[name]
        look = RobotSensor(SQUARE.geometry.outline, (3.0, 3.0), RobotSensorSettings(), seed, sides)
        (reading,) = look.look(FAR, robots, np.ones(2))
        own, moved = OwnPose(sides, robots[0], slip, s), random.normal(size=3) * [0.02, 0.02, 0.1]
        own.pose = robots[0] + random.normal(size=3) * [0.02, 0.02, 0.03]
        before, covariance = own.pose.copy(), own.covariance.copy()
        pose = se2.compose(before, moved)
        used, mine, off = innovations(sides, pose, reading.walls, s.gate)
        scan = reading.walls[used]
        own.step(moved, scan)

        def moves(pose, moved=moved):
            return se2.compose(pose, moved)

        def distances(pose, mine=sides[mine], scan=scan):
            unit = (mine[:, 1] - mine[:, 0]) / np.hypot(*(mine[:, 1] - mine[:, 0]).T)[:, None]
            to = se2.transform(pose, scan) - mine[:, 0]
            return unit[:, 0] * to[:, 1] - unit[:, 1] * to[:, 0]

        ways = np.array([np.hypot(*moved[:2])] * 2 + [abs(moved[2])])
        step = derivative(moves, before)
        covariance = step @ covariance @ step.T + np.diag((least + slip * ways) ** 2)
        h = derivative(distances, pose)
        gain = covariance @ h.T
        gain = gain @ np.linalg.inv(h @ gain + s.scan_error**2 * np.eye(len(h)))
        wrong = own.pose - (pose - gain @ off)
        assert len(scan) > 20 and np.allclose(distances(pose), off)
        assert [*wrong[:2], se2.wrap(wrong[2])] == pytest.approx([0.0, 0.0, 0.0], abs=1e-7)
        assert np.allclose(own.covariance, (np.eye(3) - gain @ h) @ covariance, atol=1e-10)


def derivative(function, pose):
    """By the pose, from differences; far from a heading of 180 degrees."""
    steps = 1e-6 * np.eye(3)
    return np.column_stack([(function(pose + d) - function(pose - d)) / 2e-6 for d in steps])
