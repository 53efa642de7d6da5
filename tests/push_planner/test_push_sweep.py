"""What a push sweeps, against exact geometry at dense samples: never overestimated."""

from dataclasses import replace

import numpy as np
import pytest

from push_model import se2
from push_model.kinematics import unicycle_step
from push_model.occupancy import rasterise
from push_model.shape_specs import PolygonShape, RectangleShape
from push_model.shapes import densified
from push_model.specs import BoxSpec, EnvironmentSpec
from push_planner import DistanceField, PlannerSettings, PushCurve, PushScene, shortest_push_curve
from push_planner.push_sweep import room_behind, rooms_behind
from push_planner.scene import TURNING
from tests.push_planner.exact_geometry import body_distance, placed, points_distance, random_world
from tests.samples import mostly_long

CELL = 0.01
LONG = RectangleShape(0.22, 0.05)
CORNER = PolygonShape(
    ((0.0, 0.0), (0.12, 0.0), (0.12, 0.04), (0.04, 0.04), (0.04, 0.1), (0.0, 0.1))
)


def bent_push(random, start, side):
    """Where a push from a robot pose may end, bent by up to what is trusted, and a little off."""
    length, limits = random.uniform(0.05, 0.6), side.trusted
    turn = length * random.uniform(0.9 * limits.minimum, 0.9 * limits.maximum)
    end = unicycle_step(start, length, turn, 1.0)
    return end + random.normal(0.0, 0.002, 3)


def swept(world, scene, curve, side, count):
    """Exact clearance of robot and object at so many poses of a push."""
    points, heading, _ = curve.sample(count)
    robots = np.column_stack([points, heading])
    items = np.array([se2.compose(pose, side.grasp) for pose in robots])
    least = body_distance(world, placed(robots, scene.robot.outline)).min()
    if scene.shape.convex:
        return min(least, body_distance(world, placed(items, scene.shape.outline)).min())
    outline = densified(scene.shape.outline, 0.004)
    return min(least, points_distance(world, placed(items, outline)).min())


@pytest.mark.parametrize(("shape", "number"), mostly_long([(None, 1), (LONG, 2), (CORNER, 3)], 1))
def test_no_push_is_clearer_than_exact_geometry_says(robot, box, shape, number):
    """Hundreds of pushes that touch nothing, in random worlds, as bent as they may be."""
    random = np.random.default_rng(number)
    item = box if shape is None else replace(box, shape=shape, mass=0.05)
    lacking, tight = [], 0
    for count in range(24):
        world = random_world(random, 1 + count % 8, CELL)
        scene = PushScene(DistanceField(rasterise(world)), robot, item, PlannerSettings())
        for _ in range(20):
            side = scene.sides[random.integers(len(scene.sides))]
            start = random.uniform([-1.2, -0.8, -np.pi], [1.2, 0.8, np.pi])
            end = bent_push(random, start, side)
            curve = shortest_push_curve(start, end, side.trusted.minimum, side.trusted.maximum)
            if curve is None:
                continue
            found = scene.curve_clearance(curve, side, 1e-6)
            if found < 1e-6:
                continue
            exact = swept(world, scene, curve, side, max(20, int(curve.length / 0.004)))
            lacking.append(exact - found)
            tight += exact < 0.03
    lacking = np.array(lacking)
    print(f"{len(lacking)} pushes, {tight} tight: lacking {lacking.min():.6f} to "
          f"{lacking.max():.6f}, mean {lacking.mean():.6f}")  # fmt: skip
    assert len(lacking) > 200 and tight > 6
    assert lacking.min() > -1e-9
    assert lacking.max() < (np.sqrt(2.0) + 0.05) * CELL + 0.001
    assert lacking.mean() < 0.6 * CELL


@pytest.mark.long
def test_no_post_slips_through_between_two_poses(robot, box):
    """A post of a cell, 3 mm to 20 mm beside what the corner of a turning object sweeps."""
    random = np.random.default_rng(4)
    field = DistanceField(rasterise(EnvironmentSpec((2.0, 2.0))))
    empty = PushScene(field, robot, box, PlannerSettings())
    asked = 0
    for _ in range(150):
        side = empty.sides[random.integers(len(empty.sides))]
        start = np.array([0.0, 0.0, random.uniform(-np.pi, np.pi)])
        end = bent_push(random, start, side)
        curve = shortest_push_curve(start, end, side.trusted.minimum, side.trusted.maximum)
        if curve is None:
            continue
        points, heading, _ = curve.sample(400)
        items = np.array([se2.compose(p, side.grasp) for p in np.column_stack([points, heading])])
        corners = placed(items, box.geometry.outline)
        moment, corner = random.integers(400), random.integers(4)
        away = corners[moment, corner] - items[moment, :2]
        spot = corners[moment, corner] + random.uniform(0.01, 0.03) * away / np.hypot(*away)
        world = EnvironmentSpec((2.0, 2.0), (BoxSpec(tuple(spot), (0.006, 0.006), 0.3),))
        scene = PushScene(DistanceField(rasterise(world)), robot, box, PlannerSettings())
        exact = swept(world, scene, curve, side, 300)
        assert scene.curve_clearance(curve, side, -1.0) <= exact + 1e-9
        asked += exact > 0.0
    assert asked > 80


