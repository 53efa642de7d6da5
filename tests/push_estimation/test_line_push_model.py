"""The model of a line contact against the stable-push analysis, statics, and the planar world."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from push_estimation.line_push_model import Bumper, Candidates, relative_rates
from push_model.limit_surface import EllipsoidLimitSurface
from push_model.stable_push import PusherContact, contact_margins

BUMPER = Bumper(0.05, 0.035)
SIDE = 0.09


def one(friction, depth, aside, radius=0.0345):
    return Candidates(*(np.array([v]) for v in (friction, depth, aside, radius)))


def rates(candidate, q, phi, v, omega):
    found = relative_rates(
        candidate, BUMPER, SIDE, np.array([q]), np.array([phi]), np.array([v, omega])
    )
    return float(found[0][0]), float(found[1][0])


CASES = {
    "friction": st.floats(0.05, 0.6),
    "depth": st.floats(0.03, 0.06),
    "aside": st.floats(-0.02, 0.02),
    "curvature": st.floats(-12.0, 12.0),
}


@given(**CASES)
def test_it_sticks_where_the_push_is_stable(friction, depth, aside, curvature):
    contact = PusherContact(np.array([depth, aside]), -0.035, 0.035, 0.0)
    surface = EllipsoidLimitSurface(1.0, 0.0345)
    cone, edge = contact_margins(curvature, contact, BUMPER.distance, friction, surface)
    assume(abs(cone) > 1e-6 and abs(edge) > 1e-6)
    slip, turn = rates(one(friction, depth, aside), 0.0, 0.0, 0.05, 0.05 * curvature)
    sticks = abs(slip) < 1e-12 and abs(turn) < 1e-12
    assert sticks == (min(cone, edge) > 0.0)


@given(phi=st.floats(-0.4, 0.4), **CASES)
def test_an_object_that_pivots_is_pushed_at_the_corner_within_the_cone(
    friction, depth, aside, curvature, phi
):
    """The wrench that the limit surface asks for the motion passes through the bumper's end."""
    assume(abs(phi) > 1e-3)
    v = 0.05
    omega = v * curvature
    candidate, surface = one(friction, depth, aside), EllipsoidLimitSurface(1.0, 0.0345)
    slip, turn = rates(candidate, 0.0, phi, v, omega)
    w = omega - turn
    end = np.sign(-phi) * BUMPER.half_width  # robot's frame, from the bumper's middle
    corner = np.array([v - omega * end, omega * BUMPER.distance])
    c, s = np.cos(phi), np.sin(phi)
    corner = np.array([c * corner[0] - s * corner[1], s * corner[0] + c * corner[1]])
    assume(corner[0] > 1e-3)
    # The middle of the bumper, where q is measured, and the material point of the object below it.
    behind = -BUMPER.half_width * abs(s)
    middle = s * v + c * omega * BUMPER.distance
    across = middle - slip - w * (behind - depth)
    # At the corner, object and bumper have one velocity along the normal.
    ahead = corner[0] + w * (end - aside)
    wrench = surface.wrench(np.array([ahead, across, w]))
    assume(ahead > 1e-4)
    assert abs(wrench[1]) <= friction * wrench[0] * (1.0 + 1e-6) + 1e-12
    arm = np.array([-depth, end - aside])
    assert wrench[2] == pytest.approx(arm[0] * wrench[1] - arm[1] * wrench[0], abs=1e-6)


def test_nothing_moves_relative_to_a_bumper_that_backs_off_but_the_bumper():
    slip, turn = rates(one(0.2, 0.045, 0.0), 0.0, 0.0, -0.05, 0.3)
    assert slip == pytest.approx(0.3 * BUMPER.distance) and turn == pytest.approx(0.3)
