"""The push curve against its definition and against an independent optimiser."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from push_model import se2
from push_planner import PushCurve, shortest_push_curve
from push_planner.push_curve import BASIS_COARSE, _holds, _length, _violation

angles = st.floats(-1.5, 1.5)
starts = st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-3, 3)).map(np.array)


def finish(start, distance, bearing, turn):
    heading = start[2] + bearing
    return np.array(
        [
            start[0] + distance * math.cos(heading),
            start[1] + distance * math.sin(heading),
            start[2] + turn,
        ]
    )


@given(starts, st.floats(0.2, 1.5), angles, angles, st.floats(0.05, 2), st.floats(0.05, 2))
def test_boundary_conditions_of_the_corrected_formula(start, distance, bearing, turn, ki, kf):
    """Errata (2.4): with +3 p_i the end tangents are k_i and k_f long, in the poses' directions."""
    end = finish(start, distance, bearing, turn)
    points, _, _ = PushCurve(start, end, ki, kf, 0.0).sample(20001)
    assert points[0] == pytest.approx(start[:2]) and points[-1] == pytest.approx(end[:2])
    first = (points[1] - points[0]) * 20000
    last = (points[-1] - points[-2]) * 20000
    assert first == pytest.approx(ki * np.array([math.cos(start[2]), math.sin(start[2])]), abs=1e-3)
    assert last == pytest.approx(kf * np.array([math.cos(end[2]), math.sin(end[2])]), abs=1e-3)


def test_lengths_and_curvatures_of_the_search_are_those_of_the_curve():
    """1000 cubics: compiled sums over samples, against the same samples of ``PushCurve``."""
    random = np.random.default_rng(5)
    bends = np.empty(41)
    held = 0
    for _ in range(1000):
        end = finish(np.zeros(3), random.uniform(0.2, 1.5), *random.uniform(-1.2, 1.2, 2))
        ki, kf = random.uniform(0.1, 3.0, 2)
        low, high = -random.uniform(1.0, 20.0), random.uniform(1.0, 20.0)
        known = *end[:2], math.cos(end[2]), math.sin(end[2])
        points, _, kappa = PushCurve(np.zeros(3), end, ki, kf, 0.0).sample(41)
        worst = max(kappa.max() - high, low - kappa.min())
        violation = _violation(ki, kf, *known, low, high, BASIS_COARSE, bends)
        assert violation == pytest.approx(worst, rel=1e-4, abs=1e-6)
        if abs(worst) > 1e-3:
            assert _holds(ki, kf, *known, low, high, BASIS_COARSE) == (worst < 0.0)
        held += worst < 0.0
        chords = np.hypot(*np.diff(points, axis=0).T).sum()
        length = _length(ki, kf, *known, BASIS_COARSE)
        assert chords <= length * (1.0 + 1e-3) and length == pytest.approx(chords, rel=0.02)
    assert 100 < held < 900


@settings(deadline=None)
@given(starts, st.floats(0.2, 1.5), angles, angles, st.floats(-6, -1), st.floats(1, 6))
def test_found_curves_keep_both_limits_everywhere(start, distance, bearing, turn, low, high):
    end = finish(start, distance, bearing, turn)
    curve = shortest_push_curve(start, end, low, high)
    if curve is None:
        return
    points, heading, kappa = curve.sample(2001)
    assert kappa.max() <= high * (1 + 2e-3) and kappa.min() >= low * (1 + 2e-3)
    assert curve.length == pytest.approx(np.hypot(*np.diff(points, axis=0).T).sum(), rel=1e-3)
    measured = np.gradient(heading) / np.maximum(np.hypot(*np.gradient(points, axis=0).T), 1e-12)
    assert measured[1:-1] == pytest.approx(kappa[1:-1], rel=0.05, abs=0.1)


