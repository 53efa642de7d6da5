import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from push_model import (
    EllipsoidLimitSurface,
    PressureLimitSurface,
    cone_edges,
    in_cone,
    polygon,
    rectangle,
    uniform_pressure_radius,
)


def test_uniform_pressure_on_a_square():
    # mean distance to the centre of a square of half side a: a (sqrt 2 + asinh 1) / 3
    expected = (math.sqrt(2) + math.asinh(1)) / 3
    assert uniform_pressure_radius(rectangle(2.0, 2.0)) == pytest.approx(expected, rel=1e-4)


def test_exact_surface_translates_with_full_force():
    surface = PressureLimitSurface.uniform(polygon(np.array([[0, 0], [3, 0], [1, 2]])), 2.0)
    assert surface.wrench(np.array([0.3, 0.4, 0.0])) == pytest.approx([1.2, 1.6, 0.0], abs=1e-9)
    assert not surface.wrench(np.zeros(3)).any()


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(-20, 20))
def test_maximum_dissipation(vx, vy, omega):
    """No admissible wrench dissipates more than the one that the surface gives."""
    twist = np.array([vx, vy, omega])
    surface = PressureLimitSurface.uniform(rectangle(0.1, 0.06), 1.0, points=400)
    best = surface.wrench(twist) @ twist
    for other in np.random.default_rng(0).normal(size=(10, 3)):
        assert surface.wrench(other) @ twist <= best + 1e-9


def test_ellipsoid_metrics_are_inverse_and_wrench_lies_on_the_surface():
    e = EllipsoidLimitSurface(2.0, 0.1)
    assert e.wrench_metric @ e.twist_metric == pytest.approx(np.eye(3))
    w = e.wrench(np.array([0.1, -0.2, 3.0]))
    assert w @ e.wrench_metric @ w == pytest.approx(1.0)
    direction = e.twist_direction(w)
    assert np.cross(direction, [0.1, -0.2, 3.0]) == pytest.approx(np.zeros(3), abs=1e-9)


@given(st.floats(0.01, 2.0), st.floats(-3, 3), st.floats(-math.pi, math.pi))
def test_cone_edges_are_the_border_of_the_cone(mu, heading, direction):
    normal = np.array([math.cos(heading), math.sin(heading)])
    edges = cone_edges(normal, mu)
    for edge in edges:
        assert in_cone(edge, normal, mu)
        outward = edge + 0.01 * (edge - normal)
        assert not in_cone(outward, normal, mu)
    del direction
