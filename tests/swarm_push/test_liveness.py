"""Which robots are declared dead, and which are only held up."""

import math

import numpy as np
import pytest

from push_job.method import Arena, Seen, Task
from push_model import se2
from push_model.belief import Belief
from push_model.jobs import JobError
from push_model.occupancy import rasterise
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from push_study.uncertainty import uncertainty
from swarm_push.contacts import Contacts, find_contacts
from swarm_push.crescent_law import CrescentLaw
from swarm_push.law import Scene
from swarm_push.liveness import LivenessCheck, LivenessSettings
from swarm_push.region import covered_region
from swarm_push.rim import Rim
from swarm_push.swarm_job import SwarmJob, SwarmJobSettings
from swarm_push.swarm_method import SwarmMethod
from tests.driving import GroupWorld, drive

NAMES = ("a", "b", "c")
DT = 0.02
SQUARE = 0.1 * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])


def call(wheels=True):
    return LivenessCheck(LivenessSettings(), wheels)


def contacts_of(poses, touched):
    """An object 0.15 m ahead along x of each robot that is touched; robots are far apart."""
    at = np.flatnonzero(touched)
    middle = poses[at].mean(axis=0)[:2] + [0.15, 0.0] if len(at) else np.zeros(2)
    none = np.zeros((0, 2), dtype=np.intp)
    return Contacts(poses[:, :2], touched, none, at, middle, none, np.zeros((0, 3)))


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
        contacts = contacts_of(poses[here], touched[here])
        twists = roll.step(time, alive, poses[here], wanted, contacts)
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


def test_a_robot_that_stands_in_the_open_is_turned_first_and_dead_when_it_does_not_turn():
    roll, poses = call(), stand()
    told = play(roll, poses, ("goes", "dead", "goes"), np.zeros(3, dtype=bool), 1.7)
    assert not roll.dead and all(t["b"][1] == 0.0 for t in told)
    told = play(roll, poses, ("goes", "dead", "goes"), np.zeros(3, dtype=bool), 4.5, 1.7)
    assert set(roll.dead) == {"b"}
    turns = {float(t["b"][1]) for t in told if "b" in t}
    assert max(turns) > 1.0 and min(turns) < -1.0  # both ways
    assert all(t["a"][1] == t["c"][1] == 0.0 for t in told)


def test_a_robot_that_is_held_up_by_what_is_not_known_to_be_there_lives():
    """It turns when it is told to, but goes no way: an outline that is believed too small."""
    roll, poses = call(), stand()
    told = play(roll, poses, ("goes", "turns", "goes"), np.zeros(3, dtype=bool), 60.0)
    assert not roll.dead
    tested = [t["b"][1] > 1.0 for t in told]
    begun = [k * DT for k in range(1, len(tested)) if tested[k] and not tested[k - 1]]
    assert begun[0] < 2.2  # in the open after 2 s, then as one that is in contact: after 6 s
    assert len(begun) > 3 and min(np.diff(begun)[:3]) > 5.0


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


def discs(free, until, touched=True, turning=()):
    """Three discs that are told to go along x at 0.1 m/s; disc k moves in directions ``free[k]``
    alone, and turns if it is among the turning. The dead, and all commands."""
    roll, poses, time, told = call(wheels=False), stand(), 0.0, []
    while time < until:
        alive = tuple(n for n in NAMES if n not in roll.dead)
        here = [NAMES.index(n) for n in alive]
        twists = np.tile([0.1, 0.0, 0.0], (len(here), 1))
        at = contacts_of(poses[here], np.full(len(here), touched))
        twists = roll.step(time, alive, poses[here], twists, at)
        both = dict(zip(alive, twists[:, :2], strict=True))
        both |= {
            n: np.array(t)
            for n, t in roll.try_again(time, dict(zip(NAMES, poses, strict=True))).items()
        }
        told.append(both)
        for name, omega in roll.turns.items():
            poses[NAMES.index(name), 2] += DT * omega * (NAMES.index(name) in turning)
        for name, speed in both.items():
            k = NAMES.index(name)
            for way in free[k]:
                poses[k, :2] += DT * max(0.0, float(speed @ way)) * np.array(way)
        time += DT
    return roll.dead, told


AHEAD, BACK, LEFT = np.array([1.0, 0.0]), np.array([-1.0, 0.0]), np.array([0.0, 1.0])


def test_discs_that_press_on_something_live_as_long_as_they_can_move_away_from_it():
    dead, told = discs(((AHEAD, BACK), (BACK,), (LEFT,)), 40.0)
    assert not dead
    away = [t["b"][0] < 0.0 for t in told]
    first = away.index(True) * DT
    assert 5.0 < first < 6.5  # tested when it has pressed for 6 s, away from the contact at once
    assert any(t["c"][1] > 0.0 for t in told) and not any(t["a"][0] < 0.0 for t in told)


def test_dead_discs_are_found_out_and_stay_dead_when_they_are_tried_again():
    dead, told = discs(((AHEAD, BACK), (), ()), 9.0)
    assert set(dead) == {"b", "c"}
    ways = {tuple(np.sign(np.round(t["b"], 6))) for t in told if "b" in t}
    assert {(1, 0), (-1, 0), (0, 1), (0, -1)} <= ways
    dead, told = discs(((AHEAD, BACK), (), ()), 60.0)
    assert set(dead) == {"b", "c"}
    tried = [k * DT for k, t in enumerate(told) if "b" in t and k * DT > 12.0]
    assert tried and 30.0 < tried[0] < 42.0


