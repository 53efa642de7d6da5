"""Rim, crescent, ways round an object, spacing: the parts of the law with a crescent."""

import math

import numpy as np
import pytest
import shapely
from scipy.optimize import linprog

from push_model import se2
from push_scenario.bodies import load_object
from swarm_push.crescent import crescent
from swarm_push.rim import Rim
from swarm_push.spacing import keep_apart
from swarm_push.way_round import WayRound

R = 0.05
NAMES = (
    "swarm_square", "swarm_ellipse", "swarm_flower", "plate_triangle", "swarm_octagon",
    "transport_plus", "transport_l", "transport_h", "transport_circle",
)  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_the_rim_is_a_radius_away_from_the_object_and_its_normals_point_at_it(name):
    outline = load_object(name).geometry.outline
    rim, body = Rim(outline, R, 0.02), shapely.Polygon(outline)
    for point in rim.points:  # places are at even distances: notches' corners are cut a little
        assert body.exterior.distance(shapely.Point(point)) == pytest.approx(R, abs=1.5e-3)
    inner = [body.exterior.distance(shapely.Point(p)) for p in rim.points + R * rim.normals]
    assert np.mean(np.array(inner) < 1.5e-3) > 0.97 and max(inner) < R
    reach = body.exterior.buffer(R, 64).exterior
    assert rim.length == pytest.approx(reach.length, rel=4e-3)
    assert max(reach.distance(shapely.Point(p)) for p in rim.points) < 1.5e-3
    steps = np.hypot(*(np.roll(rim.points, -1, axis=0) - rim.points).T)
    assert steps.max() <= 0.0201


@pytest.mark.parametrize("name", NAMES[:-1])  # a disc is turned by friction alone
def test_pushes_from_a_crescent_can_make_the_twist_that_it_is_for(name):
    """Normal forces at its places make a wrench along the limit surface's of that twist, nearly:
    what no frictionless push can make is left out."""
    item = load_object(name)
    rim, surface = Rim(item.geometry.outline, R, 0.03), item.limit_surface()
    random, lacking = np.random.default_rng(1), []
    for _ in range(60):
        twist = random.normal(size=3) * [1.0, 1.0, 1.0 / surface.radius]
        density = crescent(rim, np.zeros(3), rim.approach(twist), 0.0, 0.3)
        k = [int(np.hypot(*(rim.points - m).T).argmin()) for m in density.means]
        assert (rim.approach(twist)[k] > 0.0).all()
        wrenches = []
        for picked in (k, range(len(rim.points))):
            p, n = rim.points[list(picked)], rim.normals[list(picked)]
            touch = p + R * n
            torque = touch[:, 0] * n[:, 1] - touch[:, 1] * n[:, 0]
            wrenches.append(np.column_stack([n, torque / surface.radius]).T)
        wanted = surface.wrench(twist) / [1.0, 1.0, surface.radius]
        lacking.append([_lack(w, wanted / np.linalg.norm(wanted)) for w in wrenches])
    ours, all_round = np.array(lacking).T
    assert np.median(ours - all_round) < 0.05 and np.quantile(ours - all_round, 0.8) < 0.5


def _lack(columns, wanted):
    """Least sum of absolute differences to non-negative combinations of columns."""
    n = columns.shape[1]
    A = np.hstack([columns, np.eye(3), -np.eye(3)])
    cost = np.concatenate([np.zeros(n), np.ones(6)])
    return linprog(cost, A_eq=A, b_eq=wanted, method="highs").fun


def test_a_disc_is_turned_by_friction_all_round_and_a_square_by_its_sides():
    turn, ahead = np.array([0.0, 0.0, 0.5]), np.array([0.1, 0.0, 0.0])
    disc = Rim(load_object("transport_circle").geometry.outline, R, 0.02)
    drive = disc.drive(turn, 0.2)
    assert drive.min() > 0.15 * 0.5 * 0.2 and np.ptp(drive) < 0.2 * drive.max()
    square = Rim(load_object("swarm_square").geometry.outline, R, 0.02)
    for rim, twist in ((disc, ahead), (square, turn), (square, ahead), (disc, ahead + 0.1 * turn)):
        assert np.array_equal(rim.drive(twist, 0.2), rim.approach(twist))


