"""Goals at the door, motions beside walls, other bodies: against the geometry they stand for."""

import re
from dataclasses import replace

import numpy as np
import pytest

from push_model import CurvatureLimits, PushSegment, line, se2
from push_model.jobs import GoalRefused, JobError
from push_model.occupancy import rasterise
from push_model.pushable_sides import pushable_sides
from push_model.specs import BoxSpec, EnvironmentSpec
from push_supervisor import SupervisorSettings, Surroundings, commands, motions
from push_supervisor.footprint import gap
from tests.outlines import CONCAVE, SLIM, U, item_of

SETTINGS = SupervisorSettings()
OPEN = EnvironmentSpec((3.0, 2.0))
WALLED = EnvironmentSpec((3.0, 2.0), boxes=(BoxSpec((0.5, 0.0), (0.1, 0.6)),))


@pytest.fixture
def around(robot, box):
    around = Surroundings(robot, box, {"other": 0.06, "crate": 0.2}, SETTINGS)
    around.take_map(rasterise(WALLED))
    return around


def push(robot, box, begin, length=0.4):
    """Straight ahead with the robot at a pose."""
    grasp = np.array([robot.push_distance - box.outline[:, 0].min(), 0.0, 0.0])
    way = line(begin, length, 0.07, 0.1)
    end = way.pose[-1]
    wait = se2.compose(begin, np.array([-0.06, 0.0, 0.0]))
    items = se2.compose(begin, grasp), se2.compose(end, grasp)
    limits = CurvatureLimits(-2.0, 2.0)
    return PushSegment(0, *items, begin, end, wait, 0.5, 0.5, length, limits, 0.1, way)


@pytest.mark.parametrize(
    ("goal", "code"),
    [
        ([0.5, 0.1, 0.3], JobError.GOAL_OCCUPIED),
        ([0.41, 0.0, 0.0], JobError.GOAL_OCCUPIED),  # a corner in the wall
        ([1.47, 0.0, 0.0], JobError.GOAL_OCCUPIED),
        ([3.0, 0.0, 0.0], JobError.OUTSIDE_MAP),
    ],
)
def test_a_goal_that_cannot_be_is_refused_with_its_code(around, goal, code):
    with pytest.raises(GoalRefused) as refusal:
        around.check_goal(np.array(goal))
    assert refusal.value.code is code and "(" in str(refusal.value)


def test_what_is_too_heavy_is_refused_before_the_first_push(robot, box):
    heavy = Surroundings(robot, replace(box, mass=0.3), {}, SETTINGS)
    with pytest.raises(GoalRefused) as refusal:
        heavy.check_goal(np.zeros(3))
    assert refusal.value.code is JobError.TOO_HEAVY
    assert re.fullmatch(r"too heavy: needs 0\.\d\d N, has 0\.\d\d N", str(refusal.value))


def test_a_goal_beside_a_wall_is_taken_and_without_a_map_any(around, robot, box):
    around.check_goal(np.array([0.39, 0.0, 0.0]))  # 15 mm
    Surroundings(robot, box, {}, SETTINGS).check_goal(np.array([0.5, 0.0, 0.0]))


def test_touching_is_nearer_than_after_backing_off(around, robot):
    contact = robot.push_distance + 0.045
    item = np.array([-0.5, 0.1, 0.4])
    for away, expected in ((0.0, True), (0.03, True), (0.055, False), (0.3, False)):
        back = np.array([-contact - away, 0.0, 0.0])
        assert around.touching(se2.compose(item, back), item) == expected
    # beside a long way from the middle, with its back to the object, and on top of it
    assert around.touching(se2.compose(item, np.array([0.0, 0.1, 0.0])), item)
    assert around.touching(se2.compose(item, np.array([contact, 0.0, 0.0])), item)
    assert around.touching(item, item)


