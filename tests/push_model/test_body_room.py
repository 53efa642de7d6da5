"""The room of bodies at poses and on motions, against another library's exact geometry."""

import math

import numpy as np
import pytest
import shapely
from shapely import affinity

from push_model.body_room import LEAST, Body, motion_keeps, rooms_at_poses
from push_model.distance_field import DistanceField
from push_model.obstacles import NOTHING, Obstacles
from push_model.occupancy import rasterise
from push_model.screws import screw_poses
from push_model.shapes import flower, polygon, rectangle
from push_model.specs import BoxSpec, CircleSpec, EnvironmentSpec

BODIES = {
    "plate": rectangle(0.5, 0.35).outline,
    "slim": rectangle(0.6, 0.02).outline,
    "l": polygon(
        np.array([[0, 0], [0.4, 0], [0.4, 0.1], [0.1, 0.1], [0.1, 0.4], [0, 0.4]])
    ).outline,
    "flower": flower(0.2, 0.08, 5).outline,
}
SIZE = 3.0


def world(random, resolution):
    """Pillars of 1 to 20 cm, and walls, some of them a centimetre thick."""
    circles = tuple(
        CircleSpec(tuple(random.uniform(-1.4, 1.4, 2)), float(random.uniform(0.01, 0.2)))
        for _ in range(random.integers(3, 12))
    )
    boxes = tuple(
        BoxSpec(
            tuple(random.uniform(-1.3, 1.3, 2)),
            (float(random.uniform(0.2, 1.5)), float(random.choice([0.01, 0.02, 0.1]))),
            float(random.uniform(-3, 3)),
        )
        for _ in range(random.integers(0, 3))
    )
    return EnvironmentSpec((SIZE, SIZE), boxes, circles, resolution=resolution)


def solid(environment):
    """All that stands in a room but circles, and what is outside of it."""
    half = 0.5 * SIZE
    shapes = [shapely.box(-9, -9, 9, 9).difference(shapely.box(-half, -half, half, half))]
    for box in environment.boxes:
        flat = affinity.rotate(
            shapely.box(*(-0.5 * np.array(box.size)), *(0.5 * np.array(box.size))),
            box.yaw,
            (0, 0),
            use_radians=True,
        )
        shapes.append(affinity.translate(flat, *box.centre))
    return shapely.union_all(shapes)


def exact(environment, body):
    """Distance of a body from everything; circles by their radius."""
    away = body.distance(solid(environment))
    for circle in environment.circles:
        away = min(away, max(0.0, body.distance(shapely.Point(circle.centre)) - circle.radius))
    return away


def placed(outline, pose):
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return shapely.Polygon(outline @ np.array([[c, s], [-s, c]]) + pose[:2])


@pytest.mark.parametrize("name", list(BODIES))
def test_room_is_never_over_estimated_and_hardly_under_estimated(name):
    """2400 poses in all, one in four of them upon a pillar: what stands inside counts."""
    random, outline = np.random.default_rng(len(name)), BODIES[name]
    body, lacking, upon = Body.of(outline), [], 0
    for k in range(20):
        resolution = (0.01, 0.02)[k % 2]
        environment = world(random, resolution)
        field = DistanceField(rasterise(environment))
        poses = random.uniform([-1.3, -1.3, -math.pi], [1.3, 1.3, math.pi], (30, 3))
        # upon pillars: some point inside the outline lies on its middle
        for pose in poses[::4]:
            circle = environment.circles[random.integers(len(environment.circles))]
            c, s = math.cos(pose[2]), math.sin(pose[2])
            x, y, _ = body.cover[random.integers(len(body.cover))]
            pose[:2] = circle.centre - np.array([c * x - s * y, s * x + c * y])
        told = rooms_at_poses(body.among(field, NOTHING), poses)
        true = np.array([exact(environment, placed(outline, p)) for p in poses])
        assert (told <= true + 1e-9).all()
        assert (told[::4] == 0.0).all()
        upon += int((true[::4] == 0.0).sum())
        # a cell that an obstacle touches counts whole: a diagonal; then the interpolation
        lacking.extend((true - told) / resolution)
    assert upon == 20 * 8
    print(f"{name}: under-estimated by {max(lacking):.2f} cells, mean {np.mean(lacking):.3f}")
    assert max(lacking) < math.sqrt(2.0) + 0.1 and np.mean(lacking) < 0.5


