import math
from itertools import combinations

import numpy as np
import pytest

from push_model import SettingsError, flower, polygon, rectangle
from push_model.convex_parts import convex_parts
from push_model.outlines import overlap

NAMED = {
    "L": ([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], 2),
    "U": ([[0, 0], [3, 0], [3, 2], [2, 2], [2, 1], [1, 1], [1, 2], [0, 2]], 3),
    "T": ([[-0.5, 0], [0.5, 0], [0.5, 2], [1.5, 2], [1.5, 3], [-1.5, 3], [-1.5, 2], [-0.5, 2]], 3),
    "plus": (
        [
            [1, 0],
            [2, 0],
            [2, 1],
            [3, 1],
            [3, 2],
            [2, 2],
            [2, 3],
            [1, 3],
            [1, 2],
            [0, 2],
            [0, 1],
            [1, 1],
        ],
        4,
    ),
}


def area(outline):
    x, y = outline.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def check(outline):
    parts = convex_parts(outline)
    assert sum(map(area, parts)) == pytest.approx(area(outline), rel=1e-9)
    for part in parts:
        edge = np.roll(part, -1, axis=0) - part
        after = np.roll(edge, -1, axis=0)
        turn = edge[:, 0] * after[:, 1] - edge[:, 1] * after[:, 0]
        assert turn.min() >= -1e-11 * np.ptp(outline, axis=0).max() ** 2
        assert {tuple(p) for p in part} <= {tuple(p) for p in outline}
    return parts


@pytest.mark.parametrize("name", NAMED)
def test_letters_fall_into_few_parts(name):
    vertices, most = NAMED[name]
    parts = check(polygon(vertices).outline)
    assert len(parts) <= most
    assert not any(overlap(a, b) for a, b in combinations(parts, 2))


def test_a_convex_outline_is_its_only_part():
    outline = rectangle(0.3, 0.2).outline
    (part,) = convex_parts(outline)
    assert np.array_equal(part, outline)


def test_random_outlines_and_flowers_are_covered_once():
    random = np.random.default_rng(12)
    made = 0
    while made < 250:
        n = int(random.integers(5, 14))
        angle = np.sort(random.uniform(0.0, 2.0 * math.pi, n))
        spiral = random.uniform(0.05, 0.3, n)[:, None]
        grid = np.round(random.uniform(0, 5, (n, 2)))  # many corners on one line
        points = spiral * np.column_stack([np.cos(angle), np.sin(angle)])
        try:
            outline = polygon(points if made % 3 else grid).outline
        except SettingsError:
            continue
        parts = check(outline)
        reflex = n - 2  # at most as many as triangles
        assert 1 <= len(parts) <= reflex
        if made % 25 == 0:
            assert not any(overlap(a, b) for a, b in combinations(parts, 2))
        made += 1
    assert len(check(flower(0.22, 0.03, 6, vertices=90).outline)) < 40
