"""Stable pushes against friction-cone geometry written out independently."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from push_model import (
    EllipsoidLimitSurface,
    PressureLimitSurface,
    contact_on_side,
    curvature_limits,
    line_contact_grasp,
    lynch_mason_stable,
    polygon,
    rectangle,
    shifted_limits,
    uniform_pressure_radius,
)

SQUARE = rectangle(0.09, 0.09)
SURFACE = EllipsoidLimitSurface(1.0, uniform_pressure_radius(SQUARE))
POLYGONS = [
    SQUARE,
    rectangle(0.12, 0.06),
    polygon(np.array([[0, 0], [0.12, 0], [0.06, 0.1]])),
    polygon(np.array([[math.cos(a), math.sin(a)] for a in np.arange(5) * 1.2566]) * 0.06),
    polygon(np.array([[0, 0], [0.1, 0], [0.12, 0.06], [0.03, 0.09]])),
]


@pytest.mark.parametrize("mu", [0.2, 0.3, 0.5])
@pytest.mark.parametrize("axle", [0.0, 0.05, 0.12])
def test_square_on_a_whole_side(mu, axle):
    limits = curvature_limits(contact_on_side(SQUARE.sides[0], 0.09), axle, mu, SURFACE)
    assert 1 / limits.maximum == pytest.approx((0.045 + axle) / mu, rel=1e-6)
    assert 1 / limits.minimum == pytest.approx(-(0.045 + axle) / mu, rel=1e-6)


def test_narrow_bumper_is_limited_by_its_edge():
    c = SURFACE.radius
    limits = curvature_limits(contact_on_side(SQUARE.sides[0], 0.03), 0.05, 0.7, SURFACE)
    # the line of force meets the contact at -(c^2 + a (D + a)) / R
    assert 1 / limits.maximum == pytest.approx((c**2 + 0.045 * 0.095) / 0.015, rel=1e-6)


@pytest.mark.parametrize("shape", POLYGONS)
@pytest.mark.parametrize("mu", [0.2, 0.5])
def test_limits_separate_wrenches_inside_and_outside_the_contact_cone(shape, mu):
    """A wrench is possible if it is a non-negative sum of the four edges of the contact's cones."""
    from scipy.optimize import nnls

    surface = PressureLimitSurface.uniform(shape, 1.0)
    for side in shape.sides:
        contact = contact_on_side(side, 0.07)
        limits = curvature_limits(contact, 0.05, mu, surface)
        grasp = line_contact_grasp(
            contact.centre[0],
            contact.right - contact.centre[1],
            contact.left - contact.centre[1],
            mu,
        )
        c, s = math.cos(contact.heading), math.sin(contact.heading)
        points = surface.points @ np.array([[c, s], [-s, c]])
        turned = PressureLimitSurface(points, surface.weights, 1.0)
        for bound in (limits.minimum, limits.maximum):
            for factor, possible in ((0.98, True), (1.02, False)):
                kappa = bound * factor
                arm = 0.05 + contact.centre[0]
                twist = np.array([1 - kappa * contact.centre[1], kappa * arm, kappa])
                wrench = turned.wrench(twist)
                scale = np.array([1.0, 1.0, 20.0])
                _, rest = nnls(grasp * scale[:, None], wrench * scale)
                assert (rest < 1e-3) == possible, (side.index, kappa, rest)


@given(st.floats(-0.01, 0.01), st.floats(0.2, 0.6))
def test_offset_shifts_the_radius(offset, mu):
    """(2.54): R_lim + y_or, checked on the friction cone itself."""
    nominal = curvature_limits(contact_on_side(SQUARE.sides[0], 0.09), 0.05, mu, SURFACE)
    shifted = shifted_limits(nominal, offset)
    for kappa in (shifted.minimum, shifted.maximum):
        across, along = kappa * 0.095, 1 - kappa * offset
        assert abs(across) / along == pytest.approx(mu, rel=1e-6)


def test_offset_centre_gives_asymmetric_limits():
    contact = contact_on_side(SQUARE.sides[0], 0.07, along=0.055)
    limits = curvature_limits(contact, 0.05, 0.2, SURFACE)
    assert abs(1 / limits.maximum + 1 / limits.minimum) == pytest.approx(
        2 * abs(contact.centre[1]), rel=1e-5
    )


def test_no_stable_push_when_the_centre_is_beside_the_contact():
    wide = rectangle(0.05, 0.4)
    contact = contact_on_side(wide.sides[0], 0.04, along=0.05)
    surface = EllipsoidLimitSurface(1.0, uniform_pressure_radius(wide))
    assert curvature_limits(contact, 0.05, 0.3, surface) is None


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_lynch_mason_region_holds_for_every_pressure_distribution(seed):
    random = np.random.default_rng(seed)
    shape = POLYGONS[random.integers(len(POLYGONS))]
    contact = contact_on_side(shape.sides[random.integers(len(shape.sides))], 0.07)
    mu = float(random.uniform(0.2, 1.0))
    turn = 1 if random.random() < 0.5 else -1
    centres = random.uniform(-1.5, 1.5, (200, 2))
    stable = centres[lynch_mason_stable(centres, turn, contact, shape, mu)]
    n = len(shape.outline)
    half = random.dirichlet(np.ones(n), 6) @ shape.outline
    points = np.vstack([half, -0.25 * half])  # weighted so that the centroid is the origin
    share = random.dirichlet(np.ones(6))
    weights = np.concatenate([0.2 * share, 0.8 * share])
    c, s = math.cos(contact.heading), math.sin(contact.heading)
    surface = PressureLimitSurface(points @ np.array([[c, s], [-s, c]]), weights, 1.0)
    for q in stable:
        arm = contact.centre - q
        fx, fy, torque = surface.wrench(turn * np.array([-arm[1], arm[0], 1.0]))
        at = contact.centre[1] - (contact.centre[0] * fy + torque) / fx
        assert fx > 0 and abs(fy) <= mu * fx + 1e-9
        assert contact.right - 1e-9 <= at <= contact.left + 1e-9


def test_lynch_mason_region_is_inside_the_exact_limits():
    contact = contact_on_side(SQUARE.sides[0], 0.07)
    y = np.linspace(0.1, 5.0, 500)
    stable = lynch_mason_stable(np.column_stack([np.full(500, -0.05), y]), 1, contact, SQUARE, 0.2)
    exact = 1 / curvature_limits(contact, 0.05, 0.2, SURFACE).maximum
    assert stable.any() and y[stable].min() > exact


def test_grasp_matrix_of_a_square_is_2_41():
    s, mu, theta = 0.045, 0.3, 0.7
    t = math.atan(mu)
    c, n = math.cos, math.sin
    printed = np.array(
        [
            [c(theta - t), n(theta - t), s * (c(t) + n(t))],
            [c(theta + t), n(theta + t), s * (c(t) - n(t))],
            [c(theta - t), n(theta - t), s * (n(t) - c(t))],
            [c(theta + t), n(theta + t), -s * (c(t) + n(t))],
        ]
    ).T
    assert line_contact_grasp(s, -s, s, mu, theta) == pytest.approx(printed)
