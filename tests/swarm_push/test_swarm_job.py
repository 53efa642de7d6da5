"""Jobs of a swarm in the planar world: both laws, poses, the dead, the missing, moved targets."""

import math
from dataclasses import replace

import numpy as np
import pytest

from push_model import se2
from push_model.jobs import JobError, JobPhase
from push_model.occupancy import OccupancyGrid
from push_model.specs import EnvironmentSpec
from push_msgs.action import SwarmMove
from push_ros.validation import InvalidMessage
from push_scenario.bodies import load_object, load_robot
from push_scenario.scatter import around as starts
from push_study.uncertainty import uncertainty
from swarm_push.crescent_law import CrescentLawSettings
from swarm_push.laws import LawSections, LawSettings
from swarm_push.node import targets_from_ros
from swarm_push.region import covered_region, is_open
from swarm_push.swarm_job import SwarmJob, SwarmJobSettings
from tests.driving import GroupWorld, drive
from tests.samples import mostly_long

ROBOT = load_robot("epuck_ring")
NONE = np.zeros((0, 3))
HALF = 2.0
REGION = (HALF - ROBOT.footprint_radius) * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])


def job_of(item, law="crescent", **changes):
    laws = LawSections(law=LawSettings(law=law))
    return SwarmJob(REGION, item, ROBOT, SwarmJobSettings(**changes), laws)


def play(job, name, count, seed=1, limit=300.0, meanwhile=None, world="planar"):
    """The object's last pose and the time that the job took; meanwhile: told job and world."""
    item = load_object(name)
    random = np.random.default_rng(seed)
    begin = starts(random, count, item, ROBOT.footprint_radius)
    room = EnvironmentSpec((2 * HALF, 2 * HALF), resolution=0.05)
    with GroupWorld(
        room, ROBOT, begin, item, np.zeros(3), uncertainty("mild"), seed, world
    ) as running:
        while running.time < limit and job.busy:
            if meanwhile is not None:
                meanwhile(job, running)
            pose, robots = running.see()
            here = dict(zip(running.names, robots, strict=True))
            twists = job.step(running.time, item.mass_pose(pose), here, NONE)
            running.step(np.array([twists[n] for n in running.names]))
        return item.mass_pose(running.truth()[0]), running.time


NAMES = ("swarm_square", "swarm_ellipse", "swarm_rectangle", "plate_triangle", "swarm_flower")


@pytest.mark.parametrize("seed", mostly_long(range(10), 1))
def test_random_poses_are_reached(seed):
    random = np.random.default_rng(seed)
    name, count = NAMES[seed % 5], int(random.integers(5, 14))
    target = np.array([*random.uniform(-1.2, 1.2, 2), random.uniform(-3.0, 3.0)])
    job = job_of(load_object(name))
    job.begin([target])
    pose, _ = play(job, name, count, seed)
    assert job.error is JobError.NONE and job.state is JobPhase.IDLE, job.reason
    assert np.hypot(*(pose - target)[:2]) < 0.02  # in truth, not only as it was seen
    assert abs(se2.wrap(pose[2] - target[2])) < 0.05


@pytest.mark.long
@pytest.mark.parametrize("law", ["crescent", "thesis"])
def test_targets_in_a_row_are_reached_by_both_laws(law):
    # The printed law may take minutes to get behind the object.
    job = job_of(load_object("swarm_square"), law, position_tolerance=0.1, stalled=300.0)
    targets = [np.array([0.6, 0.3, math.nan]), np.array([0.0, 0.0, math.nan])]
    job.begin(targets)
    pose, time = play(job, "swarm_square", 6)
    assert job.error is JobError.NONE and len(job.times) == 2 and sum(job.times) <= time
    assert np.hypot(*pose[:2]) < 0.105


@pytest.mark.long
def test_the_crescent_is_far_ahead_of_the_printed_law():
    times = []
    for law in ("crescent", "thesis"):
        job = job_of(load_object("swarm_square"), law, position_tolerance=0.1)
        job.begin([np.array([1.0, 0.5, math.nan])])
        times.append(play(job, "swarm_square", 5)[1])
    assert times[0] < 0.5 * times[1]


@pytest.mark.long
def test_the_rest_finish_when_four_of_ten_die():
    def kill(job, world):
        if 4.0 <= world.time < 4.02:
            world.kill(world.names[:4])

    job = job_of(load_object("swarm_square"), position_tolerance=0.1)
    job.begin([np.array([0.8, 0.4, math.nan]), np.array([-0.4, 0.4, math.nan])])
    play(job, "swarm_square", 10, meanwhile=kill)
    assert job.error is JobError.NONE, job.reason


@pytest.mark.long
def test_a_target_that_is_moved_is_followed():
    def move(job, world):
        if 8.0 <= world.time < 8.02:
            job.retarget(np.array([0.3, 0.9, math.nan]))

    job = job_of(load_object("swarm_square"), position_tolerance=0.1)
    job.begin([np.array([1.0, 0.0, math.nan])])
    pose, _ = play(job, "swarm_square", 8, meanwhile=move)
    assert job.error is JobError.NONE and np.hypot(*(pose[:2] - [0.3, 0.9])) < 0.105


