"""Dubins pushes: their paths, where they get to, and when there is none."""

import math

import numpy as np
import pytest

from push_job.method import Arena, Refusal, Seen, Task
from push_model import se2
from push_model.belief import Belief
from push_model.jobs import JobError, JobPhase
from push_model.occupancy import rasterise
from push_model.settings import SettingsError
from push_model.specs import BoxSpec, EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from push_study.rivals.dubins_plans import Push, dubins, dubins_plans
from push_study.rivals.dubins_push import METHOD, DubinsPusher, DubinsSettings
from push_study.rivals.stable_grips import grips
from push_study.team_run import OBJECT, made_scenario, run_team
from push_study.uncertainty import uncertainty
from sim_bridge.planar_world import PlanarWorld
from tests.samples import mostly_long

ROBOT, BOX = load_robot("epuck"), load_object("box9")
ROOM = EnvironmentSpec((3.0, 2.4))
BELIEF = Belief({OBJECT: BOX}, {"e0": ROBOT})
START = np.array([-0.8, 0.0, 0.0])
AHEAD = Task((np.array([0.5, 0.1, 0.2]),))


def seen_at(time, item, robot):
    return Seen(time, item, {"e0": robot})


HERE = seen_at(0.0, START, np.array([-1.1, 0.0, 0.0]))


def arena(room=ROOM, **settings):
    own = {"": DubinsSettings(**settings)}
    return Arena(rasterise(room), {"e0": ROBOT}, OBJECT, BOX, own)


def run(goal, start=START, room=ROOM, behind=(-0.25, 0.0, 0.0), limit=150.0, **settings):
    """A task in the planar world, frame by frame, with exact poses: status, pose of the object."""
    method = DubinsPusher(arena(room, **settings))
    method.begin(Task((np.array(goal),)), BELIEF)
    place = se2.compose(start, np.array(behind))
    world = PlanarWorld(room, {"e0": (ROBOT, place)}, {OBJECT: (BOX, start)})
    time = 0.0
    while method.status.phase != JobPhase.IDLE and time < limit:
        time += 0.01
        found = world.poses()
        told = method.step(seen_at(time, found[OBJECT], found["e0"]), BELIEF)
        world.command("e0", *told.commands.get("e0", (0.0, 0.0)))
        world.step(round(0.01 / world.time_step))
    return method.status, world.poses()[OBJECT]


def test_paths_join_their_ends_with_bends_that_are_allowed():
    """200 random pairs of poses."""
    random = np.random.default_rng(1)
    for _ in range(200):
        start, goal = random.uniform([-1, -1, -3], [1, 1, 3], (2, 3))
        radius = random.uniform(0.1, 1.0)
        path, length = dubins(start, goal, radius)
        for pose, end in ((path[0], start), (path[-1], goal)):
            off = se2.between(end, pose)
            assert np.abs([off[0], off[1], se2.wrap(off[2])]) == pytest.approx(0.0, abs=1e-6)
        steps = np.hypot(*np.diff(path[:, :2], axis=0).T)
        turns = np.abs([se2.wrap(t) for t in np.diff(path[:, 2])])
        assert steps.max() <= 0.0101 and steps.sum() == pytest.approx(length, rel=1e-3)
        assert (turns <= (0.01 + 1e-6) / radius).all()


SQUARE = [Push(np.array([0.0, 0.0, -0.5 * math.pi * k]), 0.5) for k in range(4)]
"""The path is that of the object; it can be pushed in four directions."""


def inside(path, index):
    return bool((np.abs(path[:, :2]) <= 1.0).all())


def large(path, index):
    return bool((np.abs(path[:, :2]) <= 2.0).all())


@pytest.mark.parametrize("strict", [False, True])
def test_plans_are_clear_and_end_at_the_goal_and_the_first_is_the_shortest(strict):
    """100 random problems in a square."""
    random, direct, relocated = np.random.default_rng(4), 0, 0
    for _ in range(100):
        item, goal = random.uniform([-0.9, -0.9, -3.0], [0.9, 0.9, 3.0], (2, 3))
        plans = dubins_plans(item, [goal], SQUARE, inside, strict)
        assert [p.length for p in plans] == sorted(p.length for p in plans)
        for plan in plans:
            push, path = SQUARE[plan.push], plan.path
            assert inside(path, plan.push)
            steps = float(np.hypot(*np.diff(path[:, :2], axis=0).T).sum())
            if plan.relocates:
                relocated += 1
                there = se2.compose(path[-1], push.grasp)
                rest = plan.length - steps
                ends = [(se2.compose(there, s), se2.compose(goal, s)) for s in TURNS]
                assert any(abs(dubins(*e, 0.5)[1] - rest) < 1e-6 for e in ends)
            else:
                direct += 1
                assert plan.length == pytest.approx(steps, rel=1e-3)
                end = se2.between(goal, se2.compose(path[-1], push.grasp))
                assert np.hypot(*end[:2]) < 1e-6 and abs(se2.wrap(end[2])) < 1e-6
    assert direct > 30 and relocated > 30


