"""The stick margin of a push, and the end of a push before the object slips."""

import math

import numpy as np
import pytest

from push_model import DifferentialDrive, along_curve, se2, unicycle_step
from push_model.belief import Belief, Interval
from push_model.stable_push import contact_on_side, curvature_limits
from push_model.stick_certificate import ContactBelief
from push_mpc import LtvMpc, MpcSettings, Push, Task, TrackError, TrackerSettings, TrajectoryTracker
from push_mpc.believed_push import believed_push
from push_mpc.tick_report import tick_report

DRIVE = DifferentialDrive(0.0205, 0.0265, 6.28)
STRAIGHT, SPEED = 0.3, 0.07  # [m], [m/s]


@pytest.fixture
def push(robot, box):
    contact = contact_on_side(box.geometry.sides[0], robot.flat_bumper.width)
    limits = curvature_limits(
        contact, robot.push_distance, box.contact_friction, box.limit_surface()
    )
    return Push(contact.object_pose + np.array([robot.push_distance, 0.0, 0.0]), limits)


def bend(kappa):
    """0.3 m straight on, then a bend of 0.4 m, whose curvature grows over 2 cm."""
    way = np.linspace(0.0, 0.7, 701)
    curvature = kappa * np.clip((way - STRAIGHT) / 0.02, 0.0, 1.0)
    heading = np.concatenate([[0.0], np.cumsum(0.001 * 0.5 * (curvature[1:] + curvature[:-1]))])
    middle = 0.5 * (heading[1:] + heading[:-1])
    steps = 0.001 * np.column_stack([np.cos(middle), np.sin(middle)])
    points = np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
    return along_curve(points, heading, curvature, DRIVE, SPEED, 0.2)


def believed(robot, box, **values):
    made = Belief({"box": box}, {"me": robot})
    return made.updated({("box", k): Interval(*v) for k, v in values.items()})


def told(push, robot, box, **values):
    belief = believed(robot, box, **values)
    return believed_push(push, robot, belief.object("box"), ContactBelief.of(belief, "box"))


def driven(push, way, after, tell=None, **settings):
    """Ticks of a push of ideal kinematics. tell: the push that is believed from a time on [s]."""
    tracker = TrajectoryTracker(TrackerSettings(**settings), LtvMpc(MpcSettings(), DRIVE))
    tracker.start(Task(way, push, np.zeros((0, 3)), 0.006, 0.03))
    robot = way.sample(np.zeros(1))[0][0]
    for k in range(2000):
        if tell is not None and k == round(100 * after):
            tracker.believe(tell, 0.0)
        tick = tracker.tick(0.01, robot, se2.compose(robot, push.grasp))
        yield 0.01 * k, tick
        if tick.finished:
            return
        robot = unicycle_step(robot, tick.v, tick.omega, 0.01)


def test_the_margin_is_that_of_the_least_friction(robot, box, push):
    now = told(push, robot, box, contact_friction=(0.2, 0.1, 0.3))
    contact = contact_on_side(box.geometry.sides[0], robot.flat_bumper.width)
    surface = box.limit_surface()
    assert now.uncertain and now.certified == curvature_limits(
        contact, robot.push_distance, 0.1, surface
    )
    ticks = [t for _, t in driven(push, bend(0.1), 0.0, now) if t.v > 0.03]
    margins = [t.stick_margin for t in ticks]
    wanted = [
        min(t.v * now.certified.maximum - t.omega, t.omega - t.v * now.certified.minimum)
        for t in ticks
    ]
    assert margins == pytest.approx(wanted, abs=1e-6) and min(margins) > 0.0
    figures = {f.name: f.value for f in tick_report(ticks[0], True).figures}
    assert figures["stick margin"] == margins[0]


def test_without_an_interval_there_is_no_margin(robot, box, push):
    for values in ({}, {"contact_friction": (0.2, 0.2, 0.2)}):
        now = told(push, robot, box, **values)
        assert not now.uncertain
        assert all(math.isnan(t.stick_margin) for _, t in driven(push, bend(0.1), 0.0, now))


def test_intervals_that_reach_beyond_the_object_certify_nothing(robot, box, push):
    now = told(push, robot, box, com_x=(0.0, -0.2, 0.2))
    assert now.uncertain and now.certified is None
    ticks = [t for _, t in driven(push, bend(0.1), 0.0, now) if t.v > 0.03]
    assert {t.stick_margin for t in ticks} == {-math.inf}


@pytest.mark.long
def test_a_push_ends_before_the_bend_on_which_the_object_would_slip(robot, box, push):
    """Forty frictions and bends; what is believed arrives at a random time."""
    random, ended = np.random.default_rng(1), 0
    for _ in range(40):
        kappa = random.choice([-1.0, 1.0]) * 0.75 * push.limits.maximum
        mu = random.uniform(0.05, 0.25)
        now = told(push, robot, box, contact_friction=(mu, 0.97 * mu, 1.03 * mu))
        limit = max(0.85 * now.limits.maximum, now.certified.maximum)
        way = bend(kappa)
        begins = way.time[np.flatnonzero(np.abs(way.twist[:, 1]) > limit * SPEED)]
        after = random.uniform(0.0, 3.0)
        *_, (time, tick) = driven(push, way, after, now)
        if abs(kappa) > 1.02 * limit:
            ended += 1
            assert tick.code is TrackError.SLIP_EXPECTED and tick.finished
            assert begins[0] - 1.2 <= time <= begins[0] - 0.8 or time == pytest.approx(after)
            told_of = float(tick.message.split("curvature of ")[1].split()[0])
            assert limit - 0.01 < math.copysign(1.0, kappa) * told_of < abs(kappa) + 0.01
            assert tick.v == tick.omega == 0.0
        else:
            assert tick.code is TrackError.NONE and not tick.alarm
    assert 10 < ended < 32


def test_it_only_warns_where_it_is_not_to_stop(robot, box, push):
    now = told(push, robot, box, contact_friction=(0.1, 0.09, 0.11))
    ticks = list(driven(push, bend(1.1), 1.0, now, stop_before_slip=False))
    warned = [(time, t) for time, t in ticks if t.alarm]
    assert ticks[-1][1].code is not TrackError.SLIP_EXPECTED
    assert warned and warned[0][1].slip_in == pytest.approx(1.0, abs=0.15)
    shown = {f.name: f.value for f in tick_report(warned[0][1], True).figures}
    assert shown["slip expected in"] == warned[0][1].slip_in
    quiet = list(driven(push, bend(1.1), 1.0, None))
    assert not any(t.alarm for _, t in quiet) and quiet[-1][1].code is TrackError.NONE


def test_a_narrow_interval_lets_a_push_turn_more_tightly(robot, box, push):
    """More than the trusted part of the values' curvature, and never more than is certified."""
    narrow = told(push, robot, box, contact_friction=(0.2, 0.196, 0.204))
    kappa = 0.95 * push.limits.maximum
    assert 0.85 * push.limits.maximum < kappa < narrow.certified.maximum
    *_, (_, tick) = driven(push, bend(kappa), 0.0, narrow)
    assert tick.code is TrackError.NONE and tick.position_error < 2e-3
    exact = told(push, robot, box, contact_friction=(0.2, 0.2, 0.2))
    *_, (_, tick) = driven(push, bend(kappa), 0.0, exact)
    assert tick.code is TrackError.SLIP_EXPECTED
