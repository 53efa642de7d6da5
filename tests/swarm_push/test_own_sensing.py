"""A swarm whose robots have only their own sensing: what they are told, and what they achieve."""

import math
from dataclasses import replace

import numpy as np
import pytest

from push_job.method import Arena, Certificate, Refusal, Seen, Task
from push_job.open_room import OpenRoom, OpenRoomSettings
from push_model import se2
from push_model.belief import Belief
from push_model.jobs import JobError, JobPhase
from push_model.occupancy import rasterise
from push_model.outlines import distance, inside
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from push_scenario.scatter import around
from sim_bridge.planar_world import PlanarWorld
from swarm_push.local_law import LocalLaw, LocalLawSettings, seen_centre
from swarm_push.own_sensing import METHOD, OwnSensing
from swarm_push.robot_sensor import RobotSensor, RobotSensorSettings
from tests.samples import mostly_long

SQUARE, ROBOT = load_object("transport_square"), load_robot("epuck_ring")
RADIUS, SPEED = ROBOT.footprint_radius, ROBOT.max_speed
EXACT = RobotSensorSettings(distance_error=0.0, least_error=0.0, odometry_error=0.0)
START, GOAL = np.array([-0.7, -0.7, 0.4]), np.array([0.7, 0.7, math.nan])


def sensor(settings=EXACT, outline=SQUARE.geometry.outline, size=(50.0, 50.0), seed=1):
    return RobotSensor(outline, size, settings, seed)


def scene(seed, count=12):
    """Pose of the object, of robots about it, and a target; far from all walls."""
    random = np.random.default_rng(seed)
    pose = np.array([*random.uniform(-1.0, 1.0, 2), random.uniform(-math.pi, math.pi)])
    robots = around(random, count, SQUARE, RADIUS)
    robots = np.array([se2.compose(pose, r) for r in robots])
    return pose, robots, random.uniform(-3.0, 3.0, 2)


def test_a_scan_sees_the_sides_that_face_the_robot_and_no_farther_than_its_range():
    """300 scenes: points lie on the outline, and the line to each does not pass through it."""
    most = 0
    for seed in range(300):
        pose, robots, target = scene(seed, 3)
        near = replace(EXACT, range=float(np.random.default_rng(seed).uniform(0.2, 1.6)))
        outline = se2.transform(pose, SQUARE.geometry.outline)
        for robot, reading in zip(robots, sensor(near).look(pose, robots, target), strict=True):
            away = float(distance(outline, robot[None, :2])[0])
            points = se2.transform(robot, reading.object)
            assert np.all(np.hypot(*reading.object.T) < near.range)
            if away > near.range:
                assert not len(points)
                continue
            assert np.all(distance(outline, points) < 1e-6)
            between = robot[:2] + np.linspace(0.01, 0.99, 20)[:, None, None] * (points - robot[:2])
            assert not inside(outline, between.reshape(-1, 2)).any()
            most = max(most, len(points))
            assert np.allclose(se2.transform(robot, reading.target[None])[0], target)
    assert most > 60


def test_robots_behind_the_object_are_not_seen_and_walls_are():
    pose = np.zeros(3)
    robots = np.array([[-0.4, 0.0, 0.3], [0.4, 0.0, 1.0], [-0.4, 0.3, 2.0]])
    readings = sensor(size=(2.0, 20.0)).look(pose, robots, np.ones(2))
    assert [len(r.robots) for r in readings] == [1, 0, 1]
    assert np.allclose(se2.transform(robots[0], readings[0].robots)[0], robots[2, :2])
    for robot, reading, x in zip(robots, readings, (-1.0, 1.0, -1.0), strict=True):
        walls = se2.transform(robot, reading.walls)
        assert [x, robot[1]] in walls.round(9).tolist() and len(walls) <= 2


def test_errors_of_the_sensor_are_as_large_as_they_are_said_to_be():
    exact = sensor().look(*scene(3))
    drawn = []
    for seed in range(200):
        noisy = sensor(RobotSensorSettings(), seed=seed).look(*scene(3))
        for one, other in zip(exact, noisy, strict=True):
            if len(one.object) == len(other.object) > 0:
                away = np.hypot(*one.object.T)
                drawn.append((np.hypot(*other.object.T) - away) / (1e-3 + 0.01 * away))
    errors = np.concatenate(drawn)
    assert len(errors) > 10_000 and errors.std() == pytest.approx(1.0, abs=0.03)
    assert abs(errors.mean()) < 0.03


def test_odometry_tells_the_motion_of_the_robot_alone():
    look = sensor()
    pose, robots, target = scene(5)
    look.look(pose, robots, target)
    moved = np.array([se2.compose(r, np.array([0.01, -0.004, 0.05])) for r in robots])
    for reading in look.look(pose + 0.3, moved, target):
        assert np.allclose(reading.moved, [0.01, -0.004, 0.05])