@pytest.mark.parametrize("layout", ["one", "two", "line", "same place"])
def test_few_and_degenerate_robots_are_moved_without_ado(layout):
    """Coverage stays defined: commands are finite, and they lead somewhere."""
    item = load_object("swarm_square")
    points = {
        "one": [[-0.6, 0.1]],
        "two": [[-0.6, 0.1], [-0.6, -0.2]],
        "line": [[-0.6, y] for y in (-0.4, -0.2, 0.0, 0.2, 0.4)],
        "same place": [[-0.6, 0.0]] * 4,
    }[layout]
    for law in ("crescent", "thesis"):
        job = job_of(item, law)
        job.begin([np.array([1.0, 0.0, math.nan])])
        robots = {f"e{i}": np.array([*p, 0.0]) for i, p in enumerate(points)}
        twists = np.array(list(job.step(0.0, np.zeros(3), robots, NONE).values()))
        assert np.isfinite(twists).all() and np.abs(twists).max() > 0.01
        wheels = np.array([ROBOT.differential.wheel_speeds(v, w) for v, w in twists])
        assert np.abs(wheels).max() <= ROBOT.differential.max_wheel_speed * (1.0 + 1e-9)


@pytest.mark.long
def test_one_robot_pushes_as_far_as_it_can():
    job = job_of(load_object("swarm_octagon"), position_tolerance=0.1)
    job.begin([np.array([0.5, 0.0, math.nan])])
    play(job, "swarm_octagon", 1)
    assert job.error is JobError.NONE, job.reason


def test_no_robot_and_only_dead_ones_are_told():
    item = load_object("swarm_square")
    job = job_of(item, alone=2.0)
    job.begin([np.array([1.0, 0.0, math.nan])])
    for k in range(150):
        assert job.step(0.02 * k, np.zeros(3), {}, NONE) == {}
    assert job.error is JobError.POSITIONING_FAILED and "no robot" in job.reason
    job.begin([np.array([1.0, 0.0, math.nan])])
    still = {"a": np.array([-0.8, 0.1, 0.0]), "b": np.array([-0.8, -0.3, 0.0])}
    for k in range(1500):
        twists = job.step(0.02 * k, np.zeros(3), still, NONE)
    assert job.error is JobError.POSITIONING_FAILED and "carries out its commands" in job.reason
    assert not any(any(t) for t in twists.values())


def push_heavy(mass, **changes):
    """Three robots behind the square, of some mass [kg], push it ahead in the simulated world: the
    job, the time that it took [s] and how far the object has gone [m]."""
    heavy = replace(load_object("swarm_square"), mass=mass)
    job = SwarmJob(REGION, heavy, ROBOT, SwarmJobSettings(**changes), LawSections())
    job.begin([np.array([1.0, 0.0, math.nan])])
    room = EnvironmentSpec((2 * HALF, 2 * HALF), resolution=0.05)
    begin = np.array([[-0.4, 0.1, 0.0], [-0.4, -0.1, 0.0], [-0.4, 0.25, 0.0]])
    with GroupWorld(
        room, ROBOT, begin, heavy, np.zeros(3), uncertainty("none"), 1, "planar"
    ) as world:
        while world.time < 60.0 and job.busy:
            pose, robots = world.see()
            twists = job.step(world.time, pose, dict(zip(world.names, robots, strict=True)), NONE)
            world.step(np.array([twists[n] for n in world.names]))
        return job, world.time, float(np.hypot(*world.truth()[0][:2]))


@pytest.mark.long
def test_an_object_that_its_robots_cannot_move_is_given_up_soon_and_no_robot_is_blamed():
    """6.5 N are needed, three robots have 5.9 N."""
    job, time, moved = push_heavy(2.2)
    assert job.error is JobError.TOO_HEAVY and "at least 4 robots" in job.reason
    assert time == pytest.approx(SwarmJobSettings().alone, abs=0.1) and moved < 5e-3
    assert not job.dead


@pytest.mark.long
def test_an_object_that_its_robots_can_just_move_is_not_refused():
    """5.3 N are needed."""
    job, _, moved = push_heavy(1.8)
    assert job.error is JobError.NONE and moved > 0.9


def test_robots_that_are_just_enough_are_given_less_time_without_progress():
    """5.6 N are needed, three robots have 5.9 N at best; nothing moves."""
    heavy = replace(load_object("swarm_square"), mass=1.9)
    job = SwarmJob(REGION, heavy, ROBOT, SwarmJobSettings(doubtful=5.0), LawSections())
    job.begin([np.array([1.0, 0.0, math.nan])])
    still, time = {f"e{k}": np.array([-0.24, 0.12 * (k - 1), 0.0]) for k in range(3)}, 0.0
    while job.busy and time < 20.0:
        job.revive()  # robots that do not move are no matter here
        job.step(time, np.zeros(3), still, NONE)
        time += 0.02
    assert job.error is JobError.EXECUTION_FAILED and "needs 5.59 N, has 5.9" in job.reason
    assert time == pytest.approx(5.0, abs=0.1)


