"""How many iterations the active set takes: what is proven of it (docs/single-robot.md), replayed.

The solver is cut off after 0, 1, 2 .. iterations, so its state after each of them is seen. Each
iteration adds a row to the working set, or drops one. The states after an added row, and the first
one, are the solutions of subproblems; the proof is about their costs.
"""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.iterations import Traced, deviation, summary
from benchmarks.measure import supported
from benchmarks.mpc import TICKS, kinds
from benchmarks.mpc import cases as ticks
from benchmarks.solvers import Clocked, _measured, _row
from push_mpc import LtvMpc
from push_qp import ActiveSetBackend, Qp, active_set
from push_qp import goldfarb_idnani as kernel
from tests.push_qp.test_backends import SLOW, assert_optimal, random_qp, tick_programme
from tests.push_qp.test_equalities import parts

SEEDS = st.integers(0, 10**6)


@dataclass
class State:
    """After some iterations."""

    status: int
    z: np.ndarray
    working: np.ndarray
    multiplier: np.ndarray


def cut_off(qp, limit, guess):
    """The state after ``limit`` iterations, or the last one."""
    n = len(qp.f)
    z, multiplier, active = np.empty(n), np.zeros(n), np.zeros(n, np.int64)
    active[: len(guess)] = guess
    status, _, count = kernel.solve(
        qp.H, qp.f, qp.low, qp.high, qp.S, qp.g, qp.width, qp.normal, qp.bound, qp.family, qp.equal,
        1e-8, limit, z, active, multiplier, len(guess),
    )  # fmt: skip
    return State(status, z, active[:count], multiplier[:count])


def states(qp, guess=()):
    """Of a whole solve."""
    found = [cut_off(qp, 0, guess)]
    while found[-1].status == kernel.TOO_MANY_ITERATIONS:
        found.append(cut_off(qp, len(found), guess))
        assert len(found) < 3000
    return found


def normals(qp, numbers):
    """The constraints of these numbers as N z <= right."""
    n = len(qp.f)
    N, right = np.zeros((len(numbers), n)), np.zeros(len(numbers))
    for i, number in enumerate(numbers):
        if number < 2 * n:
            sign, bound = (-1.0, -qp.low) if number < n else (1.0, qp.high)
            N[i, number % n], right[i] = sign, bound[number % n]
        else:
            G, b = qp.rows(np.array([number - 2 * n]))
            N[i], right[i] = G[0], b[0]
    return N, right


def assert_proven(qp, guess=()):
    """Every claim, of one programme; returns how many rows were added and dropped."""
    found = states(qp, guess)
    inverse = np.linalg.inv(qp.H)
    cost = lambda s: 0.5 * s.z @ qp.H @ s.z + qp.f @ s.z  # noqa: E731
    scale = 1.0 + max(abs(cost(s)) for s in found)
    corner, seen, added, dropped = found[0], {frozenset(found[0].working.tolist())}, 0, 0
    for before, after in zip(found, found[1:], strict=False):
        change = len(after.working) - len(before.working)
        assert abs(change) == 1, "an iteration adds a row, or drops one"
        if change < 0:
            dropped += 1
            continue
        added += 1
        N, right = normals(qp, after.working)
        rows = after.working >= 2 * len(qp.f)
        free = ~rows
        free[rows] = ~qp.equalities(after.working[rows] - 2 * len(qp.f))
        # the solution of a subproblem: stationary, its rows tight, multipliers not negative
        size = np.abs(N).max() * np.abs(after.multiplier).max() + np.abs(qp.f).max() + 1.0
        assert np.abs(qp.H @ after.z + qp.f + N.T @ after.multiplier).max() < 1e-7 * size
        assert np.abs(N @ after.z - right).max() < 1e-6
        assert after.multiplier[free].min() > -1e-9 * size
        # it costs more, by what the added row was violated
        violation = N[-1] @ corner.z - right[-1]
        assert violation > 1e-8
        least = violation**2 / (2.0 * N[-1] @ inverse @ N[-1])
        assert cost(after) - cost(corner) > least * (1.0 - 1e-6) - 1e-9 * scale
        # so no working set comes back
        key = frozenset(after.working.tolist())
        assert key not in seen
        seen.add(key)
        corner = after
    assert dropped <= added
    return added, dropped