@pytest.mark.long
def test_no_robot_uses_a_common_frame_or_a_robot_that_it_does_not_see():
    """200 scenes, two ticks each: moved and turned as a whole, they give every robot the same
    command in its own frame; and a robot that is behind the object may be anywhere there."""
    differ = 0
    for seed in range(200):
        pose, robots, target = scene(seed)
        frame = np.random.default_rng(seed).uniform(-3.0, 3.0, 3)
        told = commands(pose, robots, target)
        turned = [se2.compose(frame, p) for p in (pose, *robots)]
        elsewhere = commands(turned[0], np.array(turned[1:]), se2.transform(frame, target[None])[0])
        assert np.allclose(told, elsewhere, atol=1e-9)
        readings = sensor().look(pose, robots, target)
        at = se2.transform(robots[0], readings[0].robots)
        hidden = [
            k for k in range(1, 12) if np.hypot(*(at - robots[k, :2]).T).min(initial=9) > 1e-6
        ]
        if hidden:
            fewer = np.delete(robots, hidden, axis=0)
            assert np.allclose(commands(pose, fewer, target)[0], told[0])
            differ += 1
    assert differ > 100


def commands(pose, robots, target):
    """``(n, 2)`` [m/s] of each robot in its own frame, at the second of two ticks."""
    look, laws = sensor(), [LocalLaw(RADIUS, SPEED, LocalLawSettings()) for _ in robots]
    for tick in range(2):
        readings = look.look(pose, robots, target)
        told = [law.step(r, 0.02 * tick) for law, r in zip(laws, readings, strict=True)]
    return np.array(told)


def test_the_centre_of_a_square_is_found_from_any_side():
    """200 places all round it, from contact to 1 m: within a fifth of the diagonal."""
    worst = 0.0
    for k in range(200):
        random = np.random.default_rng(k)
        pose = np.array([0.0, 0.0, random.uniform(-math.pi, math.pi)])
        angle, off = random.uniform(-math.pi, math.pi), random.uniform(0.0, 1.0)
        towards = np.array([math.cos(angle), math.sin(angle)])
        outline = se2.transform(pose, SQUARE.geometry.outline)
        away = RADIUS + off
        while distance(outline, (away * towards)[None])[0] < RADIUS or inside(
            outline, (away * towards)[None]
        ):
            away += 0.002
        robot = np.array([*(away * towards), random.uniform(-math.pi, math.pi)])
        (reading,) = sensor(RobotSensorSettings()).look(pose, robot[None], np.ones(2))
        centre, _ = seen_centre(reading.object)
        worst = max(worst, float(np.hypot(*se2.transform(robot, centre[None])[0])))
    assert worst < 0.2 * 0.4 * math.sqrt(2.0)


def made(item=SQUARE, room=None, count=20, **settings):
    """A method for an empty room of 5 m, its belief."""
    grid = rasterise(room or EnvironmentSpec((5.0, 5.0), resolution=0.05))
    robots = {f"e{i}": ROBOT for i in range(count)}
    sections = {"": OpenRoomSettings(**settings)}
    return METHOD.make(Arena(grid, robots, "object", item, sections)), Belief(
        {"object": item}, robots
    )


def drive(item, seed, limit, count=20, true=None, **settings):
    """The status after a task, the time [s] that it took, and the closest gap [m] of robots."""
    method, belief = made(item, count=count, seed=seed, **settings)
    places = around(np.random.default_rng([seed, count]), count, item, RADIUS)
    robots = {f"e{i}": (ROBOT, se2.compose(START, p)) for i, p in enumerate(places)}
    room = EnvironmentSpec((5.0, 5.0), resolution=0.05)
    closest, tick = math.inf, 0
    method.begin(Task((GOAL,)), belief)
    with PlanarWorld(room, robots, {"object": (true or item, START)}) as world:
        while method.status.phase != JobPhase.IDLE and tick < 100 * limit:
            poses = world.poses()
            seen = Seen(tick / 100, poses["object"], {n: poses[n] for n in robots})
            for name, told in method.step(seen, belief).commands.items():
                world.command(name, *told)
            world.step(round(0.01 / world.time_step))
            at = np.array([poses[n][:2] for n in robots])
            gaps = np.hypot(*(at[:, None] - at).transpose(2, 0, 1))[np.triu_indices(count, 1)]
            closest, tick = min(closest, float(gaps.min()) - 2.0 * RADIUS), tick + 1
    return method.status, tick / 100, closest


@pytest.mark.parametrize(
    ("name", "seed"), mostly_long([("square", 1), ("square", 2), ("triangle", 1)], 0)
)
def test_twenty_robots_bring_an_object_two_metres(name, seed):
    status, seconds, closest = drive(load_object(f"transport_{name}"), seed, 60.0)
    assert status.code == 0, status.reason
    assert seconds * SPEED / math.hypot(1.4, 1.4) < 3.0 and closest > -2e-3