def test_robots_that_come_and_leave_take_part_as_long_as_they_are_there():
    item, job = load_object("swarm_square"), job_of(load_object("swarm_square"))
    job.begin([np.array([1.0, 0.0, math.nan])])
    random = np.random.default_rng(0)
    poses = starts(random, 8, item, ROBOT.footprint_radius)
    for k in range(200):
        there = {f"e{i}": poses[i] for i in range(8) if (i + k // 40) % 3}
        twists = job.step(0.02 * k, np.zeros(3), there, NONE)
        assert set(twists) == set(there) == set(job.taking_part) | (set(there) & job.dead)
        assert np.isfinite(list(twists.values())).all()


def test_the_region_is_the_rectangle_about_free_cells():
    occupied = np.zeros((40, 60), dtype=np.bool_)
    occupied[:2], occupied[-2:], occupied[:, :2], occupied[:, -2:] = True, True, True, True
    grid = OccupancyGrid(occupied, 0.05, np.array([-1.5, -1.0]))
    corners = covered_region(grid, 0.05)
    assert is_open(grid)
    assert np.allclose(corners, [[-1.35, -0.85], [1.35, -0.85], [1.35, 0.85], [-1.35, 0.85]])
    assert covered_region(grid, 1.0) is None
    occupied[20, 30] = True
    assert not is_open(grid) and np.array_equal(covered_region(grid, 0.05), corners)
    occupied[20] = True  # a wall right across
    assert not is_open(grid) and np.array_equal(covered_region(grid, 0.05), corners)
    full = OccupancyGrid(np.ones((4, 4), dtype=np.bool_), 0.05, np.zeros(2))
    assert covered_region(full, 0.0) is None and not is_open(full)


def test_targets_of_the_action():
    without = targets_from_ros(SwarmMove.Goal(x=[1.0, 2.0], y=[0.0, 1.0])).targets
    assert len(without) == 2 and all(math.isnan(t[2]) for t in without)
    (given,) = targets_from_ros(SwarmMove.Goal(x=[1.0], y=[0.0], theta=[0.5 * math.pi])).targets
    assert np.allclose(given, [1.0, 0.0, 0.5 * math.pi])
    for x, y, theta in (
        ([], [], []), ([1.0], [], []), ([1.0], [1.0], [0.0, 1.0]), ([math.inf], [0.0], []),
        ([0.0] * 1001, [0.0] * 1001, []),
    ):  # fmt: skip
        with pytest.raises(InvalidMessage):
            targets_from_ros(SwarmMove.Goal(x=x, y=y, theta=theta))


def test_a_patient_law_waits_for_who_is_in_front():
    """With patience the push begins after those in front have left, or when it has run out."""
    item = load_object("swarm_square")
    behind = [[-0.24, 0.1], [-0.24, -0.1]]
    for front, begins in (([], 0.0), ([[0.238, 0.0]], 1.0)):
        laws = LawSections(crescent=CrescentLawSettings(patience=1.0))
        job = SwarmJob(REGION, item, ROBOT, SwarmJobSettings(), laws)
        job.begin([np.array([1.0, 0.0, math.nan])])
        robots = {f"e{i}": np.array([*p, 0.0]) for i, p in enumerate(behind + front)}
        when = None
        for k in range(100):
            job.step(0.02 * k, np.zeros(3), robots, NONE)
            if job.state is JobPhase.PUSHING and when is None:
                when = 0.02 * k
        assert when == pytest.approx(begins, abs=0.05)


def test_warming_up_leaves_no_trace():
    job = job_of(load_object("swarm_square"))
    job.warm_up()
    assert not job.busy and job.error is JobError.NONE and job.target is None
    assert job.last is None and not job.dead and job.index == 0


@pytest.mark.long
def test_discs_that_go_in_any_direction_reach_a_pose():
    item, disc = load_object("swarm_square"), load_robot("disc")
    job = SwarmJob(REGION, item, disc, SwarmJobSettings(), LawSections())
    assert job.holonomic
    target = np.array([0.7, -0.5, 1.0])
    job.begin([target])
    begin = starts(np.random.default_rng(5), 12, item, disc.footprint_radius)
    room = EnvironmentSpec((2 * HALF, 2 * HALF), resolution=0.05)
    with GroupWorld(
        room, disc, begin, item, np.zeros(3), uncertainty("mild"), 5, "planar"
    ) as world:
        drive(job, world, item, 200.0)
        pose = world.truth()[0]
    assert job.error is JobError.NONE, job.reason
    assert np.hypot(*(pose - target)[:2]) < 0.02  # in truth, not only as it was seen
    assert abs(se2.wrap(pose[2] - target[2])) < 0.05
