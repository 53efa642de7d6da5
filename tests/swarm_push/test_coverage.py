"""Cells and centroids against an independent reference, on random and degenerate layouts."""

import itertools
import math

import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree

from swarm_push.coverage import Coverage
from swarm_push.density import Density, gaussian, tangential
from tests.samples import mostly_long

ROOM = np.array([[-1.5, -1.0], [1.5, -1.0], [1.5, 1.0], [-1.5, 1.0]])
HEXAGON = np.array([[math.cos(a), 1.4 * math.sin(a)] for a in np.arange(6) * math.pi / 3.0])
RULE = np.array(  # of degree five on a triangle: barycentric coordinates and weights
    [[1 / 3, 1 / 3, 1 / 3, 0.225]]
    + [[a, b, c, 0.1323941527885062] for a, b, c in
       [(0.0597158717897698, 0.4701420641051151, 0.4701420641051151),
        (0.4701420641051151, 0.0597158717897698, 0.4701420641051151),
        (0.4701420641051151, 0.4701420641051151, 0.0597158717897698)]]
    + [[a, b, c, 0.1259391805448271] for a, b, c in
       [(0.7974269853530873, 0.1012865073234563, 0.1012865073234563),
        (0.1012865073234563, 0.7974269853530873, 0.1012865073234563),
        (0.1012865073234563, 0.1012865073234563, 0.7974269853530873)]]
)  # fmt: skip


def polygon_of(i, points, region):
    """The cell of a point: half-planes by shapely, brute force."""
    cell, size = shapely.Polygon(region), 20.0
    for j, q in enumerate(points):
        if j != i:
            normal = (q - points[i]) / np.linalg.norm(q - points[i])
            across, middle = np.array([-normal[1], normal[0]]), 0.5 * (q + points[i])
            half = [middle + size * across, middle - size * across]
            half += [p - size * normal for p in reversed(half)]
            cell = cell.intersection(shapely.Polygon(half))
    return cell


def centroid_of(cell, density):
    """By triangles that are split until the density hardly changes on them; relative to its peak,
    so that tails do not vanish."""
    corners = shapely.get_coordinates(cell)[:-1]
    triangles = np.array([[corners[0], b, c] for b, c in itertools.pairwise(corners[1:])])

    def standardised(q):
        return np.einsum("kij,...kj->...ki", density.roots, q[..., None, :] - density.means)

    def exponents(q):
        return np.log(density.weights) - 0.5 * (standardised(q) ** 2).sum(axis=-1)

    done, peak = [], -np.inf
    for _ in range(40):
        middle = standardised(triangles.mean(axis=1))
        off = standardised(triangles) - middle[:, None]
        size = np.linalg.norm(off, axis=-1).max(axis=1)
        least = np.maximum(np.linalg.norm(middle, axis=-1) - size, 0.0)
        values = exponents(triangles).max(axis=-1)
        peak = max(peak, values.max())
        there = (np.log(density.weights) - 0.5 * least**2).max(axis=-1) > peak - 35.0
        rough = there & ((size.max(axis=-1) > 0.5) | (np.ptp(values, axis=1) > 1.0))
        done.append(triangles[there & ~rough])
        if not rough.any():
            break
        a, b, c = triangles[rough].transpose(1, 0, 2)
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        four = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = np.concatenate([np.stack(t, axis=1) for t in four])
    triangles = np.concatenate(done)
    u, v = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    area = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    q = np.einsum("gb,tbx->tgx", RULE[:, :3], triangles)
    w = np.exp(exponents(q) - peak).sum(axis=-1) * RULE[:, 3] * area[:, None]
    return np.einsum("tg,tgx->x", w, q) / w.sum()


def random_density(random, parts):
    roots = []
    for _ in range(parts):
        s = 10.0 ** random.uniform(-1.7, -0.2, 2)
        roots.append(gaussian(np.zeros(2), s[0], s[1], random.uniform(0, 7)).roots[0])
    return Density(
        10.0 ** random.uniform(-2, 0, parts), random.uniform(-1.3, 1.3, (parts, 2)), np.array(roots)
    )


@pytest.mark.parametrize("count", mostly_long([1, 20, 100, 2, 3, 5, 8, 60], 1))
def test_centroids_agree_with_an_independent_reference_within_a_tenth_of_a_millimetre(count):
    worst = 0.0
    for k in range(6):
        random = np.random.default_rng([count, k])
        region = ROOM if k % 2 else HEXAGON
        spread = 0.05 if k == 3 else 0.6
        points = Coverage(region).inside(random.normal(0.0, spread, (count, 2)))
        points += random.uniform(-1e-4, 1e-4, points.shape)
        points = Coverage(region).inside(points)
        density = random_density(random, 1 + k % 3)
        found = Coverage(region).centroids(points, density)
        for i in random.choice(count, min(count, 6), replace=False):
            cell = polygon_of(i, points, region)
            if cell.area > 1e-10:
                worst = max(worst, np.linalg.norm(found[i] - centroid_of(cell, density)))
    assert worst < 1e-4