@pytest.mark.long
def test_an_object_that_is_too_heavy_ends_the_job():
    heavy = replace(SQUARE, mass=200.0)
    status, seconds, _ = drive(SQUARE, 1, 60.0, count=6, true=heavy, stalled=8.0)
    assert status.code == JobError.EXECUTION_FAILED and seconds < 40.0
    assert status.reason == "the object has not come closer for 8 s"


def test_headings_and_trajectories_are_refused():
    method, belief = made()
    answer = method.assess(Task((np.zeros(3),)), belief, None)
    assert isinstance(answer, Refusal) and "positions" in answer.reason
    timed = method.assess(Task((GOAL,), (1.0,)), belief, None)
    assert isinstance(timed, Refusal) and timed.code is JobError.INVALID_GOAL
    assert isinstance(method.assess(Task((GOAL,)), belief, None), Certificate)


def test_a_robot_that_sees_nothing_goes_to_those_that_it_sees_else_to_the_target():
    near = replace(EXACT, range=0.5)
    robots = np.array([[2.0, 0.0, 1.0], [2.3, 0.0, 2.0], [-2.0, 0.0, 3.0]])
    room = OpenRoom((9.0, 9.0), SQUARE, RADIUS, SPEED, np.array([0.0, 2.0]), 1)
    told = OwnSensing(room, LocalLawSettings(), near).velocities(0.0, np.zeros(3), robots)
    assert told[0] == pytest.approx([SPEED, 0.0], abs=1e-6)
    assert told[2] == pytest.approx(SPEED * np.array([1.0, 1.0]) / math.sqrt(2.0), abs=1e-6)


def test_what_is_remembered_of_the_object_is_forgotten_where_it_is_lost():
    """The frame of the robot turns meanwhile: afterwards it pushes as one that has seen nothing."""
    robots = np.array([[-0.27, 0.05, 0.3]])
    seen = lambda pose: sensor().look(np.array(pose), robots, np.array([3.0, 3.0]))[0]  # noqa: E731
    one, other = (LocalLaw(RADIUS, SPEED, LocalLawSettings()) for _ in range(2))
    for tick in range(20):
        one.step(seen([0.0, -1e-3 * tick, 0.0]), 0.02)
    again = seen([0.0, 0.0, 0.0])
    drifted = LocalLaw.step(one, again, 0.0)
    one.step(seen([20.0, 0.0, 0.0]), 0.02)
    assert np.array_equal(one.step(again, 0.02), other.step(again, 0.0))
    assert not np.allclose(drifted, other.step(again, 0.0))


def test_poses_that_cannot_be_give_commands_that_are_finite():
    """Robots on the outline, in the object and in each other; time that stands still or goes back;
    robots that come and go; an object that is at its target, or not seen."""
    room = OpenRoom((9.0, 9.0), SQUARE, RADIUS, SPEED, np.array([1.0, 0.0]), 1)
    law = OwnSensing(room, LocalLawSettings(), EXACT)
    for time, x, robots in (
        *((1.0, 0.0, [[-0.2, 0.0, 0.0], [-0.2, 0.2, 2.0]]), (1.0, 0.0, [[0.1, 0.0, 1.0]] * 2)),
        *((0.5, 0.0, [[-0.3, 0.0, 0.0]]), (0.6, 1.0, [[0.72, 0.0, 0.0], [0.8, 0.0, 0.0]])),
        (0.7, math.nan, [[0.72, 0.0, 0.0], [0.8, 0.0, 0.0]]),
    ):
        told = law.velocities(time, np.array([x, 0.0, 0.0]), np.array(robots))
        assert told.shape == (len(robots), 2) and np.isfinite(told).all(), (time, x, robots)


@pytest.mark.long
def test_robots_far_away_that_see_only_each_other_find_the_object():
    """They went to each other and stood there for ever."""
    grid = EnvironmentSpec((5.0, 5.0), resolution=0.05)
    method, belief = made(room=grid, count=6, seed=4)
    places = [(2.0 + 0.15 * (k % 2), 2.0 + 0.15 * (k // 2), float(k)) for k in range(6)]
    robots = {f"e{i}": (ROBOT, np.array(p)) for i, p in enumerate(places)}
    method.begin(Task((np.array([-0.5, -1.5, math.nan]),)), belief)
    start, tick = np.array([-1.5, -1.5, 0.0]), 0
    with PlanarWorld(grid, robots, {"object": (SQUARE, start)}) as world:
        while method.status.phase != JobPhase.IDLE and tick < 50 * 240:
            poses = world.poses()
            seen = Seen(tick / 50, poses["object"], {n: poses[n] for n in robots})
            for name, told in method.step(seen, belief).commands.items():
                world.command(name, *told)
            world.step(round(0.02 / world.time_step))
            tick += 1
    assert method.status.code == 0, (method.status, poses)
