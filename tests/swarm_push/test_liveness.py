"""Who is dead, and who is only in a jam."""

import math

import numpy as np
import pytest

from push_model import se2
from push_model.jobs import JobError
from push_model.occupancy import rasterise
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from push_study.group_world import GroupWorld
from push_study.uncertainty import uncertainty
from swarm_push.crescent_law import CrescentLaw
from swarm_push.law import Scene
from swarm_push.liveness import LivenessCheck
from swarm_push.region import covered_region
from swarm_push.rim import Rim
from swarm_push.swarm_job import SwarmJob, SwarmJobSettings
from tests.driving import drive

NAMES = ("a", "b", "c")
DT = 0.02


def call(wheels=True):
    return LivenessCheck(2.0, 0.1, 6.0, 30.0, wheels)


def stand():
    return np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 2.0, 0.0]])


def play(roll, poses, obeys, touched, until, begin=0.0):
    """Robots told to go ahead at 0.1 m/s of which some do, some only turn, and some do nothing."""
    told = []
    time = begin
    while time < until:
        alive = tuple(n for n in NAMES if n not in roll.dead)
        here = [NAMES.index(n) for n in alive]
        wanted = np.tile([0.1, 0.0], (len(alive), 1))
        twists = roll.step(time, alive, poses[here], wanted, touched[here])
        tried = roll.try_again(time, {n: poses[i] for i, n in enumerate(NAMES)})
        all_told = {**dict(zip(alive, twists, strict=True)), **tried}
        told.append(all_told)
        for name, (v, omega) in all_told.items():
            i = NAMES.index(name)
            if obeys[i] == "goes":
                poses[i, :2] += DT * v * np.array([math.cos(poses[i, 2]), math.sin(poses[i, 2])])
            if obeys[i] in ("goes", "turns"):
                poses[i, 2] += DT * omega
        time += DT
    return told


def test_who_stands_in_the_open_is_dead_soon_and_nobody_else():
    roll, poses = call(), stand()
    play(roll, poses, ("goes", "dead", "goes"), np.zeros(3, dtype=bool), 1.7)
    assert not roll.dead
    play(roll, poses, ("goes", "dead", "goes"), np.zeros(3, dtype=bool), 4.5, 1.7)
    assert set(roll.dead) == {"b"}


def test_who_is_held_up_is_dead_only_if_it_does_not_even_turn():
    roll, poses = call(), stand()
    told = play(roll, poses, ("goes", "dead", "turns"), np.ones(3, dtype=bool), 9.0)
    assert set(roll.dead) == {"b"}
    assert any(t.get("c", (0, 0))[1] > 1.0 for t in told)  # it was put to the test
    assert not any(t["a"][1] > 0.0 for t in told)
    play(roll, poses, ("goes", "dead", "turns"), np.ones(3, dtype=bool), 28.0, 9.0)
    assert set(roll.dead) == {"b"}


def test_the_dead_stay_dead_when_they_are_tried_again_and_who_turns_is_back():
    roll, poses = call(), stand()
    touched = np.zeros(3, dtype=bool)
    play(roll, poses, ("goes", "dead", "goes"), touched, 34.0)
    assert set(roll.dead) == {"b"}  # tried at about 32 s
    told = play(roll, poses, ("goes", "turns", "goes"), touched, 64.5, 34.0)
    assert "b" not in roll.dead or any(t.get("b", (0, 0))[1] > 1.0 for t in told)
    play(roll, poses, ("goes", "goes", "goes"), touched, 70.0, 64.5)
    assert not roll.dead


def test_robots_that_go_in_any_direction_are_not_told_to_turn():
    roll = call(wheels=False)
    time, poses = 0.0, np.zeros((3, 3))
    twists = np.tile([0.1, 0.0, 0.0], (3, 1))
    while time < 7.0:
        alive = tuple(n for n in NAMES if n not in roll.dead)
        here = [NAMES.index(n) for n in alive]
        back = roll.step(time, alive, poses[here], twists[here], np.ones(len(here), dtype=bool))
        assert np.array_equal(back, twists[here])
        poses[0, 0] += 0.1 * DT
        time += DT
    assert set(roll.dead) == {"b", "c"}


@pytest.mark.parametrize("seed", range(4))
def test_an_object_goes_round_a_robot_that_died_in_its_way(seed):
    """The dead one stands right before the square, on the way to its target."""
    item, robot = load_object("swarm_square"), load_robot("epuck_ring")
    room = EnvironmentSpec((4.0, 4.0), resolution=0.02)
    grid = rasterise(room)
    random = np.random.default_rng(seed)
    begin = np.array([[0.26, random.uniform(-0.1, 0.1), 1.0]])
    for k in range(6):
        begin = np.vstack([begin, [-0.6, 0.15 * (k - 2.5), random.uniform(-3.0, 3.0)]])
    job = SwarmJob(covered_region(grid, 0.05), item, robot, SwarmJobSettings(), grid=grid)
    job.begin([np.array([1.2, 0.0, math.nan])])
    with GroupWorld(
        room, robot, begin, item, np.zeros(3), uncertainty("mild"), seed, "planar"
    ) as world:
        world.kill(world.names[:1])
        before = world.truth()[1][0]
        drive(job, world, item, 200.0)
        pose, robots = world.truth()
    assert job.error is JobError.NONE, job.reason
    assert np.hypot(*(pose[:2] - [1.2, 0.0])) < 0.025
    assert job.dead == {"e0"} and np.hypot(*(robots[0] - before)[:2]) < 0.1


def test_nobody_is_sent_where_somebody_dead_stands():
    """Up to four of them at random at the object."""
    item, robot = load_object("swarm_square"), load_robot("epuck_ring")
    region, radius = 2.0 * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]]), robot.footprint_radius
    law = CrescentLaw(region, item, radius, robot.max_speed)
    rim, random, shut = Rim(item.geometry.outline, radius, 0.01), np.random.default_rng(0), 0
    for _ in range(200):
        pose = random.uniform(-1.0, 1.0, 3)
        at = random.choice(len(rim.points), random.integers(1, 5), replace=False)
        out = random.uniform(0.0, 0.08, len(at))[:, None]
        dead = se2.transform(pose, rim.points[at] - out * rim.normals[at])
        others = np.column_stack([dead, np.full(len(dead), radius)])
        robots = pose[:2] + random.uniform(-0.8, 0.8, (6, 2))
        target = np.array([*random.uniform(-1.5, 1.5, 2), math.nan])
        for some in (others, others[:0]):
            density = law.step(Scene(0.0, pose, robots, target, some, None)).density
            away = np.hypot(*(density.means[:, None] - dead).transpose(2, 0, 1)).min()
            if len(some):
                assert away > 1.8 * radius  # robots wait 1 cm off the line of contact
            else:
                shut += away < 1.8 * radius
    assert shut > 50  # places that would have been taken
