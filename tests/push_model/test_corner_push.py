"""A bumper that pushes on a corner: against the laws of the model, and in a simulated world."""

from dataclasses import replace

import numpy as np
import pytest

from push_model import se2
from push_model.corner_push import corner_push, touching
from push_model.specs import EnvironmentSpec
from sim_bridge.planar_world import PlanarWorld

FACE, HALF, RADIUS = 0.04, 0.025, 0.034


def regular(corners, size, turned=0.0):
    angles = turned + np.arange(corners) * 2.0 * np.pi / corners
    return size * np.column_stack([np.cos(angles), np.sin(angles)])


def draws(count, seed):
    random = np.random.default_rng(seed)
    for _ in range(count):
        outline = regular(random.integers(3, 7), random.uniform(0.04, 0.08))
        outline = outline + random.uniform(-0.01, 0.01, 2)
        at = touching(outline, random.uniform(-np.pi, np.pi), FACE, random.uniform(-HALF, HALF))
        yield outline, at, random.uniform(0.05, 0.8)


def test_a_corner_touches_the_bumper_and_nothing_lies_behind_it():
    for outline, at, friction in draws(200, 1):
        assert se2.transform(at, outline)[:, 0].min() == pytest.approx(FACE)
        push = corner_push(outline, at, FACE, HALF, friction, RADIUS, 0.3)
        for pose in [] if push is None else push.poses:
            assert se2.transform(pose, outline)[:, 0].min() == pytest.approx(FACE, abs=1e-9)


def test_it_obeys_friction_and_the_limit_surface():
    """The velocities, from differences of poses, against force and slip at the corner."""
    stuck = slid = 0
    for outline, at, friction in draws(300, 2):
        push = corner_push(outline, at, FACE, HALF, friction, RADIUS, 0.3)
        if push is None or len(push.poses) < 12:
            continue
        k = len(push.poses) // 2
        ds = push.travel[k + 1] - push.travel[k - 1]
        vx, vy, turn = (push.poses[k + 1] - push.poses[k - 1]) / ds
        vx += 1.0  # over the floor
        points = se2.transform(push.poses[k], outline)
        r = points[np.argmin(points[:, 0])] - push.poses[k, :2]
        force = np.array([vx, vy])  # of (3.4), up to a factor
        torque = r[0] * force[1] - r[1] * force[0]
        assert turn == pytest.approx(torque / RADIUS**2, rel=0.03, abs=0.05)
        ratio, slip = force[1] / force[0], vy + turn * r[0]
        assert force[0] > 0.0 and abs(ratio) <= friction * 1.02 + 1e-3
        if abs(slip) > 0.02:
            slid += 1
            assert abs(ratio) == pytest.approx(friction, rel=0.02)
            assert ratio * slip < 0.0 or friction < 0.06, "friction opposes the slip of the object"
        else:
            stuck += 1
    assert stuck > 30 and slid > 30


def test_at_the_end_a_side_is_flush():
    flush = 0
    for outline, at, friction in draws(300, 3):
        push = corner_push(outline, at, FACE, HALF, friction, RADIUS, 0.3)
        if push is None:
            continue
        flush += 1
        points = se2.transform(push.poses[-1], outline)
        on = points[points[:, 0] < FACE + 1e-6]
        assert len(on) == 2
        assert abs(np.diff(push.poses[:, 2])).max(initial=0.0) < 0.06, "it turns without a jump"
    assert flush > 60


def test_a_corner_beside_the_bumper_or_in_line_with_the_centre_gets_no_side_flush():
    square = regular(4, 0.06, np.pi / 4.0)
    beside = touching(square, 0.4, FACE, HALF + 0.001)
    assert corner_push(square, beside, FACE, HALF, 0.3, RADIUS, 0.3) is None
    balanced = touching(square, np.pi / 4.0, FACE, 0.0)
    assert corner_push(square, balanced, FACE, HALF, 0.3, RADIUS, 0.05) is None


def test_a_simulated_object_moves_as_predicted(robot, box):
    """A hundred pushes in the planar world, whose friction and floor are those of the model."""
    random, off = np.random.default_rng(4), []
    half, face = 0.5 * robot.flat_bumper.width, robot.push_distance
    for _ in range(100):
        item = replace(box, contact_friction=float(random.uniform(0.1, 0.4)))
        outline, radius = item.geometry.outline, item.limit_surface().radius
        push, at = None, np.zeros(3)
        while push is None or abs(push.poses[-1, 2] - at[2]) < 0.2:
            at = touching(outline, random.uniform(-np.pi, np.pi), face, random.uniform(-half, half))
            push = corner_push(outline, at, face, half, item.contact_friction, radius, 0.12)
        away = item.geometric_pose(at) + [0.002, 0.0, 0.0]
        room = EnvironmentSpec((2.0, 2.0))
        with PlanarWorld(room, {"r": (robot, np.zeros(3))}, {"o": (item, away)}) as world:
            steps = round(0.01 / world.time_step)
            while world.poses()["r"][0] < 0.002 + push.travel[-1]:
                world.command_all(["r"], np.array([[0.05, 0.0, 0.0]]), False)
                world.step(steps)
            poses = world.poses()
            found = se2.between(poses["r"], item.mass_pose(poses["o"]))
        error = se2.between(push.poses[-1], found)
        off.append([np.hypot(*error[:2]), abs(error[2]), abs(push.poses[-1, 2] - at[2])])
    way, turn, turned = np.array(off).T
    assert np.median(turned) > 0.3
    assert np.median(way) < 0.003 and np.percentile(way, 95) < 0.008
    assert np.median(turn) < 0.05 and np.percentile(turn, 95) < 0.15