def degenerate():
    line = np.linspace(-0.8, 0.8, 9)
    grid = np.stack(np.meshgrid(line[::2], line[::2]), axis=-1).reshape(-1, 2)
    return {
        "all at one place": np.tile([[0.2, -0.1]], (7, 1)),
        "pairs": np.repeat([[0.2, -0.1], [-0.4, 0.3], [0.0, 0.0]], 2, axis=0),
        "a line": np.column_stack([line, 0.5 * line]),
        "a row": np.column_stack([line, 0.0 * line]),
        "a grid": grid,
        "a circle": 0.5 * np.column_stack([np.cos(line * 4.0), np.sin(line * 4.0)]),
        "outside": np.array([[5.0, 5.0], [5.0, 5.0], [-9.0, 0.0], [0.1, 0.0]]),
        "at the corners": ROOM.copy(),
        "one": np.array([[0.3, 0.3]]),
    }


@pytest.mark.parametrize("name", degenerate())
def test_degenerate_layouts_have_cells_that_fill_the_region_and_centroids_in_them(name):
    points, coverage = degenerate()[name], Coverage(ROOM)
    density = gaussian(np.array([0.3, 0.1]), 0.2, 0.1, 0.4)
    cells = [shapely.Polygon(c).convex_hull for c in coverage.cells(points)]
    assert sum(c.area for c in cells) == pytest.approx(6.0, abs=1e-9)
    found = coverage.centroids(points, density)
    seeds = coverage.inside(points)
    for i, (cell, centroid) in enumerate(zip(cells, found, strict=True)):
        assert cell.buffer(1e-7).contains(shapely.Point(centroid))
        assert np.linalg.norm(centroid - centroid_of(cell, density)) < 1e-4
        assert cell.distance(shapely.Point(seeds[i])) < 2e-6


@pytest.mark.parametrize("count", [1, 7, 40, 400, 1000])
def test_cells_are_where_their_robot_is_the_nearest(count):
    for k in range(4):
        random = np.random.default_rng([count, k])
        points = random.uniform(ROOM[0], ROOM[2], (count, 2)) * (0.01 if k == 2 else 1.0)
        cells = Coverage(ROOM).cells(points)
        polygons = [shapely.Polygon(c) for c in cells]
        assert sum(p.area for p in polygons) == pytest.approx(6.0, rel=1e-9)
        tree = shapely.STRtree(polygons)
        sample = random.uniform(ROOM[0], ROOM[2], (300, 2)) * (0.02 if k == 2 else 1.0)
        nearest = cKDTree(points).query(sample)[1]
        for q, i in zip(sample, nearest, strict=True):
            assert i in tree.query(shapely.Point(q).buffer(1e-9), predicate="intersects")


def test_lloyd_spreads_robots_as_the_density_says():
    """Figure 4.3: twenty robots over a Gaussian of 0.1 m."""
    random = np.random.default_rng(0)
    density = gaussian(np.zeros(2), 0.1, 0.1, 0.0)
    points = random.uniform(-0.9, 0.9, (20, 2))
    coverage = Coverage(ROOM)
    for _ in range(300):
        points = points + 0.5 * (coverage.centroids(points, density) - points)
    assert np.abs(points.mean(axis=0)).max() < 2e-3
    # Many robots stand as the root of the density: at 0.14 m.
    assert 0.1 < points.std() < 0.14
    away = coverage.centroids(points, density) - points
    assert np.abs(away).max() < 1e-3


def test_a_swarm_far_off_is_drawn_towards_the_density():
    """Its mass there is less than the least number, and centroids are right all the same."""
    density = gaussian(np.array([1.4, 0.9]), 0.01, 0.01, 0.0)
    points = np.array([[-1.4, -0.9], [-1.3, -0.9], [-1.4, -0.8]])
    assert density.at(points).max() == 0.0
    found = Coverage(ROOM).centroids(points, density)
    for i in range(3):
        reference = centroid_of(polygon_of(i, points, ROOM), density)
        assert np.linalg.norm(found[i] - reference) < 1e-4


def test_the_wide_axis_of_the_lower_layers_gaussian_is_tangential_to_the_object():
    random = np.random.default_rng(1)
    for _ in range(200):
        mean, item = random.normal(size=(2, 2))
        density = tangential(mean, item, 0.2, 0.1)
        B = 0.5 * density.roots[0].T @ density.roots[0]
        assert np.allclose(B, B.T) and np.linalg.eigvalsh(B).min() > 0.0
        wide = np.linalg.eigh(B)[1][:, 0]
        assert abs(wide @ (item - mean)) < 1e-9
    assert np.isfinite(tangential(np.zeros(2), np.zeros(2), 0.2, 0.1).roots).all()


def test_the_mean_of_a_density_is_that_of_its_parts():
    density = Density(
        np.array([1.0, 3.0]), np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([np.eye(2), np.eye(2)])
    )
    assert np.allclose(density.mean, [0.75, 0.0])


@pytest.mark.parametrize(
    "corners", [ROOM[::-1], ROOM[:2], np.array([[0, 0], [2, 0], [0.1, 0.1], [0, 2.0]])]
)
def test_a_region_that_is_none_is_refused(corners):
    with pytest.raises(ValueError, match="convex"):
        Coverage(corners)
    with pytest.raises(ValueError, match="at most"):
        Coverage(np.array([[math.cos(a), math.sin(a)] for a in np.linspace(0, 6.2, 100)]))
