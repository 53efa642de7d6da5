"""The QP backends: against each other, against the conditions of optimality, and at the edges."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.iterations import deviation
from push_model import CurvatureLimits, DifferentialDrive
from push_mpc import Contact, LtvMpc, MpcSettings, Reference
from push_qp import ActiveSetBackend, DaqpBackend, OsqpBackend, Qp, backend, factors
from push_qp import goldfarb_idnani as kernel
from push_qp.active_set import iteration_limit

BACKENDS = {"active_set": ActiveSetBackend, "daqp": DaqpBackend, "osqp": lambda: OsqpBackend(1e-9)}
SEEDS = st.integers(0, 10**6)


def random_qp(seed, n=8, m=20):
    """Feasible: z = 0 satisfies it."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(n, n))
    H, f = root @ root.T + 0.1 * np.eye(n), random.normal(size=n) * 20
    G, b = random.normal(size=(m, n)), random.uniform(0.01, 1, m)
    return Qp.dense(H, f, G, b, np.full(n, -1.0), np.full(n, 1.0))


def assert_optimal(qp, z, tolerance=1e-6):
    """Karush, Kuhn, Tucker: feasible, and -gradient in the cone of the tight normals."""
    from scipy.optimize import nnls

    numbers = qp.all_rows()
    G, b = qp.rows(numbers)
    equal = qp.equalities(numbers)
    assert qp.violation(z) < tolerance
    assert G[equal] @ z == pytest.approx(b[equal], abs=tolerance)
    eye = np.eye(len(z))
    normals = np.vstack([G, -G[equal], eye, -eye])
    room = np.concatenate([b, -b[equal], qp.high, -qp.low]) - normals @ z
    assert room.min() > -tolerance
    gradient = qp.H @ z + qp.f
    if np.abs(gradient).max() > tolerance:
        _, residual = nnls(normals[room < 1e-5].T, -gradient, maxiter=10000)
        assert residual < 1e-4 * (1 + np.abs(gradient).max())


@pytest.mark.parametrize("name", BACKENDS)
def test_solution_meets_the_conditions_of_optimality(name):
    for seed in range(25):
        qp = random_qp(seed)
        result = BACKENDS[name]().solve(qp)
        assert result.solved, result.status
        assert_optimal(qp, result.z, 1e-5 if name == "osqp" else 1e-7)


@given(SEEDS, st.integers(1, 12), st.integers(0, 60))
def test_active_set_is_optimal_whatever_the_size(seed, n, m):
    qp = random_qp(seed, n, m)
    result = ActiveSetBackend().solve(qp)
    assert result.solved, result.status
    assert_optimal(qp, result.z)


@given(SEEDS, SEEDS, st.integers(0, 40))
def test_start_from_any_working_set_gives_the_same_answer(seed, other, rows):
    """The guess may be of another programme altogether, with more rows or fewer."""
    qp, strange = random_qp(seed), random_qp(other, 8, rows)
    warm = ActiveSetBackend()
    warm.solve(strange)
    assert warm.solve(qp).z == pytest.approx(ActiveSetBackend().solve(qp).z, abs=1e-8)


def test_a_guess_that_fills_the_space_is_no_trouble():
    """As many rows are guessed as there are unknowns, and others are violated at that vertex."""
    filled = 0
    for seed in range(200):
        random = np.random.default_rng(seed)
        G, f = random.normal(size=(30, 4)), random.normal(size=4) * 100
        first = Qp.dense(np.eye(4), f, G, np.ones(30), np.full(4, -9.0), np.full(4, 9.0))
        solver = ActiveSetBackend()
        solver.solve(first)
        filled += solver._count == 4
        moved = Qp.dense(np.eye(4), f, G, random.uniform(0.1, 1, 30), first.low, first.high)
        result = solver.solve(moved)
        assert result.solved, result.status
        assert_optimal(moved, result.z)
    assert filled > 100


def test_start_from_its_own_working_set_takes_one_iteration_a_constraint():
    for seed in range(10):
        qp, solver = random_qp(seed, 12, 40), ActiveSetBackend()
        cold = int(solver.solve(qp).status.split()[-2])
        count = solver._count
        warm = int(solver.solve(qp).status.split()[-2])
        assert count <= warm <= max(cold, count)