@given(SEEDS, st.integers(1, 10), st.integers(0, 50))
def test_each_added_row_raises_the_cost_and_no_working_set_returns(seed, n, m):
    assert_proven(random_qp(seed, n, m))


@given(SEEDS, SEEDS)
def test_from_a_strange_working_set_too(seed, other):
    """Which rows are tried first is of no account to the proof."""
    solver = ActiveSetBackend()
    solver.solve(random_qp(other))
    assert_proven(random_qp(seed), solver.working_set.copy())


@given(SEEDS)
def test_with_equalities_too(seed):
    assert_proven(Qp.dense(*parts(seed)))


def test_with_dependent_rows_too():
    """Where a step of length zero cannot be excluded: every row thrice, and sums of rows."""
    for seed in range(100):
        qp = random_qp(seed, 5, 10)
        G, b = qp.rows(qp.all_rows())
        many = np.vstack([G, G, 2.0 * G, G + G[::-1]])
        right = np.concatenate([b, b, 2.0 * b, b + b[::-1]])
        assert_proven(Qp.dense(qp.H, qp.f, many, right, qp.low, qp.high))


def test_of_programmes_of_the_controller_too():
    """With so narrow limits that rows are dropped as well as added."""
    dropped = 0
    for seed in range(6):
        qp = tick_programme(np.random.default_rng(seed), **SLOW)
        dropped += assert_proven(qp)[1]
    assert dropped > 10


@given(SEEDS, st.integers(2, 8), st.integers(3, 30))
def test_it_ends_with_infeasible_where_nothing_is_feasible(seed, n, m):
    """Finite by the same argument: every row, and one that contradicts them."""
    qp = random_qp(seed, n, m)
    G, b = qp.rows(qp.all_rows())
    never = np.vstack([G, -G[:1]]), np.append(b, -b[0] - 0.1)
    result = ActiveSetBackend().solve(Qp.dense(qp.H, qp.f, *never, qp.low, qp.high))
    assert not result.solved and "infeasible" in result.status


@pytest.mark.parametrize(("label", "working_sets"), [("hard", 68), ("forces", 155)])
def test_the_proven_bounds_are_of_no_use(label, working_sets):
    """The powers of ten that docs/single-robot.md tells, and what is needed in fact."""
    kind, powers = kinds()[label], []
    for case in ticks(kind, 3, None, 4)[::25]:
        qp, solver = kind.make().programme(case[0], case[1], kind.contact, case[2]), Traced()
        result = solver.solve(qp)
        n, (G, _) = len(qp.f), qp.rows(qp.all_rows())
        sets = sum(math.comb(2 * n + len(G), k) for k in range(n + 1))
        assert round(math.log10(2 * sets)) == working_sets
        inverse = np.linalg.inv(qp.H)
        w = max(np.einsum("ij,jk,ik->i", G, inverse, G).max(), np.diag(inverse).max())
        first, best = -inverse @ qp.f, result.z
        rise = 0.5 * best @ qp.H @ best + qp.f @ best - 0.5 * qp.f @ first
        powers.append(math.log10(4.0 * w * rise / 1e-16))
        assert solver.iterations[0] < 0.3 * solver.cap
    assert min(powers) > 20 and max(powers) < 25


@pytest.mark.parametrize("cap", [0, 1, 3, 10, 20])
def test_at_the_cap_it_says_so_and_begins_anew(monkeypatch, cap):
    """No half-way point is taken for a solution, and no trace is left."""
    reached = 0
    for seed in range(100):
        qp = random_qp(seed, 12, 60)
        fresh = ActiveSetBackend().solve(qp)
        solver = ActiveSetBackend()
        with monkeypatch.context() as patch:
            patch.setattr(active_set, "iteration_limit", lambda _: cap)
            result = solver.solve(qp)
        if result.solved:
            assert solver.iterations <= cap
            assert_optimal(qp, result.z)
            continue
        reached += 1
        assert result.status.startswith("too many iterations")
        assert len(solver.working_set) == 0
        assert np.array_equal(solver.solve(qp).z, fresh.z)
    assert reached > 20


