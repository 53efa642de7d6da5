"""Pushes in a row on the same side are one motion; others stay what they are."""

from dataclasses import replace

import numpy as np
import pytest

from push_model import se2
from push_model.occupancy import rasterise
from push_model.specs import EnvironmentSpec
from push_planner import (
    PlannerSettings,
    PlanningFailed,
    PushPlanner,
    check_under_way,
    going_on,
    joined,
)
from push_planner.push_curve import shortest_push_curve
from push_planner.push_graph import PushStep

SETTINGS = PlannerSettings()


@pytest.fixture(scope="module")
def planner(robot, box):
    return PushPlanner(SETTINGS, rasterise(EnvironmentSpec((6.0, 4.0))), robot, box)


def push(planner, number, start, end, clearance=0.3):
    """A push on a side from one pose of the robot to another, None if there is none."""
    side = planner.scene.sides[number]
    trusted = side.trusted
    curve = shortest_push_curve(start, end, trusted.minimum, trusted.maximum)
    if curve is None:
        return None
    at, to = (se2.compose(pose, side.grasp) for pose in (start, end))
    return planner.segment(
        PushStep(side, curve, at, to, clearance, planner.scene.time.of_push(curve))
    )


BEGIN, MIDDLE, END = np.array([[-1.0, 0.0, 0.0], [0.0, 0.2, 0.3], [1.0, 0.2, -0.4]])


def test_two_pushes_on_a_side_are_one_without_a_stop(planner, robot):
    first = push(planner, 0, BEGIN, MIDDLE, 0.2)
    second = push(planner, 0, MIDDLE, END, 0.1)
    (whole,) = joined([first, second], robot.drive, SETTINGS)
    t = whole.trajectory
    assert t.pose[0] == pytest.approx(BEGIN) and t.pose[-1] == pytest.approx(END)
    assert np.array_equal(whole.object_end, second.object_end) and whole.side == 0
    assert whole.length == pytest.approx(first.length + second.length) and whole.clearance == 0.1
    assert whole.grasp == pytest.approx(first.grasp)
    at = np.hypot(*(t.pose[:, :2] - MIDDLE[:2]).T)
    assert at.min() < 1e-9 and t.twist[at.argmin(), 0] > 0.1, "it passes there at full speed"
    ramps = SETTINGS.push_speed / SETTINGS.push_acceleration
    saved = first.trajectory.duration + second.trajectory.duration - t.duration
    assert saved == pytest.approx(ramps, rel=0.1)
    v, omega = t.twist.T
    wheel = np.abs(v) + robot.drive.half_track * np.abs(omega)
    assert wheel.max() <= (1.0 - SETTINGS.wheel_reserve) * robot.drive.max_speed + 1e-9
    trusted = planner.scene.sides[0].trusted
    assert (omega <= (trusted.maximum + 1e-3) * v).all()
    assert (omega >= (trusted.minimum - 1e-3) * v).all()


def test_a_change_of_side_parts_them(planner, robot):
    runs = [push(planner, n, BEGIN, MIDDLE) for n in (0, 1, 1, 0)]
    runs[2] = push(planner, 1, MIDDLE, END)
    whole = joined(runs, robot.drive, SETTINGS)
    assert [s.side for s in whole] == [0, 1, 0]
    assert whole[0] is runs[0] and whole[2] is runs[3]
    assert joined([], robot.drive, SETTINGS) == ()


def test_a_single_push_keeps_its_reference(planner, robot):
    one = push(planner, 0, BEGIN, END)
    (same,) = joined([one], robot.drive, SETTINGS)
    assert same is one
    slow = replace(SETTINGS, push_speed=0.05)
    again = joined(
        [push(planner, 0, BEGIN, MIDDLE), push(planner, 0, MIDDLE, END)], robot.drive, slow
    )
    assert again[0].trajectory.twist[:, 0].max() == pytest.approx(0.05)


def cut_and_went_on(planner, robot, side, seed):
    """A random push, where it is cut off [s], and it with another push on a side from there."""
    rng = np.random.default_rng(seed)
    while True:
        target = np.array([*rng.uniform([0.2, -0.4], [1.0, 0.4]), rng.uniform(-0.6, 0.6)])
        start = np.array([*rng.uniform(-1.0, 1.0, 2), rng.uniform(-np.pi, np.pi)])
        old = push(planner, 0, start, se2.compose(start, target))
        if old is None:
            continue
        at = rng.uniform(0.3, 1.0) * old.trajectory.duration
        begun = old.part(0.0, at)
        further = np.array([*rng.uniform([0.2, -0.3], [0.8, 0.3]), rng.uniform(-0.5, 0.5)])
        new = push(planner, side, begun.robot_end, se2.compose(begun.robot_end, further))
        if new is not None:
            return old, at, new, going_on(begun, [new], robot.drive, SETTINGS)


@pytest.mark.parametrize("seed", range(200))
def test_a_push_under_way_goes_on_with_a_new_one_on_its_side(planner, robot, seed):
    old, at, new, (whole,) = cut_and_went_on(planner, robot, 0, seed)
    t = whole.trajectory
    assert np.array_equal(whole.object_end, new.object_end)
    assert whole.grasp == pytest.approx(old.grasp)
    way = float(np.interp(at, old.trajectory.time, old.trajectory.travelled))
    assert t.length == pytest.approx(way + new.trajectory.length, abs=1e-3)
    for part in np.linspace(0.0, way, 30):  # the same path up to there
        was, _ = old.trajectory.sample(
            np.interp([part], old.trajectory.travelled, old.trajectory.time)
        )
        now, _ = t.sample(np.interp([part], t.travelled, t.time))
        assert np.hypot(*(now - was)[0, :2]) < 1e-3 and abs((now - was)[0, 2]) < 5e-3
    v, omega = t.twist.T
    wheel = np.abs(v) + robot.drive.half_track * np.abs(omega)
    assert wheel.max() <= (1.0 - SETTINGS.wheel_reserve) * robot.drive.max_speed + 1e-9
    inner = (t.travelled > 0.02) & (t.travelled < t.length - 0.02)
    assert v[inner].min() > 0.03, "it does not stop between"
    rise = np.diff(v**2) / (2.0 * np.maximum(np.diff(t.travelled), 1e-9))
    assert np.abs(rise).max() <= SETTINGS.push_acceleration * 1.05


def test_only_a_push_that_moves_and_ends_at_the_start_can_be_under_way(planner):
    one = push(planner, 0, BEGIN, END)
    check_under_way(one, one.object_end)
    off = one.object_end + np.array([2e-3, 0.0, 0.0])
    still = replace(one.trajectory, twist=np.zeros_like(one.trajectory.twist))
    for bad, start in (
        (one, off),
        (replace(one, turns=True), one.object_end),
        (replace(one, trajectory=still), one.object_end),
    ):
        with pytest.raises(PlanningFailed):
            check_under_way(bad, start)


@pytest.mark.parametrize("seed", range(5))
def test_a_push_under_way_comes_to_rest_before_a_change_of_the_side(planner, robot, seed):
    old, at, new, (head, after) = cut_and_went_on(planner, robot, 1, seed)
    assert after is new and head.side == 0
    end, _ = old.trajectory.sample(np.array([at]))
    assert head.trajectory.pose[-1] == pytest.approx(end[0]) and head.trajectory.twist[-1, 0] == 0.0
    assert head.object_end == pytest.approx(se2.compose(end[0], old.grasp))
