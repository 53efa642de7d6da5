"""The margin by which a push sticks, from the intervals of a belief; and its alarm."""

import math

import numpy as np
import pytest

from push_model.belief import Belief, Interval
from push_model.stable_push import contact_on_side, curvature_limits
from push_mpc.certified_push import PushCertificate
from push_mpc.task import Push


@pytest.fixture
def push(robot, box):
    contact = contact_on_side(box.geometry.sides[0], robot.flat_bumper.width)
    limits = curvature_limits(
        contact, robot.push_distance, box.contact_friction, box.limit_surface()
    )
    grasp = contact.object_pose + np.array([robot.push_distance, 0.0, 0.0])
    return Push(grasp, limits)


def believed(robot, box, **values):
    made = Belief({"box": box}, {"me": robot})
    return made.updated({("box", k): Interval(*v) for k, v in values.items()})


def test_without_an_interval_nothing_is_certified(robot, box, push):
    for values in ({}, {"contact_friction": (0.2, 0.2, 0.2)}):
        certificate = PushCertificate(push, robot, believed(robot, box, **values), "box")
        assert not certificate.known and math.isnan(certificate.margin(0.1, 0.1, 0.0))


def test_the_margin_is_that_of_the_least_friction_and_the_alarm_names_it(robot, box, push):
    belief = believed(robot, box, contact_friction=(0.2, 0.1, 0.3))
    certificate = PushCertificate(push, robot, belief, "box")
    weaker = curvature_limits(
        contact_on_side(box.geometry.sides[0], robot.flat_bumper.width),
        robot.push_distance, 0.1, box.limit_surface(),
    )  # fmt: skip
    assert certificate.limits == weaker
    assert certificate.margin(0.1, 0.0, 0.0) == pytest.approx(0.1 * weaker.maximum)
    assert not certificate.alarm
    tight = 0.9 * push.limits.maximum  # stable for the value, but not for the whole interval
    assert certificate.margin(0.1, 0.1 * tight, 0.0) < 0.0
    assert not certificate.alarm
    certificate.margin(0.1, 0.1 * 1.1 * push.limits.maximum, 0.0)
    assert certificate.alarm == (
        "the object is expected to slip: the friction of 'box' is believed to be 0.2, between 0.1 "
        "and 0.3"
    )
    assert math.isnan(certificate.margin(0.0, 0.1, 0.0)), "it stands"


def test_intervals_that_reach_beyond_the_object_certify_nothing(robot, box, push):
    belief = believed(robot, box, com_x=(0.0, -0.2, 0.2))
    assert not PushCertificate(push, robot, belief, "box").known
