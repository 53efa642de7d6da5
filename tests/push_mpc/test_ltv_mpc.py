from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from push_model import CurvatureLimits, DifferentialDrive
from push_mpc import Contact, LtvMpc, MpcSettings, Reference
from push_qp import DaqpBackend, QpSolution

DRIVE = DifferentialDrive(0.0205, 0.0265, 6.28)
LIMITS = Contact(CurvatureLimits(-2.0, 2.0))
NONE = np.zeros((0, 3))


def straight(p=20, v=0.07, h=0.1):
    t = np.arange(p + 1) * h
    return Reference(
        np.column_stack([v * t, 0 * t, 0 * t]), np.column_stack([0 * t + v, 0 * t, 0 * t])
    )


def run(mpc, error, limits, steps=80, circles=NONE, v=0.07):
    """The closed loop with the exact model, on a straight line."""
    state = np.array([error[0], error[1], error[2], v, 0.0])
    rows = []
    for k in range(steps):
        x0 = v * 0.1 * k
        reference = straight(v=v)
        reference = Reference(reference.pose + [x0, 0, 0], reference.twist)
        e = state - [x0, 0, 0, v, 0]
        result = mpc.solve(e, reference, limits, circles)
        assert result.solved, result.reason
        state[3] += 0.1 * result.acceleration[0]
        state[4] += 0.1 * result.acceleration[1]
        for _ in range(10):
            state[0] += 0.01 * state[3] * np.cos(state[2])
            state[1] += 0.01 * state[3] * np.sin(state[2])
            state[2] += 0.01 * state[4]
        rows.append([*state, result.slack])
    return np.array(rows)


@pytest.mark.parametrize("offset", [0.05, -0.05])
def test_pushing_converges_within_the_stick_limits(offset):
    """Fig. 2.23: from an offset on either side back to the line, never beyond the curvature."""
    mpc = LtvMpc(MpcSettings(), DRIVE)
    rows = run(mpc, np.array([0.0, offset, 0.0]), LIMITS, steps=120)
    assert abs(rows[-1, 1]) < 2e-3
    assert (np.abs(rows[:, 4]) <= 2.0 * rows[:, 3] + 1e-4).all()
    assert (rows[:, 3] >= -1e-6).all()


def test_without_the_constraint_it_would_slip():
    rows = run(LtvMpc(MpcSettings(), DRIVE), np.array([0.0, 0.05, 0.0]), None, steps=60)
    assert (np.abs(rows[:, 4]) > 2.0 * rows[:, 3]).any()


def test_wheel_speeds_are_respected():
    rows = run(LtvMpc(MpcSettings(), DRIVE), np.array([-0.05, 0.05, 0.5]), None, v=0.1)
    wheel = np.abs(rows[:, 3]) + 0.0265 * np.abs(rows[:, 4])
    assert wheel.max() <= DRIVE.max_speed * 1.01


def test_obstacle_beside_the_line_is_avoided():
    circle = np.array([[0.3, 0.02, 0.08]])
    rows = run(LtvMpc(MpcSettings(), DRIVE), np.zeros(3), None, 90, circle)
    gap = np.hypot(rows[:, 0] - 0.3, rows[:, 1] - 0.02)
    assert gap.min() > 0.08 - 5e-3
    straight_gap = abs(0.02)
    assert straight_gap < 0.08  # without avoidance it would have gone through


def test_softened_rows_give_the_least_violation():
    """FAULTS 5: already inside an obstacle there is a solution, and it leads out."""
    circle = np.array([[0.05, 0.0, 0.08]])
    mpc = LtvMpc(replace(MpcSettings(), max_obstacle_slack=1.0), DRIVE)
    result = mpc.solve(np.zeros(5), straight(v=0.0), None, circle)
    assert result.solved and result.slack > 0.01
    assert result.acceleration[0] < 0.0