@pytest.mark.parametrize("touched", [True, False])
def test_a_disc_that_is_jammed_on_all_sides_lives_as_long_as_it_can_turn(touched):
    """In a jam, or between walls, which nobody counts as contacts; one that cannot is dead."""
    assert set(discs(((AHEAD, BACK), (), ()), 60.0, touched, turning=(1,))[0]) == {"c"}
    assert not discs(((), (), ()), 60.0, touched, turning=(0, 1, 2))[0]


def test_discs_draw_back_from_one_that_is_tested_and_cannot_move_at_once():
    """Disc b in the middle of a row; who presses on it through another one draws back too."""
    names, time, drawn = ("a", "b", "c", "d"), 0.0, set()
    roll = LivenessCheck(LivenessSettings(), wheels=False)
    poses = np.array([[-0.1, 0.0, 0.0], [0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.2, 0.0, 0.0]])
    wanted = np.array([[0.0, 0, 0], [0.1, 0.0, 0.0], [0.0, 0, 0], [0.0, 0, 0]])
    while time < 9.0 and "b" not in roll.dead:
        at = find_contacts(np.array([9.0, 9, 0]), SQUARE, poses[:, :2], 0.05, np.zeros((0, 3)))
        twists = roll.step(time, names, poses, wanted, at)
        drawn |= {(n, float(np.sign(twists[k, 0]))) for k, n in enumerate(names) if n != "b"}
        time += DT
    assert {("a", -1.0), ("c", 1.0), ("d", 1.0)} <= drawn
    assert not drawn & {("a", 1.0), ("c", -1.0), ("d", -1.0)}


def test_neighbours_stop_pressing_while_a_robot_is_tested_that_did_not_turn_at_once():
    """Robot b can turn only while a does not press on it."""
    roll, poses, time, turned = call(), stand()[:2], 0.0, []
    poses[1, 1] = 0.1
    while time < 12.0:
        contacts = find_contacts(
            np.array([9.0, 9, 0]), SQUARE, poses[:, :2], 0.05, np.zeros((0, 3))
        )
        assert set(map(tuple, contacts.pairs)) == {(0, 1)} and contacts.touched.all()
        alive = tuple(n for n in NAMES[:2] if n not in roll.dead)
        assert alive == NAMES[:2]
        twists = roll.step(time, alive, poses, np.tile([0.1, 0.0], (2, 1)), contacts)
        pressed = twists[0].any()
        if not pressed:
            poses[1, 2] += DT * twists[1, 1]
            turned.append(time)
        poses[0, 2] += DT * twists[0, 1]
        time += DT
    assert turned and not roll.dead


def test_who_flickers_out_of_sight_hides_nobody_who_is_dead():
    """Robot c is seen in every second frame alone: b, which stands in the open, is found out."""
    roll, poses = call(), stand()
    for k in range(250):
        names = tuple(n for n in NAMES[: 2 + k % 2] if n not in roll.dead)
        here = [NAMES.index(n) for n in names]
        contacts = contacts_of(poses[here], np.zeros(len(here), dtype=bool))
        twists = roll.step(
            k * DT, names, poses[here], np.tile([0.1, 0.0], (len(here), 1)), contacts
        )
        for n, (v, _) in zip(names, twists, strict=True):
            poses[NAMES.index(n), 0] += 0.0 if n == "b" else DT * v * (2.0 if n == "c" else 1.0)
    assert set(roll.dead) == {"b"}


def test_contacts_and_the_way_out_of_them():
    """Discs of 5 cm about a square of 20 cm: gaps up to 1 cm count, by hand."""
    points = np.array([[-0.155, 0.0], [-0.255, 0.0], [0.0, 0.165], [0.5, 0.5], [0.62, 0.5]])
    fixed = np.array([[0.5, 0.65, 0.1]])
    contacts = find_contacts(np.zeros(3), SQUARE, points, 0.05, fixed)
    assert contacts.touched.tolist() == [True, True, False, True, False]
    assert set(map(tuple, contacts.pairs)) == {(0, 1)} and contacts.neighbours(1) == {0}
    assert np.allclose(contacts.away(1), [-1.0, 0.0]) and np.allclose(contacts.away(3), [0.0, -1.0])
    assert not contacts.away(0).any()  # between the object and a robot
    turned = find_contacts(np.array([0.0, 0.0, 0.25 * math.pi]), SQUARE, points, 0.05, fixed)
    assert turned.at_object.tolist() == [0, 2]  # corners reach out to 0.141 m


@pytest.mark.long
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


def test_robots_that_are_not_seen_are_not_told_to_turn():
    """Discs that do not move are told to turn; then the poses of all of them are missing."""
    item, disc = load_object("swarm_square"), load_robot("disc")
    specs, belief = dict.fromkeys(NAMES, disc), Belief({"box": item}, dict.fromkeys(NAMES, disc))
    grid = rasterise(EnvironmentSpec((6.0, 6.0)))
    method, here = SwarmMethod(Arena(grid, specs, "box", item)), np.zeros(3)
    method.begin(Task((np.array([1.0, 0.0, 0.0]),)), belief)
    poses = {n: np.array([-1.0, 0.5 * k, 0.0]) for k, n in enumerate(NAMES)}
    now, told = 0.0, {}
    while now < 30.0 and not any(len(c) > 2 and c[2] for c in told.values()):
        now += DT
        told = method.step(Seen(now, here, poses), belief).commands
    turning = [n for n, c in told.items() if len(c) > 2 and c[2]]
    assert turning and method.job.turns.keys() == set(turning)
    for seen in ((), poses.keys() - {turning[0]}):
        for _ in range(50):
            now += DT
            told = method.step(Seen(now, here, {n: poses[n] for n in seen}), belief).commands
            assert told.keys() <= set(seen)