TURNS = [se2.inverse(push.grasp) for push in SQUARE]


def test_strictly_only_objects_whose_path_bends_all_the_way_are_relocated():
    """A wall across the straight way blocks the path, which is a straight part."""
    item, goal = np.array([-0.8, 0.0, 0.0]), np.array([0.9, 0.3, 0.0])

    def beside(path, index):
        crosses = (np.abs(path[:, 0]) < 0.1) & (np.abs(path[:, 1]) < 0.5)
        return inside(path, index) and not crosses.any()

    assert not dubins_plans(item, [goal], SQUARE[:1], beside, strict=True)
    assert dubins_plans(item, [goal], SQUARE, beside)[0].relocates
    item, near = np.array([1.5, 0.0, 0.0]), np.array([1.6, 0.9, math.pi])
    assert not large(dubins(item, near, 0.5)[0], 0)  # it leaves the room
    assert any(p.relocates for p in dubins_plans(item, [near], SQUARE, large, strict=True))


def far(start, goal):
    """Lim et al., Circling Back: Dubins set classification revisited, for a radius of 0.5 m."""
    way = goal[:2] - start[:2]
    a, b = np.array([start[2], goal[2]]) - math.atan2(way[1], way[0])
    least = abs(math.sin(a)) + abs(math.sin(b)) + math.sqrt(4 - (math.cos(a) + math.cos(b)) ** 2)
    return np.hypot(*way) / 0.5 > least


def test_strictly_an_object_is_relocated_to_the_nearest_far_place_from_which_the_path_is_clear():
    """All places of 24 random problems are tried."""
    random, relocated = np.random.default_rng(6), 0
    for _ in range(24):
        item, goal = random.uniform([-1.9, -1.9, -3.0], [1.9, 1.9, 3.0], (2, 3))
        expected = []
        for turn in TURNS:
            ends = se2.compose(item, turn), se2.compose(goal, turn)
            path, length = dubins(*ends, 0.5)
            if large(path, 0):
                expected.append(length)
                continue
            places = []
            for direction in [] if far(*ends) else TURNS:
                for steps in range(1, 51):
                    ahead = se2.compose(direction, np.array([0.1 * steps, 0.0, 0.0]))
                    there = se2.compose(item, se2.compose(ahead, se2.inverse(direction)))
                    if not large(there[None], 0):
                        break
                    start = se2.compose(there, turn)
                    path, length = dubins(start, ends[1], 0.5)
                    if far(start, ends[1]) and large(path, 0):
                        places.append((steps, 0.1 * steps + length))
            nearest = [length for steps, length in places if steps == min(places)[0]]
            expected += nearest[:1]
            relocated += bool(nearest)
        plans = dubins_plans(item, [goal], SQUARE, large, strict=True)
        assert [p.length for p in plans] == pytest.approx(sorted(expected))
    assert relocated >= 5


@pytest.mark.parametrize("seed", mostly_long(range(40), 4))
def test_goals_in_an_open_room_are_reached(seed):
    """Any heading: where no path fits into the room, after a straight push."""
    random = np.random.default_rng(seed)
    goal = random.uniform([-0.9, -0.6, -math.pi], [0.9, 0.6, math.pi])
    status, item = run(goal)
    off = se2.between(goal, item)
    assert status.phase == JobPhase.IDLE and status.pushes >= 1
    assert status.code == JobError.NONE, status.reason
    assert np.hypot(*off[:2]) <= 0.02 and abs(se2.wrap(off[2])) <= 0.1


