"""A certified curvature is stable for every friction and centre of mass that is believed."""

from dataclasses import replace

import numpy as np
import pytest

from push_model.belief import Belief, Interval
from push_model.pushable_sides import pushable_sides
from push_model.settings import SettingsError
from push_model.shape_specs import PolygonShape
from push_model.stable_push import CurvatureLimits, contact_on_side, curvature_limits
from push_model.stick_certificate import (
    ContactBelief,
    certified_limits,
    stick_margin,
    trusted_limits,
)


def drawn(rng, item):
    """A polygon, its centre of mass off the middle, and intervals about what is believed of it."""
    n = int(rng.integers(3, 8))
    angles = (np.arange(n) + rng.uniform(-0.3, 0.3, n)) * 2.0 * np.pi / n
    corners = rng.uniform(0.05, 0.1) * np.column_stack([np.cos(angles), np.sin(angles)])
    x, y = rng.uniform(-0.01, 0.01, 2)
    shape = PolygonShape(vertices=tuple((float(a), float(b)) for a, b in corners))
    friction = rng.uniform(0.08, 0.5)
    spread, (dx, dy) = rng.uniform(0.0, 0.5) * friction, rng.uniform(0.0, 0.015, 2)
    belief = ContactBelief(
        Interval(friction, friction - spread, friction + spread),
        Interval(x, x - dx, x + dx),
        Interval(y, y - dy, y + dy),
    )
    return replace(item, shape=shape, com=(float(x), float(y)), contact_friction=friction), belief


def within(rng, belief):
    intervals = (belief.friction, belief.com_x, belief.com_y)
    return [float(rng.uniform(i.low, i.high)) for i in intervals]


@pytest.mark.long
def test_it_is_stable_for_all_of_a_hundred_random_beliefs(robot, box):
    rng = np.random.default_rng(1)
    width, distance = robot.flat_bumper.width, robot.push_distance
    certified = 0
    while certified < 100:
        try:
            item, belief = drawn(rng, box)
            sides = pushable_sides(item.geometry, robot)
            side = sides[int(rng.integers(len(sides)))]
            limits = certified_limits(item, robot, belief, side.index)
        except SettingsError:  # a centre of mass outside the object
            continue
        if limits is None:
            continue
        certified += 1
        along = float(contact_on_side(side, width).centre[1] - side.start @ side.tangent)
        for _ in range(6):
            friction, x, y = within(rng, belief)
            true = replace(item, com=(x, y))
            (moved,) = (s for s in pushable_sides(true.geometry, robot) if s.index == side.index)
            contact = contact_on_side(moved, width, along)
            stable = curvature_limits(contact, distance, friction, true.limit_surface())
            assert stable.minimum <= limits.minimum < 0.0 < limits.maximum <= stable.maximum


def test_an_exact_belief_certifies_the_stable_curvatures_themselves(robot, box):
    exact = ContactBelief(*(Interval.exact(v) for v in (box.contact_friction, *box.com)))
    assert exact.exact
    for side in pushable_sides(box.geometry, robot):
        contact = contact_on_side(side, robot.flat_bumper.width)
        stable = curvature_limits(
            contact, robot.push_distance, box.contact_friction, box.limit_surface()
        )
        assert certified_limits(box, robot, exact, side.index) == stable


def test_less_knowledge_certifies_less_and_too_little_nothing(robot, box):
    widths = []
    for spread in (0.0, 0.02, 0.05, 0.1):
        middle = Interval(0.2, 0.2 - spread, 0.2 + spread)
        belief = ContactBelief(middle, Interval(0.0, -spread / 10, spread / 10), Interval.exact(0))
        limits = certified_limits(box, robot, belief, 0)
        widths.append(limits.maximum - limits.minimum)
    assert widths == sorted(widths, reverse=True) and widths[-1] < 0.6 * widths[0]
    nothing = ContactBelief(Interval(0.2, 0.0, 0.4), Interval.exact(0.0), Interval(0, -0.01, 0.01))
    limits = certified_limits(box, robot, nothing, 0)
    assert limits is None or limits.maximum < 1e-3, "without friction only the straight push"
    with pytest.raises(ValueError, match="does not reach side 9"):
        certified_limits(box, robot, nothing, 9)


def test_the_margin_is_the_turn_rate_that_is_left():
    limits = CurvatureLimits(-1.0, 2.0)
    assert stick_margin(limits, 0.1, 0.05) == pytest.approx(0.15)
    assert stick_margin(limits, 0.1, -0.12) == pytest.approx(-0.02), "it turns too tightly"
    right = stick_margin(limits, 0.1, 0.15, offset=-0.1)
    assert right == pytest.approx(0.1), "further right, the object may be turned left more tightly"
    assert stick_margin(None, 0.1, 0.0) == -np.inf


def test_what_may_be_used_is_the_greater_of_the_trusted_part_and_of_what_is_certain():
    stable = CurvatureLimits(-2.0, 1.0)
    assert trusted_limits(stable, 0.75, None) == CurvatureLimits(-1.5, 0.75)
    assert trusted_limits(stable, 0.75, CurvatureLimits(-1.8, 0.5)) == CurvatureLimits(-1.8, 0.75)


def test_a_belief_without_intervals_is_none(box, robot):
    belief = Belief({"box": box}, {"me": robot})
    assert ContactBelief.of(belief, "box") is None
    exact = belief.updated({("box", "contact_friction"): Interval.exact(0.3)})
    assert ContactBelief.of(exact, "box") is None
    some = belief.updated({("box", "com_x"): Interval(0.0, -0.01, 0.01)})
    found = ContactBelief.of(some, "box")
    assert found is not None and found.com_x.high == 0.01
    assert found.friction == Interval.exact(box.contact_friction)


def test_a_centre_of_mass_that_may_lie_outside_certifies_nothing(box, robot):
    wide = ContactBelief(Interval.exact(0.2), Interval(0.0, -0.2, 0.2), Interval.exact(0.0))
    assert certified_limits(box, robot, wide, 0) is None