def test_a_retreat_leads_away_from_the_object(around, robot, box):
    """From anywhere about the object, on a free floor, facing it more or less."""
    random = np.random.default_rng(1)
    near = 0
    for _ in range(200):
        item = np.array([-0.6, 0.0, random.uniform(-4, 4)])
        bearing, apart = random.uniform(-4, 4), random.uniform(0.095, 0.14)
        place = item[:2] + apart * np.array([np.cos(bearing), np.sin(bearing)])
        pose = np.array([*place, bearing + np.pi + random.normal(0.0, 0.15)])
        before = gap(robot.outline, pose, box.outline, item)
        if before == 0.0 or not around.touching(pose, item):
            continue
        near += 1
        way, _ = around.retreat(pose, item)
        after = gap(robot.outline, way.pose[-1], box.outline, item)
        assert after > before + 0.03
    assert near > 50


def test_a_slow_robot_is_not_asked_for_more_than_its_wheels_can(robot, box):
    drive = replace(robot.drive, max_wheel_speed=2.0)  # 0.041 m/s
    slow = Surroundings(replace(robot, drive=drive), box, {}, SETTINGS)
    slow.take_map(rasterise(OPEN))
    segment = push(robot, box, np.array([-0.5, 0.0, 0.0]))
    for way in (
        slow.approach(segment, segment.standoff, segment.object_start)[0],
        slow.retreat(segment.robot_start, segment.object_start)[0],
    ):
        assert 0.03 < np.abs(way.twist[:, 0]).max() < drive.max_speed


def test_walls_are_kept_on_the_approach(around, robot, box):
    """The object is touched, walls are not; a circle at the end is as wide as the end allows."""
    item = np.array([0.2, 0.0, 0.0])
    contact = robot.push_distance + 0.045
    segment = push(robot, box, item - [contact, 0.0, 0.0], 0.1)
    way, circles = around.approach(segment, item - [contact + 0.06, 0.0, 0.0], item)
    assert len(circles) > 3
    wall = robot.body_radius + SETTINGS.obstacle_margin + 0.005
    assert circles[:, 2] == pytest.approx(wall)
    assert np.hypot(*(circles[:, :2] - item[:2]).T).min() > 0.1  # none stands for the object
    beside = np.array([0.409, 0.0, np.pi / 2])  # 4 mm from the face: nearer than the robot's own
    segment = push(robot, box, beside, 0.1)
    way, circles = around.approach(segment, beside - [0.0, 0.06, 0.0], segment.object_start)
    near = np.hypot(*(circles[:, :2] - way.pose[-1, :2]).T)
    assert (near >= circles[:, 2] - 1e-9).all() and circles[:, 2].min() < wall


def test_the_way_goes_round_the_object_and_the_other_bodies(around, robot, box):
    item = np.array([-0.5, 0.0, 0.0])
    poses = {"other": np.array([0.0, 0.5, 1.0]), "crate": None}
    circles = around.on_the_way(item, poses)
    own = motions.outline_circles(se2.transform(item, box.outline), robot.footprint_radius)
    other = np.array([[0.0, 0.5, 0.06 + robot.footprint_radius]])
    assert circles == pytest.approx(np.vstack([own, other]))
    assert around.bodies(poses) == pytest.approx(np.array([[0.0, 0.5, 0.06]]))
    assert around.bodies({}).shape == (0, 3)
    way = line(np.array([-0.8, 0.0, 0.0]), 0.1, 0.1, 0.1)
    kept = around.follow(way, item)
    least = robot.body_radius + SETTINGS.obstacle_margin
    own = motions.outline_circles(se2.transform(item, box.outline), least)
    assert kept[-len(own) :] == pytest.approx(own)


