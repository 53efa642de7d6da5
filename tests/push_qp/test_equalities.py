"""Equality rows, E z = d, in every backend: against conditions that no backend takes part in."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog

from push_qp import ActiveSetBackend, DaqpBackend, OsqpBackend, Qp
from tests.push_qp.test_backends import assert_optimal

BACKENDS = {
    "active_set": ActiveSetBackend,
    "daqp": DaqpBackend,
    "daqp, every row": lambda: DaqpBackend(every_row=True),
    "osqp": lambda: OsqpBackend(1e-7),
}
SEEDS = st.integers(0, 10**6)


def parts(seed, n=8, e=3, m=20):
    """H, f, G, b, low, high, E, d of a programme with a feasible point well inside the box."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(n, n))
    H, f = root @ root.T + 0.1 * np.eye(n), random.normal(size=n) * 20
    point = random.uniform(-0.7, 0.7, n)
    G, E = random.normal(size=(m, n)), random.normal(size=(e, n))
    b = G @ point + random.uniform(0.01, 1.0, m)
    return [H, f, G, b, np.full(n, -1.0), np.full(n, 1.0), E, E @ point]


def shaped(random, steps=6, r=5, equal=2, inputs=2):
    """A programme whose rows are combinations of the outputs of steps, slacks included."""
    nu = inputs * steps
    n, o = nu + 2, 4
    root = random.normal(size=(n, n))
    S = np.zeros((steps, o, nu))
    width = inputs * np.arange(1, steps + 1, dtype=np.int64)
    for k in range(steps):
        S[k, :, : width[k]] = random.normal(size=(o, width[k]))
    g, normal = random.normal(size=(steps, o)), random.normal(size=(steps, o, r))
    family = np.array([-1] * equal + [0, 1, -1, 0][: r - equal], dtype=np.int64)
    u = random.uniform(-0.5, 0.5, nu)
    value = np.einsum("koj,ko->kj", normal, g + S @ u)
    bound = value + random.uniform(0.0, 1.0, (steps, r))
    bound[:, :equal] = value[:, :equal]
    bound[random.random(steps) < 0.3, 0] = np.inf  # this equality is not there at that step
    return Qp(
        root @ root.T + 0.1 * np.eye(n),
        random.normal(size=n) * 20,
        np.concatenate([np.full(nu, -1.0), np.zeros(2)]),
        np.concatenate([np.full(nu, 1.0), np.full(2, 9.0)]),
        S,
        g,
        width,
        normal,
        bound,
        family,
        np.arange(r) < equal,
    )


@pytest.mark.parametrize("name", BACKENDS)
def test_hundreds_of_programmes_meet_the_conditions_of_optimality(name):
    pressed = 0
    for seed in range(50 if name == "osqp" else 400):
        random = np.random.default_rng(seed)
        n = int(random.integers(2, 13))
        qp = Qp.dense(*parts(seed, n, int(random.integers(1, n)), int(random.integers(0, 40))))
        result = BACKENDS[name]().solve(qp)
        assert result.solved, (seed, result.status)
        assert_optimal(qp, result.z, 1e-5)
        numbers = qp.all_rows()
        pressed += int((qp.rooms(result.z)[numbers][~qp.equalities(numbers)] < 1e-5).sum())
    assert pressed > 30  # inequalities are active beside the equalities


@given(SEEDS, st.integers(1, 15))
def test_equalities_alone_have_a_closed_form(seed, n):
    """[H E'; E 0] (z, y) = (-f, d)."""
    e = seed % (n + 1)
    H, f, _, _, low, high, E, d = parts(seed, n, e, 0)
    qp = Qp.dense(H, f, np.zeros((0, n)), np.zeros(0), 1e6 * low, 1e6 * high, E, d)
    K = np.block([[H, E.T], [E, np.zeros((e, e))]])
    exact = np.linalg.solve(K, np.concatenate([-f, d]))[:n]
    for solver in (ActiveSetBackend(), DaqpBackend()):
        result = solver.solve(qp)
        assert result.solved, result.status
        assert result.z == pytest.approx(exact, abs=1e-6 * (1 + np.abs(exact).max()))


@pytest.mark.parametrize("name", BACKENDS)
def test_equalities_on_the_outputs_of_steps(name):
    """The form of a controller: (2.53) holds at every step, other rows may be softened."""
    pressed = 0
    for seed in range(20 if name == "osqp" else 150):
        qp = shaped(np.random.default_rng(seed))
        result = BACKENDS[name]().solve(qp)
        assert result.solved, (seed, result.status)
        assert_optimal(qp, result.z, 1e-5)
        pressed += int((qp.rooms(result.z).reshape(6, 5)[:, 2:] < 1e-5).sum())
    assert pressed > (15 if name == "osqp" else 150)


