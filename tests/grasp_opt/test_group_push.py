"""A whole push of a group in the planar world, and what ends one early."""

import math
from dataclasses import replace

import numpy as np
import pytest

from grasp_opt.contact_outline import ContactOutline
from grasp_opt.group_control import PRINTED_LAW, GroupControlSettings
from grasp_opt.group_push import ActuationMonitor, GroupPush, GroupPushSettings, Phase
from grasp_opt.object_trajectory import polynomial, sampled
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from push_study.uncertainty import uncertainty
from tests.driving import TICK, GroupWorld

ITEM, ROBOT = load_object("plate_ellipse"), load_robot("epuck_ring")
ROOM = EnvironmentSpec((6.0, 6.0), resolution=0.05)
BEND = polynomial((0.25,), 0.5, 0.05, 0.05, -0.5 * math.pi)
WAYS = ContactOutline(ITEM.geometry).way_of_angle(1.5 * math.pi + np.array([-0.6, 0.0, 0.6]))


def run(push, real=ITEM, off=0.01, moved=None, until=40.0, kill=None):
    """The last step, the object's last pose, and the time; moved: robot that starts elsewhere."""
    start = push.trajectory.pose[0]
    starts = push.starts(start, off)
    for index, way in (moved or {}).items():
        starts[index, :2] += way
    begin, doubt = real.geometric_pose(start), uncertainty("none")
    with GroupWorld(ROOM, ROBOT, starts, real, begin, doubt, 1, "planar") as world:
        while world.time < until:
            seen, robots = world.see()
            step = push.step(world.time, ITEM.mass_pose(seen), robots)
            world.step(step.twists)
            if kill is not None and world.time >= kill[0]:
                world.kill([world.names[kill[1]]])
            if step.phase in (Phase.DONE, Phase.FAILED):
                assert not step.twists.any()
                break
        return step, ITEM.mass_pose(world.truth()[0]), world.time


def test_a_push_ends_where_its_trajectory_does():
    step, pose, time = run(GroupPush(ITEM, ROBOT, WAYS, BEND))
    assert step.phase is Phase.DONE and step.reason == ""
    assert np.hypot(*(pose - BEND.pose[-1])[:2]) < 3e-3
    assert abs(pose[2] - BEND.pose[-1, 2]) < 0.01
    assert BEND.duration < time < BEND.duration + 4.0


@pytest.mark.parametrize("who", [0, 1, 2])
def test_a_robot_that_dies_is_named_within_two_seconds(who):
    step, _, time = run(GroupPush(ITEM, ROBOT, WAYS, BEND), kill=(4.0, who))
    assert step.phase is Phase.FAILED and time < 4.0 + 2.0
    assert step.dead == (who,) and "does not move although commanded to" in step.reason


def test_contact_is_not_searched_for_ever():
    settings = GroupPushSettings(search=3.0)
    push = GroupPush(ITEM, ROBOT, WAYS, BEND, settings)
    step, pose, time = run(push, moved={1: np.array([-0.5, 0.0])})
    assert (
        step.phase is Phase.FAILED and step.reason == "not every robot made contact with the object"
    )
    assert time == pytest.approx(3.0, abs=0.1)
    assert np.hypot(*(pose - BEND.pose[0])[:2]) < 2e-3, "those in contact wait for the others"


def test_an_object_that_is_too_heavy_ends_the_push():
    step, pose, time = run(GroupPush(ITEM, ROBOT, WAYS, BEND), real=replace(ITEM, mass=2.0))
    assert step.phase is Phase.FAILED and time < 15.0
    assert "behind" in step.reason or "from its trajectory" in step.reason or "do" in step.reason
    assert np.hypot(*(pose - BEND.pose[0])[:2]) < 0.02


@pytest.mark.parametrize(("slant", "friction"), [(5.0, 0.02), (15.0, 0.2)])
def test_what_slips_aside_does_not_hold_the_push_up(slant, friction):
    """The push goes straight ahead, at an angle to the normal of the pushed side that is greater
    than that of friction: robots cannot make good what is missing aside. They go on to the end."""
    item, time = load_object("plate_rectangle"), np.linspace(0.0, 8.0, 81)
    way, angle = 0.4 * (3.0 * (time / 8.0) ** 2 - 2.0 * (time / 8.0) ** 3), math.radians(slant)
    poses = np.column_stack([way * math.sin(angle), way * math.cos(angle), 0.0 * way])
    ways = ContactOutline(item.geometry).way_of_angle(1.5 * math.pi + np.array([-0.5, 0.5]))
    push = GroupPush(item, ROBOT, ways, sampled(time, poses))
    step, pose, seconds = run(push, replace(item, contact_friction=friction))
    assert step.phase is Phase.DONE and seconds < 11.0, step.reason
    aside, behind, turned = poses[-1] - pose
    assert 0.02 < aside < 0.05 and abs(behind) < 0.01 and abs(turned) < 0.02