def test_small_pillars_anywhere_inside_the_plate_are_seen():
    """Of single cells of 1 cm, at every depth."""
    random, outline = np.random.default_rng(3), BODIES["plate"]
    body = Body.of(outline)
    for _ in range(300):
        pose = np.array([*random.uniform(-1.0, 1.0, 2), random.uniform(-3.0, 3.0)])
        depth = random.uniform(0.008, 0.17)
        x = random.choice([-1.0, 1.0]) * (0.25 - depth)
        spot = [x, random.uniform(-0.175 + depth, 0.175 - depth)]
        c, s = math.cos(pose[2]), math.sin(pose[2])
        centre = pose[:2] + [c * spot[0] - s * spot[1], s * spot[0] + c * spot[1]]
        pillar = CircleSpec(tuple(centre), 0.004)
        field = DistanceField(rasterise(EnvironmentSpec((SIZE, SIZE), (), (pillar,))))
        assert rooms_at_poses(body.among(field, NOTHING), pose[None])[0] == 0.0


@pytest.mark.long
def test_room_from_discs_and_outlines_that_are_not_on_the_map_is_exact():
    random = np.random.default_rng(4)
    field = DistanceField(rasterise(EnvironmentSpec((9.0, 9.0), resolution=0.05)))
    inside = 0
    for k in range(400):
        outline = BODIES[list(BODIES)[k % 4]]
        pose = random.uniform([-0.5, -0.5, -3], [0.5, 0.5, 3])
        discs = np.column_stack([random.uniform(-1, 1, (3, 2)), random.uniform(0.01, 0.2, 3)])
        other = placed(BODIES["l"], random.uniform([-1, -1, -3], [1, 1, 3]))
        if k % 3 == 0:
            other = affinity.scale(other, 9.0, 9.0)
        ring = np.array(other.exterior.coords)[:-1]
        told = rooms_at_poses(Body.of(outline).among(field, Obstacles((ring,), discs)), pose[None])
        body = placed(outline, pose)
        true = body.distance(other)
        inside += other.contains(body)
        for x, y, radius in discs:
            true = min(true, max(0.0, body.distance(shapely.Point(x, y)) - radius))
        assert told[0] == pytest.approx(true, abs=1e-9)
    assert inside > 10


def test_nothing_on_a_motion_is_missed_however_long_it_is():
    """Against the same at poses half a millimetre apart; walls a centimetre thick among them."""
    random = np.random.default_rng(5)
    kept = refused = looked = 0
    for k in range(150):
        field = DistanceField(rasterise(world(random, 0.02)))
        outline = BODIES[list(BODIES)[k % 3]]
        around = Body.of(outline).among(field, NOTHING)
        start = random.uniform([-1.2, -1.2, -3], [1.2, 1.2, 3])
        motion = random.uniform([-1.0, -1.0, -2.0], [1.0, 1.0, 2.0]) * random.choice([0.2, 1.0])
        need = float(random.choice([0.01, 0.05, 0.1]))
        told, count = motion_keeps(around, start, motion, need, False)
        length = math.hypot(*motion[:2]) + 0.3 * abs(motion[2])
        parts = np.linspace(0.0, 1.0, 2 + int(length / 5e-4))
        rooms = rooms_at_poses(around, screw_poses(start, motion, parts))
        least = min(need, rooms[0] - 2e-3, rooms[-1] - 2e-3)
        if told:
            kept, looked = kept + 1, looked + count
            assert rooms.min() >= max(least, LEAST - 1e-3) - 1e-9
        elif rooms.min() >= need + 2e-3:
            pytest.fail("a motion with room all along was refused")
        else:
            refused += 1
    print(f"kept {kept} refused {refused}, {looked / kept:.0f} poses looked at each")
    assert kept > 20 and refused > 50
