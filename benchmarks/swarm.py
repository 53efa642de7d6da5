"""Coverage against libraries that build the same cells, and the time of a swarm's tick."""

import math
from typing import Any

import numpy as np
import shapely
from scipy.spatial import Voronoi

from benchmarks.measure import at_most, quantiles, thread_times
from push_model.arrays import Array
from push_scenario.bodies import load_object, load_robot
from swarm_push.coverage import Coverage
from swarm_push.density import Density, gaussian
from swarm_push.swarm_job import SwarmJob

COUNTS = (8, 20, 100, 1000)
REGION = np.array([[-1.5, -1.0], [1.5, -1.0], [1.5, 1.0], [-1.5, 1.0]])
_LAYOUTS = {8: 300, 20: 300, 100: 100, 1000: 20}
_BOX = shapely.Polygon(REGION)
_SPLIT = 3  # times that triangles are divided into four before the rule of degree five
_A, _B = (6.0 - math.sqrt(15.0)) / 21.0, (6.0 + math.sqrt(15.0)) / 21.0
_RULE = np.array(
    [[1 / 3, 1 / 3, 1 / 3]]
    + [np.roll([1.0 - 2.0 * p, p, p], k).tolist() for p in (_A, _B) for k in range(3)]
)
_WEIGHTS = np.array(
    [0.225] + [(155.0 - math.sqrt(15.0)) / 1200.0] * 3 + [(155.0 + math.sqrt(15.0)) / 1200.0] * 3
)


def _quadrature(cells: list[Array], density: Density) -> Array:
    """Centroids of polygons by triangles, all at once."""
    triangles, owner = [], []
    for i, c in enumerate(cells):
        fan = [[c[0], c[k], c[k + 1]] for k in range(1, len(c) - 1)]
        triangles += fan
        owner += [i] * len(fan)
    t, which = np.array(triangles), np.array(owner)
    for _ in range(_SPLIT):
        a, b, c = t.transpose(1, 0, 2)
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        four = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        t = np.concatenate([np.stack(f, axis=1) for f in four])
        which = np.tile(which, 4)
    u, v = t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]
    area = 0.5 * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    q = np.einsum("gb,tbx->tgx", _RULE, t)
    w = density.at(q.reshape(-1, 2)).reshape(len(t), -1) * _WEIGHTS * area[:, None]
    n = len(cells)
    mass = np.bincount(which, w.sum(axis=1), n)
    moments = [np.bincount(which, (w * q[:, :, k]).sum(axis=1), n) for k in range(2)]
    return np.column_stack(moments) / np.maximum(mass, 1e-300)[:, None]


def _by_shapely(points: Array, density: Density) -> Array:
    cells = shapely.voronoi_polygons(shapely.multipoints(points), extend_to=_BOX, ordered=True)
    clipped = shapely.intersection(shapely.get_parts(cells), _BOX)
    return _quadrature([shapely.get_coordinates(c)[:-1] for c in clipped], density)


def _by_scipy(points: Array, density: Density) -> Array:
    """The points mirrored at the four walls, so that cells of the inner ones are bounded."""
    mirrored = [points]
    for axis in range(2):
        for wall in (REGION[0, axis], REGION[2, axis]):
            image = points.copy()
            image[:, axis] = 2.0 * wall - image[:, axis]
            mirrored.append(image)
    diagram = Voronoi(np.vstack(mirrored))
    cells = []
    for i, p in enumerate(points):
        corners = diagram.vertices[diagram.regions[diagram.point_region[i]]]
        angle = np.arctan2(corners[:, 1] - p[1], corners[:, 0] - p[0])
        cells.append(corners[np.argsort(angle)])
    return _quadrature(cells, density)


def _coverage(results: dict[str, Any], bounds: dict[str, Any]) -> None:
    coverage, density = Coverage(REGION), gaussian(np.array([0.4, 0.2]), 0.35, 0.25, 0.5)
    for count in COUNTS:
        random = np.random.default_rng(count)
        layouts = [
            random.uniform(REGION[0] + 0.05, REGION[2] - 0.05, (count, 2))
            for _ in range(_LAYOUTS[count])
        ]
        coverage.centroids(layouts[0], density)
        medians = {}
        found: dict[str, list[Array]] = {}
        for name, method in (
            ("ours", coverage.centroids),
            ("shapely", _by_shapely),
            ("scipy", _by_scipy),
        ):
            times, found[name] = thread_times(lambda p, m=method: m(p, density), layouts)
            medians[name] = float(np.median(times))
            if name == "ours":
                print(f"  coverage, {count:4d} robots: {quantiles(times)}")
        for name in ("shapely", "scipy"):
            off = max(
                float(np.hypot(*(a - b).T).max())
                for a, b in zip(found["ours"], found[name], strict=True)
            )
            print(
                f"    {name}: {1e6 * medians[name]:9.1f} us, {medians[name] / medians['ours']:6.1f}"
                f" times ours; centroids apart by {1e3 * off:.4f} mm at most"
            )
        results[f"coverage {count}"] = medians
        if count == 20:
            bounds["coverage of 20 robots [ms]"] = at_most(1e3 * medians["ours"], 0.2)
        if count == 1000:
            bounds["coverage of 1000 robots [ms]"] = at_most(1e3 * medians["ours"], 25.0)


def _ticks(results: dict[str, Any]) -> None:
    """Whole ticks of a job with the crescent law, robots at random around the object."""
    item, robot = load_object("swarm_square"), load_robot("epuck_ring")
    for count in COUNTS:
        half = max(2.0, 0.15 * math.sqrt(count))
        region = half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        random = np.random.default_rng(count)
        job = SwarmJob(region, item, robot)
        job.begin([np.array([0.8 * half, 0.0, math.nan])])
        inputs = []
        for k in range(60 if count < 1000 else 12):
            table = np.column_stack(
                [random.uniform(-half, half, (count, 2)), random.uniform(-3.0, 3.0, count)]
            )
            inputs.append((0.02 * k, {f"e{i}": p for i, p in enumerate(table)}))
        none = np.zeros((0, 3))
        times, _ = thread_times(
            lambda i, job=job, none=none: job.step(i[0], np.zeros(3), i[1], none), inputs
        )
        print(f"  a whole tick, {count:4d} robots: {quantiles(times[5:])}")
        results[f"tick {count}"] = float(np.median(times[5:]))


def run() -> dict[str, Any]:
    """Coverage and ticks for swarms of 8 to 1000."""
    results: dict[str, Any] = {}
    bounds: dict[str, Any] = {}
    _coverage(results, bounds)
    _ticks(results)
    return {**results, "bounds": bounds}
