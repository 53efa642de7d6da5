"""The prediction against scipy's matrix exponential and numerical integration."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from push_mpc.prediction import OUTPUTS, SLACKS, condense, discretise

numbers = st.floats(-1, 1)


@given(numbers, st.floats(-0.5, 0.5), st.floats(-3, 3), st.floats(0.02, 0.3))
def test_discretisation_is_the_matrix_exponential(theta, v, omega, h):
    """(2.47)-(2.48)."""
    c, s = math.cos(theta), math.sin(theta)
    a = np.zeros((5, 5))
    a[0] = [0, omega, -s * v, c, 0]
    a[1] = [-omega, 0, c * v, s, 0]
    a[2, 4] = 1
    big = np.zeros((7, 7))
    big[:5, :5], big[3, 5], big[4, 6] = a, 1, 1
    exact = expm(big * h)
    A, B = np.zeros((5, 5)), np.zeros((5, 2))
    discretise(theta, v, omega, h, A, B)
    assert pytest.approx(exact[:5, :5], abs=1e-9) == A
    assert pytest.approx(exact[:5, 5:], abs=1e-9) == B


BEFORE = np.array([0.2, 0.5])  # [m/s^2], [rad/s^2] of the reference, at the previous input


def build(e0, nominal, ref, h=0.1, Q=None, forward=False):
    p = len(nominal)
    n = 2 * p + SLACKS
    H, f = np.zeros((n, n)), np.zeros(n)
    S, g, roll = np.zeros((p, OUTPUTS, 2 * p)), np.zeros((p, OUTPUTS)), np.zeros((p + 1, 5))
    Q = np.ones(5) if Q is None else Q
    before, R, Rd = np.array([0.1, -0.2]), np.array([0.3, 0.2]), np.array([0.1, 0.4])
    condense(e0, nominal, before, ref, h, Q, 3 * Q, R, Rd, forward, BEFORE, H, f, S, g, roll)
    return H, f, S[:, :5], g[:, :5], roll


@given(st.integers(0, 1000))
def test_rollout_is_the_nonlinear_error_dynamics(seed):
    """(2.38), and that it is the motion of two unicycles seen from one of them."""
    random = np.random.default_rng(seed)
    p, h = 5, 0.1
    u = random.normal(size=(p, 2)) * [0.2, 1.0]
    vd, od = np.linspace(0.05, 0.1, p + 1), np.linspace(-0.5, 0.8, p + 1)
    e0 = random.normal(size=5) * [0.02, 0.02, 0.2, 0.02, 0.2]
    roll = build(e0, u, np.column_stack([vd, np.zeros(p + 1), od]))[4]
    reference = np.array([0.3, -0.2, 0.7])
    c, s = math.cos(0.7), math.sin(0.7)
    robot = np.array([0.3 + c * e0[0] - s * e0[1], -0.2 + s * e0[0] + c * e0[1], 0.7 + e0[2]])
    state = np.array([*reference, *robot, e0[3] + vd[0], e0[4] + od[0]])

    def motion(t, x):
        k = min(int(t / h), p - 1)
        w = t / h - k
        v, o = (1 - w) * vd[k] + w * vd[k + 1], (1 - w) * od[k] + w * od[k + 1]
        return [
            v * math.cos(x[2]),
            v * math.sin(x[2]),
            o,
            x[6] * math.cos(x[5]),
            x[6] * math.sin(x[5]),
            x[7],
            u[k, 0],
            u[k, 1],
        ]

    for k in range(p):
        state = solve_ivp(motion, (k * h, (k + 1) * h - 1e-12), state, rtol=1e-9, atol=1e-11).y[
            :, -1
        ]
        d = state[3:5] - state[:2]
        c, s = math.cos(state[2]), math.sin(state[2])
        expected = [
            c * d[0] + s * d[1],
            -s * d[0] + c * d[1],
            state[5] - state[2],
            state[6] - vd[k + 1],
            state[7] - od[k + 1],
        ]
        assert roll[k + 1] == pytest.approx(expected, abs=2e-5)


@pytest.mark.parametrize("forward", [False, True])
def test_condensed_cost_is_2_52(forward):
    """As printed, or with the inputs less the accelerations of the reference."""
    random = np.random.default_rng(2)
    p, h = 6, 0.1
    nominal = random.normal(size=(p, 2)) * 0.1
    ref = np.column_stack([random.uniform(0.0, 0.1, p + 1), np.zeros(p + 1), np.ones(p + 1)])
    ref[:, 2] *= random.uniform(-0.5, 0.5, p + 1)
    wanted = np.diff(ref[:, [0, 2]], axis=0) / h if forward else np.zeros((p, 2))
    Q = np.array([4.0, 3.0, 2.0, 1.0, 0.5])
    e0 = np.array([0.01, -0.02, 0.1, 0.0, 0.1])
    H, f, S, g, _ = build(e0, nominal, ref, h, Q, forward)

    def cost(u):
        flat = u.ravel()
        total = 0.0
        before = np.array([0.1, -0.2]) - (BEFORE if forward else 0.0)
        for k in range(p):
            e, a = g[k] + S[k] @ flat, u[k] - wanted[k]
            total += (3.0 if k == p - 1 else 1.0) * e @ (Q * e)
            total += a @ ([0.3, 0.2] * a) + (a - before) @ ([0.1, 0.4] * (a - before))
            before = a
        return total

    zero = cost(np.zeros((p, 2)))
    for _ in range(5):
        u = random.normal(size=(p, 2))
        z = np.concatenate([u.ravel(), np.zeros(SLACKS)])
        assert 0.5 * z @ H @ z + f @ z == pytest.approx(cost(u) - zero, rel=1e-9)


def test_prediction_is_exact_at_the_nominal_inputs():
    p = 8
    nominal = np.full((p, 2), 0.05)
    ref = np.column_stack([np.full(p + 1, 0.08), np.full(p + 1, 0.01), np.full(p + 1, 0.3)])
    _, _, S, g, roll = build(np.array([0.02, 0.01, 0.3, 0, 0]), nominal, ref)
    for k in range(p):
        assert g[k] + S[k] @ nominal.ravel() == pytest.approx(roll[k + 1], abs=1e-12)