@pytest.mark.parametrize("name", BACKENDS)
def test_redundant_equalities_change_nothing(name):
    for seed in range(10 if name == "osqp" else 60):
        H, f, G, b, low, high, E, d = parts(seed)
        mix = np.random.default_rng(seed).normal(size=(6, 3))
        many, right = np.vstack([E, E, mix @ E]), np.concatenate([d, d, mix @ d])
        qp = Qp.dense(H, f, G, b, low, high, many, right)
        result = BACKENDS[name]().solve(qp)
        assert result.solved, (seed, result.status)
        plain = ActiveSetBackend().solve(Qp.dense(H, f, G, b, low, high, E, d))
        assert result.z == pytest.approx(plain.z, abs=1e-5)


@pytest.mark.parametrize("name", BACKENDS)
def test_equalities_that_contradict_each_other_are_infeasible(name):
    for seed in range(5 if name == "osqp" else 60):
        H, f, G, b, low, high, E, d = parts(seed)
        off = np.random.default_rng(seed).choice([-1.0, 1.0]) * 0.1
        mix = np.random.default_rng(seed).normal(size=3)
        many, right = np.vstack([E, mix @ E]), np.append(d, mix @ d + off)
        result = BACKENDS[name]().solve(Qp.dense(H, f, G, b, low, high, many, right))
        assert not result.solved


@pytest.mark.parametrize("name", ["active_set", "daqp", "daqp, every row"])
def test_solved_exactly_where_a_linear_programme_finds_a_point(name):
    """Equalities against rows and box: the answer of HiGHS decides."""
    feasible = 0
    for seed in range(200):
        H, f, G, b, low, high, E, d = parts(seed, 6, 3, 12)
        d = d + np.random.default_rng(seed).normal(size=3) * 0.7
        bounds = list(zip(low, high, strict=True))
        exists = linprog(np.zeros(6), G, b, E, d, bounds, method="highs").status == 0
        qp = Qp.dense(H, f, G, b, low, high, E, d)
        result = BACKENDS[name]().solve(qp)
        assert result.solved == exists, (seed, result.status)
        if exists:
            assert_optimal(qp, result.z, 1e-5)
        feasible += exists
    assert 40 < feasible < 160


@given(SEEDS, SEEDS, st.sampled_from(sorted(BACKENDS)))
def test_start_from_another_programme_gives_the_same_answer(seed, other, name):
    """The same shape, so that what is remembered is used; other rows may be equalities there."""
    if name == "osqp":
        seed, other = seed % 3, other % 3
    warm = BACKENDS[name]()
    warm.solve(shaped(np.random.default_rng(other), equal=1 + other % 2))
    qp = shaped(np.random.default_rng(seed))
    result = warm.solve(qp)
    assert result.solved, result.status
    assert result.z == pytest.approx(BACKENDS[name]().solve(qp).z, abs=1e-5)


@pytest.mark.parametrize("name", BACKENDS)
def test_a_programme_that_drifts_is_solved_from_the_last_answer_as_well_as_anew(name):
    solver = BACKENDS[name]()
    random = np.random.default_rng(3)
    first = parts(3)
    for _ in range(30 if name == "osqp" else 200):
        H, f, G, b, low, high, E, d = first
        f += random.normal(size=len(f)) * 2.0
        qp = Qp.dense(H, f, G, b, low, high, E, d)
        result = solver.solve(qp)
        assert result.solved, result.status
        assert_optimal(qp, result.z, 1e-5)


@pytest.mark.parametrize("name", BACKENDS)
@pytest.mark.parametrize("where", ["E", "d"])
def test_nan_in_an_equality_is_not_solved_and_leaves_no_trace(where, name):
    H, f, G, b, low, high, E, d = parts(3)
    solver, good = BACKENDS[name](), Qp.dense(H, f, G, b, low, high, E, d)
    bad = {"E": E.copy(), "d": d.copy()}
    bad[where].flat[-1] = np.nan
    assert not solver.solve(Qp.dense(H, f, G, b, low, high, bad["E"], bad["d"])).solved
    assert np.array_equal(solver.solve(good).z, BACKENDS[name]().solve(good).z)


def test_an_equality_with_a_slack_is_refused():
    qp = shaped(np.random.default_rng(0))
    with pytest.raises(ValueError, match="cannot be softened"):
        Qp(
            qp.H,
            qp.f,
            qp.low,
            qp.high,
            qp.S,
            qp.g,
            qp.width,
            qp.normal,
            qp.bound,
            np.zeros(5, dtype=np.int64),
            qp.equal,
        )