def test_as_short_as_slsqp_finds_and_never_misses_what_it_finds():
    random = np.random.default_rng(4)
    low, high = -4.0, 5.0
    missed = gaps = 0
    for _ in range(40):
        start = np.zeros(3)
        end = finish(
            start, random.uniform(0.3, 1.5), random.uniform(-1, 1), random.uniform(-1.5, 1.5)
        )

        def bend(k, end=end):
            return PushCurve(np.zeros(3), end, *np.maximum(k, 1e-3), 0.0).sample(101)

        def length(k, bend=bend):
            return np.hypot(*np.diff(bend(k)[0], axis=0).T).sum()

        distance = np.hypot(*end[:2])
        other = minimize(
            length,
            [distance, distance],
            method="SLSQP",
            bounds=[(0.02, 20)] * 2,
            constraints=[
                {"type": "ineq", "fun": lambda k, bend=bend: high - bend(k)[2]},
                {"type": "ineq", "fun": lambda k, bend=bend: bend(k)[2] - low},
            ],
        )
        ours = shortest_push_curve(start, end, low, high)
        if (
            other.success
            and np.all(bend(other.x)[2] <= high - 0.02)
            and np.all(bend(other.x)[2] >= low + 0.02)
        ):
            missed += ours is None
            gaps += ours is not None and ours.length > 1.01 * other.fun
    assert missed == 0 and gaps == 0


def test_no_curve_is_missed_that_a_fine_grid_finds_with_room_to_spare():
    """The feasible k_i, k_f can be a valley narrower than the solver's own grid."""
    random = np.random.default_rng(9)
    k = np.geomspace(0.05, 8.0, 60)
    ki, kf = (m.ravel()[:, None] for m in np.meshgrid(k, k))
    s = np.linspace(0.0, 1.0, 81)
    found = 0
    for _ in range(60):
        end = finish(
            np.zeros(3), random.uniform(0.6, 2.0), random.uniform(-1, 1), random.uniform(-1.8, 1.8)
        )
        c, d = math.cos(end[2]), math.sin(end[2])
        a, b = 3 * s**2 - 2 * s, 3 * s**2 - 4 * s + 1
        x1 = 6 * s * (1 - s) * end[0] + a * kf * c + b * ki
        y1 = 6 * s * (1 - s) * end[1] + a * kf * d
        x2 = (6 - 12 * s) * end[0] + (6 * s - 2) * kf * c + (6 * s - 4) * ki
        y2 = (6 - 12 * s) * end[1] + (6 * s - 2) * kf * d
        bend = np.abs(x1 * y2 - y1 * x2) / np.hypot(x1, y1) ** 3
        if bend.max(axis=1).min() <= 1.45:
            found += 1
            assert shortest_push_curve(np.zeros(3), end, -1.6, 1.6) is not None, end
    assert found > 15


def test_a_creeping_search_for_a_feasible_curve_ends():
    """Here the violation falls without end as k grows: a search without a cap never returned."""
    start = np.array([-1.1734795229843267, -0.6099747722603714, 0.47404750469418655])
    end = np.array([-0.6725623383453272, 0.5540100016967023, -0.5561434961352023])
    limit = 1.578947365340034
    curve = shortest_push_curve(start, end, -limit, limit)
    assert curve is None or np.abs(curve.sample(2001)[2]).max() <= limit * (1 + 2e-3)


def test_straight_push_is_straight():
    curve = shortest_push_curve(np.zeros(3), np.array([1.0, 0.0, 0.0]), -0.1, 0.1)
    assert curve.length == pytest.approx(1.0, abs=1e-4)


def test_limits_must_enclose_zero():
    with pytest.raises(ValueError, match="enclose 0"):
        shortest_push_curve(np.zeros(3), np.ones(3), 0.1, 0.2)


@given(starts, st.floats(0.2, 1.5), angles, angles, st.floats(0.05, 1.0))
@settings(deadline=None)
def test_the_parts_of_a_curve_are_the_curve(start, distance, bearing, turn, part):
    curve = shortest_push_curve(start, finish(start, distance, bearing, turn), -5.0, 5.0)
    if curve is None:
        return
    first, rest = curve.split(part * curve.length)
    assert first.length + rest.length == pytest.approx(curve.length, rel=1e-3)
    assert first.length == pytest.approx(part * curve.length, abs=0.01 * curve.length)
    whole, _, kappa = curve.sample(4001)
    points, heading, _ = (
        np.concatenate(pair) for pair in zip(first.sample(50), rest.sample(50), strict=True)
    )
    gaps = np.hypot(*(points[:, None] - whole[None]).transpose(2, 0, 1)).min(axis=1)
    assert gaps.max() < 1e-3 * curve.length
    assert points[49] == pytest.approx(points[50])
    assert se2.wrap(heading[49] - heading[50]) == pytest.approx(0.0, abs=1e-5)
    assert points[-1] == pytest.approx(curve.end[:2])
    for piece in (first, rest):
        _, _, k = piece.sample(200)
        assert k.max() < kappa.max() + 1e-2 and k.min() > kappa.min() - 1e-2