def test_a_minimum_far_outside_is_no_trouble():
    """Without its rows the minimum would be a million away and more, so errors of the rooms, which
    are updated from there, exceed the tolerance: rows of the working set seem violated, once or
    for ever."""
    far = 0
    for seed in range(300):
        random = np.random.default_rng(seed)
        n = int(random.integers(2, 9))
        m = int(random.integers(n, 4 * n + 1))
        G = random.normal(size=(m, n)) * 10.0 ** random.uniform(-1, 1, (m, 1))
        b = 10.0 ** random.uniform(-3, 0, m)
        f = random.normal(size=n) * 10.0 ** random.uniform(0, 4, n)
        root = random.normal(size=(n, n)) * 10.0 ** random.uniform(-2, 0, n)
        H = root @ root.T + 1e-6 * np.diag(10.0 ** random.uniform(-2, 0, n))
        qp = Qp.dense(H, f, G, b, np.full(n, -1e3), np.full(n, 1e3))
        solver = ActiveSetBackend()
        result = solver.solve(qp)
        away = np.abs(np.linalg.solve(H, f)).max()
        far += away > 1e6
        assert result.solved, (seed, result.status)
        assert qp.violation(result.z) < 2e-8
        wrong = deviation(qp, result.z, solver.working_set, solver.multipliers)
        assert wrong < 1e-7 + 1e-13 * away  # the way from there is rounded
    assert far > 50


@given(SEEDS)
def test_repeated_and_dependent_rows_are_no_trouble(seed):
    qp = random_qp(seed, 5, 10)
    G, b = qp.rows(qp.all_rows())
    many = np.vstack([G, G, 2.0 * G, G + G[::-1]])
    right = np.concatenate([b, b, 2.0 * b, b + b[::-1]])
    repeated = Qp.dense(qp.H, qp.f, many, right, qp.low, qp.high)
    result = ActiveSetBackend().solve(repeated)
    assert result.solved, result.status
    assert result.z == pytest.approx(ActiveSetBackend().solve(qp).z, abs=1e-7)


@pytest.mark.parametrize("name", ["active_set", "daqp"])
def test_contradicting_rows_are_infeasible(name):
    G, b = np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([-0.5, -0.5])
    qp = Qp.dense(np.eye(2), np.ones(2), G, b, np.full(2, -1.0), np.full(2, 1.0))
    assert not BACKENDS[name]().solve(qp).solved


@pytest.mark.parametrize("name", BACKENDS)
@pytest.mark.parametrize("where", ["H", "f", "G", "b"])
def test_nan_is_not_solved_and_leaves_no_trace(where, name):
    """FAULTS 4: the next good programme is solved as if nothing had been."""
    qp, solver = random_qp(3), BACKENDS[name]()
    G, b = qp.rows(qp.all_rows())
    bad = {"H": qp.H.copy(), "f": qp.f.copy(), "G": G.copy(), "b": b.copy()}
    bad[where].flat[0] = np.nan
    result = solver.solve(Qp.dense(bad["H"], bad["f"], bad["G"], bad["b"], qp.low, qp.high))
    assert not result.solved
    assert np.array_equal(solver.solve(qp).z, BACKENDS[name]().solve(qp).z)


def test_a_hessian_that_is_not_convex_is_refused():
    qp = Qp.dense(-np.eye(2), np.ones(2), np.zeros((0, 2)), np.zeros(0), -np.ones(2), np.ones(2))
    result = ActiveSetBackend().solve(qp)
    assert not result.solved and "not convex" in result.status


def test_an_unknown_backend_is_refused():
    with pytest.raises(ValueError, match="unknown QP backend 'qpoases'"):
        backend("qpoases")


def test_rows_written_out_are_the_rows_of_the_outputs():
    """The two readings of a condensed programme, with slacks and inputs of a real tick."""
    qp = tick_programme(np.random.default_rng(5))
    numbers = qp.all_rows()
    G, b = qp.rows(numbers)
    assert len(numbers) == 20 * (3 + 4 + 2 + 20)
    for seed in range(5):
        z = np.random.default_rng(seed).normal(size=len(qp.f))
        assert b - G @ z == pytest.approx(qp.rooms(z)[numbers], abs=1e-12)