def test_at_the_cap_the_controller_does_not_accelerate(monkeypatch):
    kind = kinds()["hard"]
    error, reference, circles, _ = ticks(kind, 0, None, 1)[0]
    mpc = kind.make()
    assert isinstance(mpc, LtvMpc)
    with monkeypatch.context() as patch:
        patch.setattr(active_set, "iteration_limit", lambda _: 5)
        answer = mpc.solve(error, reference, kind.contact, circles)
    assert not answer.solved and answer.acceleration == (0.0, 0.0)
    assert "too many iterations" in answer.reason
    assert mpc.solve(error, reference, kind.contact, circles).solved


def test_closed_loops_stay_far_from_the_cap():
    """Some hundred steps of what bench solvers does with a million."""
    for label, kind in kinds().items():
        trace = Traced()
        inputs = ticks(kind, 9, trace, 2)
        assert len(trace.iterations) == len(inputs) == 2 * TICKS
        figures, text = summary(trace, np.ones(len(inputs)))
        assert sum(figures["histogram"]) == len(inputs)
        assert figures["cap"] == (1950 if label == "forces" else 1030)
        assert figures["iterations"]["max"] < 0.3 * figures["cap"]
        assert sum(trace.cold) == 2, "a loop starts cold"
        assert "working sets" in text
        # the steps that are timed are those that were traced
        solver = ActiveSetBackend()
        mpc, again = kind.make(solver), []
        for error, reference, circles, first in inputs:
            if first:
                mpc.reset()
            assert mpc.solve(error, reference, kind.contact, circles).solved
            again.append(solver.iterations)
        assert again == trace.iterations


def test_added_and_dropped_rows_are_told_apart():
    trace = Traced()
    expected = []
    for seed in range(30):
        qp = random_qp(seed, 12, 60)
        expected.append(assert_proven(qp))
        trace.reset()
        trace.solve(qp)
    iterations, dropped = np.array(trace.iterations), np.array(trace.dropped)
    assert list(zip(iterations - dropped, dropped, strict=True)) == expected
    assert dropped.max() > 0


def test_what_is_not_optimal_deviates():
    for seed in range(20):
        qp, solver = random_qp(seed), ActiveSetBackend()
        z = solver.solve(qp).z
        working, multipliers = solver.working_set, solver.multipliers
        assert deviation(qp, z, working, multipliers) < 1e-9
        assert deviation(qp, z + 1e-3, working, multipliers) > 1e-5
        assert deviation(qp, z, working, multipliers * 1.01) > 1e-5
        assert deviation(qp, z, working[1:], multipliers[1:]) > 1e-5
        if len(working) > 1:
            assert deviation(qp, z, working, -multipliers) > 1e-5
    qp, solver = Qp.dense(*parts(3)), ActiveSetBackend()
    z = solver.solve(qp).z
    assert deviation(qp, z, solver.working_set, solver.multipliers) < 1e-9


def test_a_solver_is_compared_on_the_steps_that_it_took():
    taken, trace = _measured(kinds()["hard"], "hard", 6)
    ours = taken["active set"]
    assert len(trace.iterations) == len(ours.whole) == 6 * TICKS
    slow = _row(taken["osqp"], ours)
    assert slow["steps"] < 6 * TICKS, "as much CPU time as ours, so fewer steps"
    assert slow["ours_p50"] > 1.0 and "step_p99_s" not in slow, "100 steps have no p99"
    assert supported(999) == [50.0] and supported(1000) == [50.0, 99.0]
    assert supported(10_000)[-1] == 99.9 and supported(100_000)[-1] == 99.99
    assert slow["rounds"]["max"] >= 1
    assert isinstance(ours.solver, Clocked) and len(ours.solver.spent) == 6 * TICKS