@pytest.mark.parametrize("outline", [*CONCAVE, SLIM])
def test_at_every_stand_off_of_a_long_or_concave_object_there_is_room(robot, outline):
    """The object is an obstacle as its outline is, not as a disc about all of it."""
    item = item_of(outline)
    around = Surroundings(robot, item, {}, SETTINGS)
    pose = np.array([0.2, -0.1, 0.7])
    circles = around.on_the_way(pose, {})
    sides = pushable_sides(item.geometry, robot)
    assert len(sides) >= 4
    for side in sides:
        back = robot.push_distance + side.depth + 0.06
        foot = 0.5 * (side.start + side.end) - back * side.inward_normal
        at = se2.transform(item.mass_pose(pose), foot[None])[0]
        room = np.hypot(*(circles[:, :2] - at).T) - circles[:, 2]
        assert room.min() > 0.012


def test_a_retreat_from_a_recess_leads_out_of_it(robot):
    item = item_of(U)
    around = Surroundings(robot, item, {}, SETTINGS)
    (side,) = (s for s in pushable_sides(item.geometry, robot) if s.depth > 0.0)
    middle = 0.5 * (side.start + side.end) - robot.push_distance * side.inward_normal
    heading = np.arctan2(*side.inward_normal[::-1])
    pose = np.array([0.3, 0.2, 2.0])
    contact = se2.compose(item.mass_pose(pose), np.array([*middle, heading]))
    way, _ = around.retreat(contact, pose)
    assert -se2.between(contact, way.pose[-1])[0] == pytest.approx(
        side.depth + SETTINGS.detach_distance, abs=3e-3
    )


def test_a_plan_is_blocked_by_what_it_would_run_into(around, robot, box):
    ahead = push(robot, box, np.array([-0.6, 0.0, 0.0]), 0.4)
    into = push(robot, box, np.array([-0.1, 0.1, 0.0]), 0.6)
    past = push(robot, box, np.array([-0.1, 0.5, 0.0]), 0.6)
    assert around.blocked([ahead, past]) == "" == around.blocked([])
    assert "push 2 meets an obstacle" in around.blocked([ahead, into])


def test_a_map_is_new_when_it_differs(around, robot):
    before = around.walls
    assert not around.take_map(rasterise(WALLED))
    assert np.array_equal(before, around.walls)
    assert around.take_map(rasterise(OPEN))
    assert len(around.walls) < len(before)
    around.change_settings(SupervisorSettings(obstacle_margin=0.02))
    assert around.walls[0, 2] == pytest.approx(robot.body_radius + 0.02 + 0.005)


def test_a_push_on_a_corner_leads_straight_on_from_where_the_robot_is(robot, box):
    """Also where robot and object are a little beside their places."""
    random = np.random.default_rng(5)
    for _ in range(50):
        begin = random.uniform([-0.3, -0.3, -3.0], [0.3, 0.3, 3.0])
        segment = replace(push(robot, box, begin, 0.05), turns=True)
        off = random.uniform(-0.003, 0.003, 3)
        item = segment.object_start + off
        contact = segment.contact(item)
        here = se2.compose(contact, np.array([-0.002, 0.001, 0.01]))
        around = Surroundings(robot, box, {}, SETTINGS)
        around.take_map(rasterise(WALLED))
        way, _ = around.motion(commands.FollowTurn(segment), here, item)
        first, last = (se2.between(contact, way.pose[k]) for k in (0, -1))
        assert first == pytest.approx([-0.002, 0.0, 0.0], abs=2e-5)
        assert last == pytest.approx([segment.length, 0.0, 0.0], abs=2e-5)
        assert way.twist[:, 0].max() <= segment.trajectory.twist[:, 0].max() + 1e-9


def test_the_object_is_where_the_push_moves_it(robot, box):
    begin = np.array([0.2, -0.1, 0.7])
    segment = push(robot, box, begin, 0.3)
    for pose, item in zip(segment.trajectory.pose, segment.object_poses, strict=True):
        assert np.abs(se2.between(se2.compose(pose, segment.grasp), item)).max() < 1e-9
    turned = replace(segment, turns=True, object_end=segment.object_end + [0.0, 0.0, 0.4])
    assert turned.object_poses[-1] == pytest.approx(turned.object_end)
    assert turned.object_poses[0] == pytest.approx(turned.object_start)