@pytest.mark.long
def test_paths_keep_clear_of_the_map_and_the_bends_are_stable():
    """Of 15 random goals beside a wall with an end."""
    room = EnvironmentSpec((3.0, 2.4), boxes=(BoxSpec((0.0, -0.5), (0.1, 1.4)),))
    method, random, found = DubinsPusher(arena(room)), np.random.default_rng(3), 0
    field = method._side.field
    for _ in range(15):
        goal = random.uniform([0.4, -0.8, -1.5], [1.2, 0.8, 1.5])
        method.begin(Task((goal,)), BELIEF)
        sides = grips(0.85, BELIEF, ROBOT, OBJECT)
        item = BOX.mass_pose(START)
        for plan in method._plans(item, sides, ROBOT):
            grip, path = sides[plan.push], plan.path
            found += 1
            items = np.array([se2.compose(p, grip.grasp) for p in path])
            assert field.clearances(BOX.geometry.outline, items).min() >= 0.01
            assert field.clearances(ROBOT.outline, path).min() >= 0.01
            bends = [se2.wrap(t) for t in np.diff(path[:, 2])]
            bends = np.array(bends) / np.hypot(*np.diff(path[:, :2], axis=0).T)
            assert bends.max() <= grip.limits.maximum * 1.01
            assert bends.min() >= grip.limits.minimum * 1.01
    assert found > 20


def test_an_object_beside_a_wall_is_pushed_away_from_it():
    """It stands 5 mm from the left wall, and its goal is in the middle."""
    status, item = run([0.2, 0.3, 0.4], start=np.array([-1.45, 0.0, 0.0]), behind=[0.0, 0.4, 0.0])
    assert status.code == JobError.NONE, status.reason
    assert np.hypot(*(item[:2] - [0.2, 0.3])) <= 0.02


def test_hardly_any_friction_leaves_no_path_that_is_short_enough():
    path, length = dubins(START, np.array([0.5, 0.1, 0.2]), 1e6)
    assert length > 1e6 and not len(path)


def test_a_goal_behind_a_wall_has_no_path_and_the_job_says_so():
    room = EnvironmentSpec((3.0, 2.4), boxes=(BoxSpec((0.0, 0.0), (0.1, 2.4)),))
    status, item = run([0.8, 0.0, 0.0], room=room)
    assert status.code == JobError.PLANNING_FAILED and "no Dubins path is clear" in status.reason
    assert item == pytest.approx(START)


def test_where_no_path_is_clear_the_object_is_first_pushed_straight_on():
    goal = [-0.8, 0.9, 1.57]
    method = DubinsPusher(arena())
    method.begin(Task((np.array(goal),)), BELIEF)
    sides = grips(0.85, BELIEF, ROBOT, OBJECT)
    plans = method._plans(BOX.mass_pose(START), sides, ROBOT)
    assert plans and all(plan.relocates for plan in plans)
    status, item = run(goal)
    assert status.code == JobError.NONE and status.pushes == 2
    assert np.hypot(*(item[:2] - goal[:2])) <= 0.02
    status, _ = run(goal, attempts=1)
    assert status.code == JobError.OFF_TARGET and "after 1 pushes" in status.reason


@pytest.mark.parametrize(
    ("task", "words"),
    [
        (Task((np.array([0.3, 0.0, np.nan]),)), "needs a heading"),
        (Task(AHEAD.targets, (10.0,)), "a single goal, without times"),
    ],
)
def test_what_it_cannot_do_is_refused_with_the_reason(task, words):
    refused = METHOD.make(arena()).assess(task, BELIEF, HERE)
    assert isinstance(refused, Refusal) and refused.code is JobError.INVALID_GOAL
    assert words in refused.reason


def test_teams_it_cannot_drive_are_refused():
    with pytest.raises(SettingsError, match="method 'dubins-push' takes one"):
        METHOD.check({"e0": ROBOT, "e1": ROBOT}, BOX)
    with pytest.raises(SettingsError, match="flat bumper"):
        METHOD.check({"e0": load_robot("epuck_ring")}, BOX)


def test_a_robot_that_is_not_seen_stands_and_then_ends_the_task():
    method = DubinsPusher(arena())
    method.begin(AHEAD, BELIEF)
    method.step(HERE, BELIEF)
    told = [method.step(Seen(0.01 * k, START, {}), BELIEF) for k in range(1, 600)]
    assert not any(t.commands for t in told)
    assert method.status.code == JobError.POSES_STALE


@pytest.mark.long
def test_a_match_in_lockstep_is_equal_to_the_bit_with_equal_seeds():
    starts = np.array([HERE.robots["e0"]])
    believed = made_scenario("ahead", ROOM, ROBOT, starts, BOX, START)
    system = "push_study.rivals.dubins_push:METHOD"
    found = [run_team(system, believed, AHEAD, uncertainty("mild"), 3, 60.0) for _ in range(2)]
    assert all(o.success and o.error[0] < 0.02 and o.error[1] < 0.1 for o in found)
    first, second = (np.array(o.trace.ways) for o in found)
    assert np.array_equal(first, second)