@pytest.mark.parametrize("seed", range(10))
def test_a_robot_deep_inside_a_circle_is_not_solved_at_the_default_settings(seed):
    """A 45 mm circle, up to 45 mm inside of it: solved where 5 mm can be held, nowhere else."""
    random = np.random.default_rng(seed)
    mpc, verdicts = LtvMpc(MpcSettings(), DRIVE), {True: 0, False: 0}
    bound = MpcSettings().max_obstacle_slack
    for _ in range(40):
        depth = random.uniform(-0.025, 0.045)
        angle = random.uniform(-np.pi, np.pi)
        v = random.uniform(0.0, 0.07)
        circle = np.array([[*(0.045 - depth) * np.array([np.cos(angle), np.sin(angle)]), 0.045]])
        mpc.reset()
        result = mpc.solve(np.array([0.0, 0.0, 0.0, v, 0.0]), straight(v=0.0), None, circle)
        # as far as it may come out of it in the first step
        if depth - 0.1 * v - 0.5 * MpcSettings().max_acceleration * 0.1**2 > bound:
            assert not result.solved and "obstacle violated by" in result.reason
        assert not result.solved or result.slack <= 1.0
        verdicts[result.solved] += 1
        if depth < bound:  # when it stands, it is solved
            mpc.reset()
            result = mpc.solve(np.zeros(5), straight(v=0.0), None, circle)
            assert result.solved, result.reason
    assert min(verdicts.values()) > 5
    fault = mpc.solve(np.zeros(5), straight(v=0.0), None, np.array([[0.001, 0.0, 0.045]]))
    assert not fault.solved and fault.acceleration == (0.0, 0.0)


@pytest.mark.parametrize(
    ("kind", "limits", "circles", "error"),
    [
        ("wheel speed", None, NONE, [0.0, 0.0, 0.0, 0.2, 0.0]),
        ("stable curvature", Contact(CurvatureLimits(-1.0, 1.0)), NONE, [0.0, 0.0, 0.0, 0.0, 2.5]),
        ("obstacle", None, np.array([[0.05, 0.0, 0.08]]), [0.0] * 5),
    ],
)
def test_each_kind_has_a_bound_of_its_own(kind, limits, circles, error):
    """Loosening the other two changes nothing, loosening its own does."""
    names = {
        "wheel speed": "max_wheel_slack",
        "stable curvature": "max_curvature_slack",
        "obstacle": "max_obstacle_slack",
    }
    others = {name: 100.0 for k, name in names.items() if k != kind}
    for settings, solved in (
        (MpcSettings(), False),
        (replace(MpcSettings(), **others), False),
        (replace(MpcSettings(), **{names[kind]: 100.0}), True),
    ):
        mpc = LtvMpc(settings, DRIVE)
        result = mpc.solve(np.array(error), straight(v=0.0), limits, circles)
        assert result.solved == solved, result.reason
        assert solved or result.reason.startswith(f"{kind} violated by")


def test_noise_in_normal_operation_does_not_trip_the_bounds():
    """A push beside a wall at the least distance, with 0.2 mm and 0.1 degrees of noise."""
    for seed in range(10):
        random = np.random.default_rng(seed)
        mpc = LtvMpc(MpcSettings(), DRIVE)
        x = np.linspace(-0.2, 1.0, 31)
        side = random.choice([-1.0, 1.0])
        wall = np.column_stack([x, np.full(31, side * 0.046), np.full(31, 0.045)])
        state = np.array([0.0, 0.0, 0.0, 0.07, 0.0])
        for k in range(300):
            reference = straight()
            reference = Reference(reference.pose + [0.0007 * k, 0, 0], reference.twist)
            noise = random.normal(size=5) * [2e-4, 2e-4, 1.7e-3, 0.0, 0.0]
            near = wall[np.argsort(np.abs(x - state[0]))[:20]]
            e = state + noise - [0.0007 * k, 0, 0, 0.07, 0]
            result = mpc.solve(e, reference, LIMITS, near)
            assert result.solved, result.reason
            state[3] = max(state[3] + 0.01 * result.acceleration[0], 0.0)
            state[4] += 0.01 * result.acceleration[1]
            state[0] += 0.01 * state[3] * np.cos(state[2])
            state[1] += 0.01 * state[3] * np.sin(state[2])
            state[2] += 0.01 * state[4]
        assert state[0] > 0.19


