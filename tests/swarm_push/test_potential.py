"""The middle layer: zones, the printed formulas against direct evaluation, and where it leads."""

import math

import numpy as np
import pytest

from swarm_push.potential import PotentialSettings, direction_to, swarm_input

S = PotentialSettings()
R = 0.25
RANDOM = np.random.default_rng(0)


def printed(mean, item, v):
    """(4.6)-(4.8) written out with cross products in space, one place at a time."""
    d = mean - item
    away = np.linalg.norm(d)
    gamma = math.acos(np.clip(v @ d / away, -1.0, 1.0))
    limit, repel, attract = 0.8 * math.pi, 1.4 * R, 1.8 * R
    parts = []
    if away <= repel and gamma < limit:
        parts.append((1.0 / away - 1.0 / repel) / away**2 * d)
    if away >= attract:
        parts.append(-d / away)
    if away <= 1.1 * attract and gamma > limit:
        alpha = math.atan2(v[1], v[0])
        turn = np.array([[math.cos(alpha), -math.sin(alpha)], [math.sin(alpha), math.cos(alpha)]])
        total = np.zeros(3)
        for y, m in ((-0.7 * R, -1.0), (0.7 * R, 1.0)):
            r = np.append(mean - item - turn @ [0.0, y], 0.0)
            total += np.cross([0.0, 0.0, m], r) / np.linalg.norm(r) ** 3
        parts.append(total[:2])
    if 0.9 * repel <= away <= 1.1 * attract and gamma <= limit:
        d3, v3 = np.append(d, 0.0), np.append(v, 0.0)
        parts.append(np.cross(np.cross(v3, d3), d3)[:2])
    return sum((p / np.linalg.norm(p) for p in parts if np.linalg.norm(p) > 1e-12), np.zeros(2))


def test_the_field_is_that_of_the_printed_formulas():
    seen = 0
    for _ in range(2000):
        item, angle = RANDOM.normal(size=2), RANDOM.uniform(-4, 4)
        v = np.array([math.cos(angle), math.sin(angle)])
        mean = item + RANDOM.uniform(-0.7, 0.7, 2)
        found = swarm_input(mean[None], item, v, R)[0]
        assert np.allclose(found, printed(mean, item, v), atol=1e-9)
        seen += bool(np.abs(found).max() > 0.0)
    assert seen == 2000


@pytest.mark.long
def test_from_everywhere_it_leads_behind_the_object_and_then_ahead():
    """A mean that follows the field, where the object does not move, ends behind it."""
    v = np.array([1.0, 0.0])
    angle = np.arange(24) * math.pi / 12.0
    for distance in (0.2, 0.4, 0.8, 2.0):
        means = distance * np.column_stack([np.cos(angle), np.sin(angle)])
        for _ in range(3000):
            means = means + 2e-3 * swarm_input(means, np.zeros(2), v, R)
            # The object's own body stops those that push it.
            away = np.hypot(*means.T)
            behind = means[:, 0] < 0.0
            means = np.where(
                ((away < 0.25) & behind)[:, None], means * (0.25 / away)[:, None], means
            )
        assert (means[:, 0] < 0.0).all(), distance
        assert (np.abs(np.arctan2(means[:, 1], -means[:, 0])) < 0.25 * math.pi).all()


def test_in_front_the_tie_is_broken_and_at_the_object_nothing_is_undefined():
    v = np.array([0.0, 1.0])
    front = np.array([0.0, 1.6 * R])
    assert abs(swarm_input(front[None], np.zeros(2), v, R)[0, 0]) > 0.5
    assert np.isfinite(swarm_input(np.zeros((1, 2)), np.zeros(2), v, R)).all()
    assert np.isfinite(swarm_input(front[None], np.zeros(2), np.zeros(2), R)).all()


def test_the_goal_law_is_a_unit_vector_and_zero_at_the_target():
    for _ in range(100):
        a, b = RANDOM.normal(size=(2, 2))
        v = direction_to(a, b)
        assert np.linalg.norm(v) == pytest.approx(1.0)
        assert v @ (b - a) == pytest.approx(np.linalg.norm(b - a))
    assert not direction_to(a, a).any()