def test_a_curve_that_nearly_stops_is_not_trusted(robot, box):
    """At a cusp the heading jumps: as little is said as is sure, after a bounded effort."""
    scene = PushScene(
        DistanceField(rasterise(EnvironmentSpec((2.0, 2.0)))), robot, box, PlannerSettings()
    )
    curve = PushCurve(np.zeros(3), np.array([0.3, 0.0, np.pi]), 0.9, 0.9, 0.5)
    for k in np.linspace(0.5, 1.5, 41):
        bent = replace(curve, k_start=float(k), k_end=float(k))
        found = scene.curve_clearance(bent, scene.sides[0], -1.0)
        points, heading, _ = bent.sample(2001)
        exact = min(scene.robot_clearance(p) for p in np.column_stack([points, heading])[::10])
        assert 0.0 <= found <= exact + 1e-6


@pytest.mark.long
def test_robots_that_have_room_behind_keep_the_distance_all_the_way(robot, box):
    """1200 poses in contact: clear of what is solid wherever they back off."""
    random = np.random.default_rng(5)
    settings = PlannerSettings()
    has = hasnt = 0
    for count in range(20):
        world = random_world(random, 3 + count % 9, CELL)
        scene = PushScene(DistanceField(rasterise(world)), robot, box, settings)
        poses = random.uniform([-1.4, -0.9, -np.pi], [1.4, 0.9, np.pi], (60, 3))
        side = replace(scene.sides[0], depth=float(random.choice([0.0, 0.05, 0.15])))
        found = scene.rooms(poses, side)
        # Where it turns, a quarter of that distance besides its own size.
        enough = robot.footprint_radius + 0.25 * settings.safety_distance
        loss = (np.sqrt(2.0) + 0.1) * CELL
        may = np.zeros(len(poses), dtype=bool)
        for back in scene.backs(side):
            ways = np.repeat(poses, 24, axis=0)
            away = np.tile(np.linspace(0.0, back, 24), len(poses))
            ways[:, 0] -= away * np.cos(ways[:, 2])
            ways[:, 1] -= away * np.sin(ways[:, 2])
            exact = body_distance(world, placed(ways, robot.outline)).reshape(-1, 24).min(axis=1)
            turning = points_distance(world, ways.reshape(-1, 24, 3)[:, -1, :2])
            may |= (exact >= settings.safety_distance - 1e-9) & (turning >= enough - 1e-9)
            plenty = (exact > settings.safety_distance + loss) & (turning > enough + loss)
            assert found[plenty].all()
        assert may[found].all()
        has += found.sum()
        hasnt += (~found).sum()
    assert has > 150 and hasnt > 150


def test_room_behind_is_that_of_the_robot_at_every_distance(scenario, robot, box):
    scene = PushScene(DistanceField(scenario.grid), robot, box, PlannerSettings())
    x0, x1, y0, y1 = scene.field.grid.extent
    _, points, _, radius, backs = scene.bodies
    turning = robot.footprint_radius + TURNING * scene.settings.safety_distance
    keeps, known = scene.robot_keeps(), (scene.field.values, points)
    poses = np.random.default_rng(6).uniform([x0, y0, -np.pi], [x1, y1, np.pi], (2000, 3))
    free = 0
    for pose in poses:
        back = float(backs[0, 0])
        found = room_behind(pose, back, turning, keeps, *known, radius, *scene.field.args)
        slow = rooms_behind(pose[None], back, turning, keeps, *known, *scene.field.args)[0]
        assert found or not slow
        if found:
            way = [se2.compose(pose, np.array([-b, 0.0, 0.0])) for b in np.linspace(0, back, 61)]
            assert min(scene.robot_clearance(p) for p in way) >= keeps - 5e-4
            assert scene.field.at(*way[-1][:2]) >= turning - 1e-9
            free += 1
    assert 300 < free < 1900
