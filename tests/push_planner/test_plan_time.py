"""Times of pushes and of changes of the side, against trajectories and drives."""

import math

import numpy as np
import pytest

from push_model import se2
from push_model.distance_field import DistanceField
from push_model.occupancy import rasterise
from push_model.specs import EnvironmentSpec
from push_planner import PlannerSettings, PushPlanner
from push_planner.push_curve import PushCurve, shortest_push_curve
from push_planner.push_reference import push_reference
from push_planner.scene import PushScene
from push_scenario.bodies import load_object


@pytest.fixture(scope="module")
def scene(robot, box):
    grid = rasterise(EnvironmentSpec((4.0, 4.0)))
    return PushScene(DistanceField(grid), robot, box, PlannerSettings())


def test_a_push_takes_as_long_as_its_trajectory(scene, robot):
    random = np.random.default_rng(1)
    limits = scene.sides[0].nominal
    off, lengths = [], []
    for _ in range(400):
        end = random.uniform([0.1, -0.6, -1.5], [1.5, 0.6, 1.5])
        curve = shortest_push_curve(np.zeros(3), end, limits.minimum, limits.maximum)
        if curve is None:
            continue
        time = scene.time.of_push(curve)
        exact = push_reference([curve], robot.differential, scene.settings).time[-1]
        assert time >= scene.time.pace * curve.length - 1e-9
        off.append((scene.time.begin + time) / exact - 1.0)
        lengths.append(curve.length)
    assert len(off) > 150 and max(lengths) > 1.4
    assert np.percentile(np.abs(off), 95) < 0.02


def test_a_change_to_the_opposite_side_takes_longer_than_to_a_neighbouring_one(scene):
    changes = scene.time.changes
    assert np.array_equal(changes, changes.T) and not changes.diagonal().any()
    order = [side.contact.heading for side in scene.sides]
    for a in range(4):
        for b in range(a):
            turn = abs(se2.wrap(order[a] - order[b]))
            if turn > 3.0:
                assert 8.0 < changes[a, b] < 10.0
            else:
                assert turn == pytest.approx(math.pi / 2.0) and 6.0 < changes[a, b] < 7.5


@pytest.mark.parametrize("name", ["transport_l", "transport_h", "transport_plus"])
def test_every_change_of_a_concave_object_has_a_time(robot, name):
    grid = rasterise(EnvironmentSpec((4.0, 4.0)))
    time = PushScene(DistanceField(grid), robot, load_object(name), PlannerSettings()).time
    apart = time.changes[~np.eye(len(time.changes), dtype=bool)]
    assert len(apart) >= 12 and np.isfinite(apart).all()
    assert apart.min() >= PlannerSettings().contact_time


def test_the_cost_of_a_plan_is_the_time_of_its_pushes_and_changes(robot, box):
    planner = PushPlanner(PlannerSettings(), rasterise(EnvironmentSpec((4.0, 4.0))), robot, box)
    plan = planner.solve(np.array([-0.2, -0.4, 0.0]), np.array([0.2, 0.4, 0.0]))
    sides = [side.index for side in planner.scene.sides]
    total, runs = 0.0, [plan.segments[0]]
    for s in plan.segments:
        total += planner.scene.time.of_push(
            PushCurve(s.robot_start, s.robot_end, s.k_start, s.k_end, s.length)
        )
    for a, b in zip(plan.segments, plan.segments[1:], strict=False):
        total += planner.scene.time.changes[sides.index(a.side), sides.index(b.side)]
        if a.side != b.side:
            runs.append(b)
    total += planner.scene.time.begin * len(runs)
    assert len(runs) >= 2 and plan.cost == pytest.approx(total)


def test_pushes_in_a_row_on_a_side_take_as_long_as_they_are_carried_out(scene, robot):
    """The robot speeds up and brakes once."""
    random, off = np.random.default_rng(2), []
    limits = scene.sides[0].trusted
    for _ in range(60):
        poses, curves = [np.zeros(3)], []
        while len(curves) < 3:
            end = se2.compose(poses[-1], random.uniform([0.2, -0.1, -0.3], [0.6, 0.1, 0.3]))
            curve = shortest_push_curve(poses[-1], end, limits.minimum, limits.maximum)
            if curve is not None:
                poses.append(end)
                curves.append(curve)
        exact = push_reference(curves, robot.differential, scene.settings).time[-1]
        total = scene.time.begin + sum(map(scene.time.of_push, curves))
        off.append(total / exact - 1.0)
    assert np.abs(off).max() < 0.03