class Liar:
    """FAULTS 4: answers 'optimal' with NaN."""

    def __init__(self):
        self.honest, self.lying = DaqpBackend(), True

    def solve(self, qp):
        if self.lying:
            z = np.full(len(qp.f), np.nan)
            return QpSolution(z, bool(np.isfinite(z).all()), "optimal")
        return self.honest.solve(qp)

    def reset(self):
        self.honest.reset()


def test_nan_from_the_solver_is_a_failure_and_the_next_good_tick_recovers():
    solver = Liar()
    mpc = LtvMpc(MpcSettings(), DRIVE, solver)
    bad = mpc.solve(np.full(5, 0.01), straight(), LIMITS, NONE)
    assert not bad.solved and bad.acceleration == (0.0, 0.0)
    solver.lying = False
    good = mpc.solve(np.full(5, 0.01), straight(), LIMITS, NONE)
    assert good.solved and np.isfinite(good.acceleration).all()


@pytest.mark.parametrize("where", ["error", "pose", "twist", "circles"])
def test_nan_input_is_a_failure_that_leaves_no_trace(where):
    mpc, clean = LtvMpc(MpcSettings(), DRIVE), LtvMpc(MpcSettings(), DRIVE)
    error, reference, circles = np.full(5, 0.01), straight(), NONE
    if where == "error":
        error = np.full(5, np.nan)
    elif where == "pose":
        reference = Reference(reference.pose * np.nan, reference.twist)
    elif where == "twist":
        reference = Reference(reference.pose, reference.twist + np.inf)
    else:
        circles = np.array([[0.1, np.nan, 0.05]])
    assert not mpc.solve(error, reference, LIMITS, circles).solved
    after = mpc.solve(np.full(5, 0.01), straight(), LIMITS, NONE)
    assert (
        after.acceleration == clean.solve(np.full(5, 0.01), straight(), LIMITS, NONE).acceleration
    )


@given(st.integers(0, 10**6))
def test_obstacle_rows_are_half_planes_with_the_unit_normal(seed):
    """Errata (2.59)-(2.60): n'p <= n'o - delta, n the unit vector from robot to obstacle."""
    random = np.random.default_rng(seed)
    x, y, theta = random.uniform(-1, 1, 3)
    o = np.array([x, y]) + random.uniform(0.1, 0.5) * np.array([np.cos(seed), np.sin(seed)])
    delta = 0.05
    mpc = LtvMpc(MpcSettings(), DRIVE)
    still = Reference(np.tile([x, y, theta], (21, 1)), np.zeros((21, 3)))
    qp = mpc.programme(np.zeros(5), still, None, np.array([[*o, delta]]))
    row = int(np.flatnonzero(np.isfinite(qp.bound[0]))[-1])
    c, s = np.cos(theta), np.sin(theta)
    turn = np.array([[c, -s], [s, c]])
    n = turn @ qp.normal[0, :2, row]  # back into the world
    p = np.array([x, y])
    assert n == pytest.approx((o - p) / np.linalg.norm(o - p))
    # the row holds for errors e in the reference frame: p = reference + R e
    assert qp.bound[0, row] == pytest.approx(n @ o - delta - n @ p)


def test_more_obstacles_than_there_are_rows_for_are_refused():
    mpc = LtvMpc(replace(MpcSettings(), max_obstacles=0), DRIVE)
    assert mpc.solve(np.zeros(5), straight(), None, NONE).solved
    with pytest.raises(ValueError, match="at most 0"):
        mpc.solve(np.zeros(5), straight(), None, np.array([[1.0, 0.0, 0.5]]))