def test_a_crescent_for_nothing_lies_all_round():
    rim = Rim(load_object("swarm_square").geometry.outline, R, 0.05)
    assert len(crescent(rim, np.zeros(3), np.zeros(len(rim.points)), 0.0, 0.3).means) == len(
        rim.points
    )


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_ways_round_an_object_come_to_their_ends_without_touching_it(name):
    item = load_object(name)
    body = shapely.Polygon(item.geometry.outline)
    ways, rim = WayRound(item.geometry.outline, R, 0.02, 2e-3), Rim(item.geometry.outline, R, 0.01)
    random = np.random.default_rng(2)
    far = 0.3 + random.uniform(0.0, 0.6, 40)
    angle = random.uniform(-math.pi, math.pi, 40)
    robots = far[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    goals = rim.points[random.integers(0, len(rim.points), 40)]
    lengths = ways.aims(robots, goals)[1]
    gone = np.zeros(40)
    nearest = np.full(40, np.inf)
    for _ in range(4000):
        aims, _ = ways.aims(robots, goals)
        step = aims - robots
        size = np.hypot(*step.T)
        move = step * np.minimum(1.0, 2e-3 / np.maximum(size, 1e-12))[:, None]
        robots, gone = robots + move, gone + np.hypot(*move.T)
        nearest = np.minimum(nearest, [body.distance(shapely.Point(p)) for p in robots])
    assert np.hypot(*(robots - goals).T).max() < 5e-3
    assert nearest.min() > R - 3e-3  # as they slide along it
    assert (gone < 1.25 * lengths + 0.1).all()


def test_ways_also_lead_round_what_stands_at_the_object():
    item = load_object("swarm_square")
    dead = np.array([[0.0, 0.25, R], [0.12, 0.25, R]])
    ways = WayRound(item.geometry.outline, R, 0.02, 2e-3, dead)
    robot, goal = np.array([[0.26, 0.2]]), np.array([[-0.26, 0.15]])
    for _ in range(3000):
        step = ways.aims(robot, goal)[0] - robot
        robot = robot + step * min(1.0, 2e-3 / max(np.hypot(*step[0]), 1e-12))
        assert np.hypot(*(dead[:, :2] - robot).T).min() > 2.0 * R
    assert np.hypot(*(robot - goal)[0]) < 5e-3


def simulate(velocities, points, radii, steps=400, dt=0.02):
    for _ in range(steps):
        moved = keep_apart(velocities(points), points, radii, 4e-3, 3.0, 0.1)
        points = np.vstack([points[: len(moved)] + dt * moved, points[len(moved) :]])
    return points


def test_robots_that_are_told_to_one_place_do_not_touch():
    for seed in range(20):
        random = np.random.default_rng(seed)
        n = int(random.integers(2, 12))
        angle = np.arange(n) * 2.0 * math.pi / n
        begin = 0.5 * np.column_stack([np.cos(angle), np.sin(angle)])
        begin += random.uniform(-0.02, 0.02, begin.shape)
        still = np.array([[0.0, 0.0]])
        radii = np.full(n + 1, R)

        def told(points, n=n):
            way = -points[:n]
            return 0.1 * way / np.maximum(np.hypot(*way.T), 1e-9)[:, None]

        end = simulate(told, np.vstack([begin, still]), radii)
        away = np.hypot(*(end[:, None] - end[None]).transpose(2, 0, 1))
        assert away[np.triu_indices(n + 1, 1)].min() > 2.0 * R


def test_robots_that_move_alike_or_apart_are_left_alone():
    points = np.array([[0.0, 0.0], [0.104, 0.0], [0.0, 0.104]])
    radii = np.full(3, R)
    alike = np.tile([[0.05, -0.1]], (3, 1))
    assert np.allclose(keep_apart(alike, points, radii, 4e-3, 3.0, 0.1), alike)
    apart = points - points.mean(axis=0)
    assert np.allclose(keep_apart(apart, points, radii, 4e-3, 3.0, 0.1), apart)
    assert keep_apart(alike[:1], points[:1], radii[:1], 4e-3, 3.0, 0.1) == pytest.approx(alike[:1])


def test_the_crescent_turns_with_the_object():
    rim = Rim(load_object("swarm_ellipse").geometry.outline, R, 0.03)
    pose, twist = np.array([0.3, -0.2, 1.1]), np.array([0.1, 0.02, 0.3])
    here = crescent(rim, np.zeros(3), rim.approach(twist), 0.01, 0.3)
    there = crescent(rim, pose, rim.approach(twist), 0.01, 0.3)
    assert np.allclose(there.means, se2.transform(pose, here.means))