def tick_programme(random, p=20, obstacles=20, **limits):
    t = 0.1 * np.arange(p + 1)
    reference = Reference(
        np.column_stack([0.07 * t, 0 * t, 0 * t]), np.tile([0.07, 0.0, 0.0], (p + 1, 1))
    )
    centres = random.uniform(0, 0.015 * p, (obstacles, 2))
    circles = np.column_stack([centres, np.full(obstacles, 0.045)])
    error = random.normal(size=5) * [0.01, 0.02, 0.2, 0.02, 0.2]
    settings = MpcSettings(horizon=p, max_obstacles=obstacles, **limits)
    mpc = LtvMpc(settings, DifferentialDrive(0.0205, 0.0265, 6.28))
    return mpc.programme(error, reference, Contact(CurvatureLimits(-1.8, 1.8)), circles)


SLOW = {"max_acceleration": 0.3, "max_acceleration_change": 0.3} | {
    "max_turn_acceleration": 6.0, "max_turn_acceleration_change": 6.0
}  # fmt: skip
"""Limits so narrow that many of them are met."""


def test_the_cap_on_iterations_grows_with_the_programme():
    """The longest horizon, from a working set of another world: more than 500 are needed."""
    solver, most = ActiveSetBackend(), 0
    for seed in range(20):
        qp = tick_programme(np.random.default_rng(seed), 100, 100, **SLOW)
        result = solver.solve(qp)
        assert result.solved, result.status
        most = max(most, int(result.status.split()[-2]))
    assert most > 500
    assert iteration_limit(qp) > 2 * most
    assert iteration_limit(qp) > 4 * iteration_limit(tick_programme(np.random.default_rng(0)))


@pytest.mark.parametrize("seed", range(10))
def test_backends_agree_on_programmes_of_the_controller(seed):
    """Twenty obstacles strewn over the way: most of them cannot be avoided."""
    qp = tick_programme(np.random.default_rng(seed))
    ours, theirs = ActiveSetBackend().solve(qp), DaqpBackend().solve(qp)
    assert ours.solved and theirs.solved
    assert_optimal(qp, ours.z)
    cost = [0.5 * z @ qp.H @ z + qp.f @ z for z in (ours.z, theirs.z)]
    assert cost[0] == pytest.approx(cost[1], rel=1e-5)


@pytest.mark.parametrize("seed", range(10))
def test_a_cold_start_takes_little_more_than_an_iteration_an_active_row(seed):
    """What the steepest edge is for; by the greatest violation it takes several times as many."""
    qp, solver = tick_programme(np.random.default_rng(seed)), ActiveSetBackend()
    iterations = int(solver.solve(qp).status.split()[-2])
    assert solver._count > 10
    assert iterations < 2.2 * solver._count, (iterations, solver._count)


def test_first_weights_are_the_inverse_hessian_in_the_rows():
    """n' J J' n against n' H^-1 n."""
    qp = tick_programme(np.random.default_rng(1))
    n = len(qp.f)
    JT, L = np.empty((n, n)), np.empty((n, n))
    assert factors.inverse_factor(qp.H, L, JT)
    box, row = np.zeros(n), np.zeros(qp.bound.shape)
    change = np.empty(qp.bound.shape)
    zero_g, zero_bound = np.zeros(qp.g.shape), np.zeros(qp.bound.shape)
    y, slack = np.empty(qp.g.shape), np.empty(qp.bound.shape[1])
    for i in range(n):
        shape = (qp.S, zero_g, qp.width, qp.normal, zero_bound, qp.family, y, slack, change)
        kernel._rooms_of(JT[i], *shape)
        kernel._weigh(1.0, JT[i], change, box, row)
    inverse = np.linalg.inv(qp.H)
    G, _ = qp.rows(qp.all_rows())
    exact = np.einsum("ij,jk,ik->i", G, inverse, G)
    assert row.ravel()[qp.all_rows()] == pytest.approx(exact, rel=1e-9)
    assert box == pytest.approx(np.diag(inverse), rel=1e-9)
