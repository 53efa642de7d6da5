"""A disc against an object without contact friction: the limit surface, and the planar world."""

import math
from dataclasses import replace

import numpy as np
import pytest

from push_model import se2
from push_model.outlines import distance, inside
from push_model.point_push import Disc, body, driven, gap, placed, push
from push_model.shape_specs import PolygonShape
from push_model.specs import EnvironmentSpec, ObjectSpec
from push_scenario.bodies import load_robot
from sim_bridge.planar_world import PlanarSettings, PlanarWorld

T = np.array(
    [(-0.06, 0.0), (0.06, 0.0), (0.06, 0.03), (0.015, 0.03)]
    + [(0.015, 0.12), (-0.015, 0.12), (-0.015, 0.03), (-0.06, 0.03)]
)
ITEM = ObjectSpec(PolygonShape(tuple(map(tuple, T))), 0.1, 0.05, 0.3, 0.0)
OUTLINE = ITEM.geometry.outline
SURFACE = ITEM.limit_surface()
GYRATION = SURFACE.max_torque / SURFACE.max_force
DISC = Disc(0.015, 100.0, 20.0, 0.01, 0.06, 1e-4)


def contacts(random, count):
    """Places ``(n, 2)`` beside the outline, a disc's radius away, and inward normals."""
    places, normals = [], []
    while len(places) < count:
        k = random.integers(len(OUTLINE))
        a, b = OUTLINE[k], OUTLINE[(k + 1) % len(OUTLINE)]
        normal = np.array([b[1] - a[1], a[0] - b[0]]) / np.hypot(*(b - a))
        place = a + random.uniform(0.1, 0.9) * (b - a) + (DISC.radius + 1e-6) * normal
        if distance(OUTLINE, place[None])[0] > DISC.radius and not inside(OUTLINE, place[None])[0]:
            places.append(place)
            normals.append(-normal)
    return np.array(places), np.array(normals)


def test_the_outline_is_that_of_the_parts():
    random = np.random.default_rng(1)
    item = body(OUTLINE, GYRATION)
    points = random.uniform(-0.2, 0.2, (500, 2))
    outside = points[~inside(OUTLINE, points)]
    found = [gap(x, y, item.corners, item.first, item.count)[0] for x, y in outside]
    assert found == pytest.approx(distance(OUTLINE, outside), abs=1e-12)
    pose = np.array([0.3, -0.2, 2.0])
    assert placed(item, pose) == pytest.approx(se2.transform(pose, item.corners))


def test_a_push_moves_the_object_as_its_limit_surface_says():
    """200 contacts: the first motion is (3.4) of a force along the normal."""
    random = np.random.default_rng(2)
    item, (places, normals) = body(OUTLINE, GYRATION), contacts(random, 200)
    targets = places + 0.02 * normals
    discs = np.column_stack([places, 0.01 * normals])
    after = push(item, DISC, np.zeros((200, 6)), discs, targets, 1)
    assert after.touched.all()
    for k in range(200):
        point = places[k] + DISC.radius * normals[k]
        wrench = np.array([*normals[k], point[0] * normals[k][1] - point[1] * normals[k][0]])
        twist = after.poses[k, 3:]
        expected = wrench / [SURFACE.max_force**2, SURFACE.max_force**2, SURFACE.max_torque**2]
        scale = twist @ expected / (expected @ expected)
        assert twist == pytest.approx(scale * expected, abs=2e-3 * np.abs(twist).max())
        assert scale > 0.0


def test_a_disc_alone_goes_to_its_target():
    after = driven(DISC, np.array([0.1, 0.2, 0.0, 0.0]), np.array([0.3, 0.1]), 200)
    assert after == pytest.approx([0.3, 0.1, 0.0, 0.0], abs=1e-6)
    item, poses, discs = body(OUTLINE, GYRATION), np.zeros((1, 6)), np.array([[0.3, 0.0, 0.1, 0.2]])
    beside = push(item, DISC, poses, discs, np.array([[0.5, 0.1]]), 30)
    assert not beside.touched[0]
    alone = driven(DISC, discs[0], np.array([0.5, 0.1]), 30)
    assert np.array_equal(alone, beside.discs[0])


def test_what_is_not_touched_does_not_move_and_nothing_that_is_given_changes():
    item = body(OUTLINE, GYRATION)
    poses, discs = np.zeros((3, 6)), np.array([[0.3, 0.0, 0.0, 0.0]] * 3)
    targets = np.array([[0.4, 0.0], [0.3, 0.2], [-0.4, 0.0]])
    after = push(item, DISC, poses, discs, targets, 60)
    assert after.touched.tolist() == [False, False, True]
    assert not after.poses[:2].any() and after.poses[2].any()
    assert not poses.any() and discs[0].tolist() == [0.3, 0.0, 0.0, 0.0]
    assert after.discs[0, :2] == pytest.approx([0.4, 0.0], abs=5e-3)


def test_the_planar_world_agrees():
    """60 slow pushes of 4 cm in a world with floor, masses and solver of its own."""
    random = np.random.default_rng(3)
    item, (places, normals) = body(OUTLINE, GYRATION), contacts(random, 60)
    disc = load_robot("disc")
    disc = replace(
        disc,
        drive=replace(disc.drive, max_force=50.0, max_speed=0.5),
        bumper=replace(disc.bumper, radius=DISC.radius),
        body_radius=DISC.radius - 1e-3,
        mass=0.05,
        robot_friction=0.01,
    )
    off = []
    for place, normal in zip(places, normals, strict=True):
        start = place - 2e-3 * normal
        room, pose = EnvironmentSpec((2.0, 2.0)), ITEM.geometric_pose(np.zeros(3))
        bodies = {"r": (disc, np.array([*start, 0.0]))}, {"o": (ITEM, pose)}
        with PlanarWorld(room, *bodies, PlanarSettings(time_step=2e-3)) as world:
            world.command_all(["r"], np.array([[*(0.05 * normal), 0.0]]), fixed_frame=True)
            world.step(round(0.84 / 2e-3))
            seen = ITEM.mass_pose(world.poses()["o"])
            end = world.poses()["r"][:2]
        steady = Disc(DISC.radius, 1.0, 1.0, 1e-2, 0.06, 1e-4)
        poses, at = np.zeros((1, 6)), np.array([[*start, *(0.05 * normal)]])
        for _ in range(84):  # at constant speed: the target is where the law changes nothing
            target = at[:, :2] + at[:, 2:] * steady.damping / steady.stiffness
            after = push(item, steady, poses, at, target, 1)
            poses, at = after.poses, after.discs
        assert at[0, :2] == pytest.approx(end, abs=1e-3)
        turned = abs(math.remainder(seen[2] - poses[0, 2], math.tau))
        off.append((np.hypot(*(seen[:2] - poses[0, :2])), turned))
    away, turned = np.array(off).T
    assert np.median(away) < 1e-3 and np.percentile(away, 90) < 3e-3
    assert np.median(turned) < 0.02 and np.percentile(turned, 90) < 0.08
