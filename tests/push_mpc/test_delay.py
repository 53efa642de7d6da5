"""Late and missing poses: robot and object are both known at the same time, and carried to now."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from push_estimation.dead_reckoning import DeadReckoning
from push_model import CurvatureLimits, DifferentialDrive, se2, unicycle_step
from push_model.trajectory import along_curve
from push_mpc import LtvMpc, MpcSettings, Push, Task, TrackError, TrackerSettings, TrajectoryTracker
from tests.samples import mostly_long

DRIVE = DifferentialDrive(0.0205, 0.0265, 6.28)
GRASP = np.array([0.095, 0.0, 0.0])
FRICTION = 0.16  # of the bumper; the limits of +-2.1 per metre believe in 0.2
NONE = np.zeros((0, 3))
MS = 1e-3  # [s] of the simulation, of which rates and delays are whole multiples


def attached(grasp, v, omega):
    """The object in the robot frame, a millisecond later: fixed."""
    return grasp


def pushed(grasp, v, omega):
    """A flat bumper and an ellipsoidal limit surface: it slides where the stick limit is passed.

    The centre of mass moves along (v - omega y, omega x) in the robot frame when it sticks; where
    that leaves the friction cone, the object slides along the bumper until it does not.
    """
    ahead, across = v - omega * grasp[1], omega * grasp[0]
    slide = float(np.clip(across, -FRICTION * ahead, FRICTION * ahead)) - across
    return grasp + np.array([0.0, slide * MS, 0.0]) if ahead > 0.0 else grasp


class LateWorld:
    """A robot with an object at its bumper, whose frames come ``delay`` late, every ``period``."""

    def __init__(self, period_ms, delay_ms, robot, grasp, law):
        self.period, self.delay, self.law = period_ms, delay_ms, law
        self.past = [(robot, grasp)]  # a state each millisecond

    @property
    def now(self):
        robot, grasp = self.past[-1]
        return robot, se2.compose(robot, grasp)

    def run(self, v, omega, milliseconds):
        for _ in range(milliseconds):
            robot, grasp = self.past[-1]
            after = unicycle_step(robot, v, omega, MS)
            self.past.append((after, self.law(grasp, v, omega)))

    def frame(self, number):
        """Robot and object as the frame shows them."""
        robot, grasp = self.past[number * self.period]
        return robot, se2.compose(robot, grasp)


def bend(kappa, length, speed=0.07):
    way = np.linspace(0.0, length, 150)
    theta = kappa * way
    x, y = way * np.sinc(theta / np.pi), 0.5 * kappa * way**2 * np.sinc(theta / (2 * np.pi)) ** 2
    return along_curve(np.column_stack([x, y]), theta, np.full(len(way), kappa), DRIVE, speed, 0.05)


def drive(world, trajectory, random, settings=None, drop=0.0, noise=0.0):
    """A push to its end; yields the world as each tick left it."""
    assumed = replace(settings or TrackerSettings(), pose_delay=world.delay * MS)
    tracker = TrajectoryTracker(assumed, LtvMpc(MpcSettings(), DRIVE))
    tracker.start(Task(trajectory, Push(GRASP, CurvatureLimits(-2.1, 2.1)), NONE, 0.006, 0.03))
    world.run(0.0, 0.0, world.delay)
    last, age = world.frame(0)[0], 0.0
    for k in range(100000 // world.period):
        robot, item = world.frame(k)
        blur = noise * random.normal(size=(2, 3)) * [1.0, 1.0, 8.7]
        age += world.period * MS
        if random.random() >= drop or k == 0:
            last, age = robot + blur[0], 0.0
        seen = item + blur[1] if random.random() >= drop else None
        tick = tracker.tick(world.period * MS, last, seen, age=age)
        yield tick, world
        if tick.finished:
            return
        world.run(tick.v, tick.omega, world.period)


def draw(seed, shortest=0.1, longest=0.4):
    """Period and delay [ms], a bend, and where robot and object start."""
    random = np.random.default_rng(seed)
    period = int(random.choice([5, 8, 10, 20, 33, 40]))
    delay = int(random.integers(0, 151))
    length = random.uniform(shortest, longest)
    trajectory = bend(random.uniform(-1.3, 1.3), length, random.uniform(0.03, 0.1))
    robot = random.normal(size=3) * [0.003, 0.004, 0.03]
    grasp = GRASP + random.normal(size=3) * [0.001, 0.004, 0.02]
    return random, period, delay, trajectory, robot, grasp


@given(st.integers(0, 10**6))
def test_dead_reckoning_is_exact_whatever_delay_age_and_rate(seed):
    """Random twists, periods that vary, delays that are no multiple of them, frames left out."""
    random = np.random.default_rng(seed)
    delay = int(random.integers(0, 200))
    reckoning, robot = DeadReckoning(delay * MS), random.normal(size=3)
    past = [robot] * (delay + 1)  # a pose each millisecond; the robot stood before
    measured = len(past) - 1 - delay
    for _ in range(40):
        v, omega, period = random.normal(), 5.0 * random.normal(), int(random.integers(1, 50))
        for _ in range(period):
            past.append(unicycle_step(past[-1], v, omega, MS))
        reckoning.record(period * MS, v, omega)
        frame = len(past) - 1 - delay
        if random.random() < 0.7:
            measured = frame
        age = (frame - measured) * MS
        at_frame = reckoning.at_frame(past[measured], age)
        now = reckoning.now(at_frame)
        reckoning.forget(age)
        for mine, true in ((at_frame, past[frame]), (now, past[-1])):
            assert mine[:2] == pytest.approx(true[:2], abs=1e-9)
            assert abs(se2.wrap(float(mine[2] - true[2]))) < 1e-9


@pytest.mark.long
@pytest.mark.parametrize("drop", [0.3, 0.0])
def test_an_attached_box_has_no_offset_whatever_the_delay(drop):
    """Any delay of 0-150 ms, any rate: its place in the robot frame is right to 0.1 mm."""
    delays, fastest = [], 0.0
    for seed in range(150):
        random, period, delay, trajectory, robot, grasp = draw(seed)
        world = LateWorld(period, delay, robot, grasp, attached)
        end = se2.compose(trajectory.pose[-1], GRASP)
        for _, (tick, _) in zip(
            range(60), drive(world, trajectory, random, drop=drop), strict=False
        ):
            if tick.object_offset == 0.0:
                continue  # the object has not been seen yet
            assert abs(tick.object_offset - (grasp[1] - GRASP[1])) < 1e-4
            off = se2.between(end, world.now[1])  # what is left to go, now and not in the frame
            assert tick.position_error == pytest.approx(math.hypot(off[0], off[1]), abs=1e-4)
            fastest = max(fastest, abs(tick.v) + 0.1 * abs(tick.omega))
        assert tick.code is TrackError.NONE, (seed, tick.message)
        delays.append(delay)
    assert min(delays) < 10 and max(delays) > 140 and fastest > 0.1


@pytest.mark.parametrize("law", [attached, pushed])
@pytest.mark.parametrize("drop", mostly_long([0.3, 0.0], 1))
def test_a_push_with_slow_late_poses_ends_where_it_should(law, drop):
    """25 Hz and 80 ms, noise of the motion capture on both poses, frames without one or both."""
    slid = 0.0
    for seed in range(12):
        random, _, _, trajectory, robot, grasp = draw(1000 + seed, 0.5, 0.8)
        robot, grasp = 0.4 * robot, GRASP + 0.4 * (grasp - GRASP)  # as an approach leaves them
        world = LateWorld(40, 80, robot, grasp, law)
        end = se2.compose(trajectory.pose[-1], GRASP)
        *_, (tick, _) = drive(world, trajectory, random, drop=drop, noise=2e-4)
        assert tick.code is TrackError.NONE, (seed, tick.message)
        off = se2.between(end, world.now[1])
        assert math.hypot(off[0], off[1]) < 3e-3, (seed, off)
        slid = max(slid, float(np.ptp([grasp[1] for _, grasp in world.past])))
    assert (slid > 1e-4) == (law is pushed)


def test_an_object_that_is_not_seen_keeps_its_place():
    """A frame without it moves neither the estimate nor the reference."""
    _, _, _, trajectory, robot, grasp = draw(4)
    tracker = TrajectoryTracker(TrackerSettings(), LtvMpc(MpcSettings(), DRIVE))
    tracker.start(Task(trajectory, Push(GRASP, CurvatureLimits(-2.1, 2.1)), NONE, 0.006, 0.03))
    before = None
    for k in range(200):
        tick = tracker.tick(0.01, robot, se2.compose(robot, grasp) if k % 5 == 0 else None)
        if before is not None:
            assert tick.object_offset == pytest.approx(before.object_offset, abs=1e-12)
            assert np.abs(tick.error[:3] - before.error[:3]).max() < 3e-3
        before = tick
        robot = unicycle_step(robot, tick.v, tick.omega, 0.01)


def test_a_task_that_follows_another_knows_how_the_robot_moved_before():
    """Stopped on its way, a few frames at rest or none, then the next task: no jump of the pose."""
    fastest = 0.0
    for seed in range(40):
        random, period, delay, trajectory, robot, _ = draw(seed)
        world = LateWorld(period, delay, robot, GRASP, attached)
        settings = replace(TrackerSettings(), pose_delay=delay * MS)
        tracker = TrajectoryTracker(settings, LtvMpc(MpcSettings(), DRIVE))
        task = Task(trajectory, None, NONE, 0.006, 0.03)
        tracker.start(task)
        world.run(0.0, 0.0, delay)
        moving, resting = int(random.integers(5, 800 // period)), int(random.integers(0, 6))
        for k in range(moving + resting + 1):
            if k < moving:
                tick = tracker.tick(period * MS, world.frame(k)[0], None)
                v, omega = tick.v, tick.omega
            elif k < moving + resting:
                tracker.rest(period * MS)
                assert (tracker.v, tracker.omega) == (0.0, 0.0)
                v = omega = 0.0
            else:
                tracker.stop()
                tracker.start(task)
                tick = tracker.tick(period * MS, world.frame(k)[0], None)
                place, _ = trajectory.sample(np.array([tracker._clock.time]))
                true = se2.between(place[0], world.now[0])
                assert tick.error[:3] == pytest.approx(true, abs=1e-6)
            world.run(v, omega, period)
            fastest = max(fastest, v)
    assert fastest > 0.03