def test_what_is_behind_is_along_the_trajectory():
    """A bend with the object at a heading of about 1 rad. Errors ahead, aside and of the heading
    beyond the trajectory do not count, and do not make up for each other."""
    item, time = load_object("plate_rectangle"), np.linspace(0.0, 8.0, 81)
    bend = sampled(time, np.column_stack([0.05 * time, 0.0 * time, 0.6 + 0.1 * time]))
    push = GroupPush(item, ROBOT, WAYS[:2], bend)
    push.time, radius = 4.0, item.limit_surface().radius
    for off, behind in (
        ([-0.01, 0.0, 0.0], 0.01), ([0.01, 0.0, 0.0], 0.0), ([0.0, 0.03, 0.0], 0.0),
        ([0.0, 0.0, -0.2], 0.2 * radius), ([0.0, 0.0, 0.2], 0.0), ([0.05, 0.0, -0.2], 0.2 * radius),
        ([-0.01, 0.0, 0.2], 0.01), ([0.0, 0.0, 2.0 * math.pi - 0.2], 0.2 * radius),
    ):  # fmt: skip
        pose = np.array([0.2, 0.0, 1.0]) + off
        assert push._lag(pose) == pytest.approx(behind, abs=1e-9), off
    push.time = bend.duration + 0.01  # at rest
    assert push._lag(bend.pose[-1] - [0.04, 0.0, 0.0]) == 0.0


@pytest.mark.parametrize(("missing", "failed"), [(0.3, True), (0.15, False)])
def test_a_push_that_ends_far_from_the_end_of_its_way_has_failed(missing, failed):
    """The object lies aside all the time, by a part of the way of 0.1 m."""
    settings = GroupPushSettings(position_error=1.0, behind=0.005)
    time = np.linspace(0.0, 4.0, 41)
    way = 0.1 * (3.0 * (time / 4.0) ** 2 - 2.0 * (time / 4.0) ** 3)
    push = GroupPush(
        ITEM, ROBOT, WAYS, sampled(time, np.column_stack([0.0 * way, way, 0.0 * way])), settings
    )
    push.time = push.trajectory.duration
    assert bool(push._missed(push.trajectory.pose[-1] - [2.0 * 0.1 * missing, 0.0, 0.0])) is failed
    assert not push._missed(push.trajectory.pose[-1] - [0.009, 0.0, 0.0])


def test_obedience_tells_who_stands_from_who_waits_and_who_goes():
    random = np.random.default_rng(1)
    watch = ActuationMonitor(3, 1.0, 0.01)
    told = np.array([[0.05, 0.0], [0.05, 0.0], [0.0, 0.0]])
    for k in range(120):
        t = k * TICK
        poses = np.zeros((3, 3))
        poses[0, 0] = 0.05 * t
        poses[:, :2] += random.normal(0.0, 2e-4, (3, 2))
        assert watch.step(t, poses, told) in ((), (1,))
        if t > 1.1:
            assert watch.step(t, poses, told) == (1,)
        if t < 0.8:
            assert watch.step(t, poses, told) == ()


def test_obedience_tells_who_does_not_turn():
    watch = ActuationMonitor(2, 1.0, 0.01)
    told = np.array([[0.0, 0.8], [0.0, 0.8]])
    for k in range(80):
        t = k * TICK
        poses = np.array([[0.0, 0.0, 3.0 + 0.8 * t], [0.0, 0.0, 1.0]])
        answer = watch.step(t, poses, told)
    assert answer == (1,)


@pytest.mark.parametrize(("name", "half"), [("plate_rectangle", 0.6), ("plate_hexagon", 0.4)])
def test_the_printed_law_pushes_with_gains_of_its_own(name, half):
    """(3.25) as printed. With the gains of the default law it hardly moves: its speed is the gain
    times a robot's share of the floor's friction, 0.002 m/s/N times less than 1 N."""
    item = load_object(name)
    ways = ContactOutline(item.geometry).way_of_angle(1.5 * math.pi + np.array([-half, half]))
    step, pose, _ = run(GroupPush(item, ROBOT, ways, BEND, None, PRINTED_LAW), item)
    assert step.phase is Phase.DONE, step.reason
    assert np.hypot(*(pose - BEND.pose[-1])[:2]) < 0.01
    slow = GroupPush(item, ROBOT, ways, BEND, None, GroupControlSettings(law="printed"))
    step, pose, _ = run(slow, item)
    assert step.phase is Phase.FAILED
    assert np.hypot(*(pose - BEND.pose[0])[:2]) < 0.15
