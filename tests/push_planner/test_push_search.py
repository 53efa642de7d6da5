"""The guess and the search against explicit graphs, the sweep against its definition."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from push_model import se2
from push_planner import (
    DistanceField,
    PlannerSettings,
    PushCurve,
    PushScene,
    shortest_push_curve,
)
from push_planner.candidate_poses import Candidates, nearby, runs, scattered
from push_planner.drive_risk import TIGHT
from push_planner.guide_path import path_cost
from push_planner.push_graph import PushGraph, SearchStatistics, risk_of
from push_planner.push_search import PushSearch
from push_planner.rough_cost import guessed_length

START = np.array([-0.9, -0.5, 0.4])
GOALS = np.array([[0.9, 0.3, 0.2], [0.9, 0.3, 1.2], [-0.3, 0.4, 2.0], [0.6, 0.6, -0.9]])


@pytest.fixture(scope="module")
def scene(scenario, robot, box):
    return PushScene(DistanceField(scenario.grid), robot, box, PlannerSettings())


def graph_of(scene, seed, count=24):
    random = np.random.default_rng(seed)
    poses = random.uniform([-1.0, -0.6, -0.5], [1.0, 0.6, 0.9], (count, 3))
    poses[::2, 1] *= 0.2  # some in the passage
    return PushGraph(
        scene, START, GOALS[seed], Candidates(poses, np.zeros(count)).free(scene), np.inf
    )


def cheapest(graph, cost):
    """Cost of the best plan, and of the way to every state, over explicit edges of a cost."""
    n, sides = len(graph.poses), len(graph.scene.sides)
    # node i * sides + s: ready at i to push on s; n * sides + the same: arrived at i on s
    rows, columns, weights = [], [], []
    for i in range(n):
        for s in range(sides):
            if not graph.room[s, i]:
                continue
            for j in range(1, n):
                edge = cost(i, j, s) if j != i and i != n - 1 and graph.room[s, j] else np.inf
                if np.isfinite(edge):
                    rows.append(i * sides + s)
                    columns.append((n + j) * sides + s)
                    weights.append(edge)
            for t in range(sides):
                if graph.room[t, i] and i != 0:
                    rows.append((n + i) * sides + s)
                    columns.append(i * sides + t)
                    weights.append(graph.side_change(i, s, t) + 1e-15)
    size = 2 * n * sides
    edges = csr_array((weights, (rows, columns)), shape=(size, size))
    sources = [s for s in range(sides) if graph.room[s, 0]]
    distance = dijkstra(edges, indices=sources).min(axis=0)
    goal = slice((2 * n - 1) * sides, 2 * n * sides)
    distance += graph.begin
    return float(distance[goal].min()), distance[: n * sides].reshape(n, sides)


@pytest.mark.parametrize("seed", range(4))
def test_guessed_costs_are_those_of_dijkstra_on_the_explicit_graph(scene, seed):
    graph = graph_of(scene, seed)
    field, least = scene.field, scene.shape.inradius + scene.settings.safety_distance

    def guess(i, j, s):
        (ax, ay, at, ac, sa), (bx, by, bt, bc, sb) = graph.robots[s, i], graph.robots[s, j]
        length = guessed_length(ax, ay, ac, sa, bx, by, bc, sb, graph.chords[s])
        if not np.isfinite(length):
            return length
        size = float(np.hypot(bx - ax, by - ay))
        ends = np.array([ax, ay, at]), np.array([bx, by, bt])
        part = 1.0
        for k in (1.0, 0.5, 1.6):
            points, heading, _ = PushCurve(*ends, k * size, k * size, size).sample(400)
            robots = np.column_stack([points, heading])
            items = np.array([se2.compose(r, scene.sides[s].grasp) for r in robots])
            rooms = np.array([field.at(x, y) for x, y, _ in items])
            way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(items[:, :2], axis=0).T))])
            crossed = float(np.diff(way)[(rooms < least)[1:]].sum())
            if least - rooms.min() < 0.05:
                part = min(part, crossed / 0.1)
        time = scene.time
        return time.pace * (length + 0.6 * part) if part < 1.0 else np.inf

    best, states = cheapest(graph, guess)
    ready, estimate = graph.rough_costs(np.inf)
    known = np.isfinite(states[1:-1])
    both = known & np.isfinite(ready[1:-1])
    # The planner's look along a cubic takes steps of 2 cm: it may miss or count a corner more.
    assert both.sum() > 0.9 * known.sum() and known.sum() > 15
    gap = np.abs(ready[1:-1][both] - states[1:-1][both])
    pace = scene.time.pace
    assert np.median(gap) < 0.01 * pace and np.quantile(gap, 0.9) < 0.3 * pace
    assert estimate == pytest.approx(best, abs=0.3 * pace)


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_the_search_is_as_good_as_trying_every_push(scene, seed):
    graph = graph_of(scene, seed)
    search = PushSearch(graph, np.inf, 1.0, 10**6)
    statistics = SearchStatistics()
    for _ in search.run(statistics):
        pass
    other = graph_of(scene, seed)
    everything = SearchStatistics()

    def cost(i, j, s):
        step = other.push(i, j, s, everything)
        return np.inf if step is None else step.time

    best, _ = cheapest(other, cost)
    if not np.isfinite(best):
        assert search.solution is None and search.exhausted
        return
    assert best - 1e-9 <= search.cost <= 1.02 * best
    assert statistics.solved < 0.5 * everything.solved


def changes_of(steps):
    return [(a, b) for a, b in pairwise(steps) if a.side.index != b.side.index]


@pytest.mark.parametrize(("seed", "count"), [(1, 60), (3, 24), (3, 60)])
def test_drives_with_little_room_count_more_and_impossible_ones_are_avoided(
    scene, seed, count, monkeypatch
):
    """Where every drive is narrow, each counts 3 s; there is a plan all the same."""

    def searched(has_way):
        monkeypatch.setattr("push_planner.drive_risk.has_way", has_way)
        search = PushSearch(graph_of(scene, seed, count), np.inf, 1.0, 10**6)
        list(search.run(SearchStatistics()))
        return search

    wide = searched(lambda *_, spare=0.0: True)
    assert changes_of(wide.solution) and risk_of(scene, wide.solution) == 0.0
    shut = searched(lambda *_, spare=0.0: False)
    assert shut.solution is None or not changes_of(shut.solution)
    narrow = searched(lambda *_, spare=0.0: spare == 0.0)
    risk = risk_of(scene, narrow.solution)
    assert risk == TIGHT * len(changes_of(narrow.solution))
    assert wide.cost - 1e-9 <= narrow.cost - risk
    assert narrow.cost <= wide.cost + TIGHT * len(changes_of(wide.solution)) + 1e-9


def test_a_bound_is_never_exceeded_and_an_exhausted_search_says_so(scene):
    for seed in range(4):
        free = PushSearch(graph_of(scene, seed), np.inf, 1.0, 10**6)
        list(free.run(SearchStatistics()))
        tight = PushSearch(graph_of(scene, seed), free.cost, 1.0, 10**6)
        list(tight.run(SearchStatistics()))
        assert tight.solution is None or tight.cost < free.cost
        assert tight.exhausted or tight.solution is not None
        hasty = PushSearch(graph_of(scene, seed), np.inf, 1.0, 1)
        list(hasty.run(SearchStatistics()))
        assert hasty.expanded <= 1
        assert hasty.solution is not None or not hasty.exhausted or free.solution is None


def test_sweeps_are_hardly_less_clear_than_their_poses_one_by_one(scene):
    random = np.random.default_rng(5)
    compared = 0
    for _ in range(200):
        side = scene.sides[random.integers(len(scene.sides))]
        start = random.uniform([-1.2, -0.8, -np.pi], [1.2, 0.8, np.pi])
        end = se2.compose(start, random.uniform([0.3, -0.3, -0.6], [1.2, 0.3, 0.6]))
        curve = shortest_push_curve(start, end, side.trusted.minimum, side.trusted.maximum)
        if curve is None:
            continue
        points, heading, _ = curve.sample(max(8, int(curve.length / 0.004) + 2))
        least = np.inf
        for pose in np.column_stack([points, heading]):
            item = se2.compose(pose, side.grasp)
            outline = scene.field.clearance(scene.shape.dense_outline(0.01), item)
            least = min(least, scene.robot_clearance(pose), outline)
        swept = scene.curve_clearance(curve, side, -1.0)
        assert least - 0.001 <= swept <= least + 1e-9
        compared += least > 0.0
    assert compared > 20


def test_runs_end_where_a_push_of_that_length_leads(scene):
    for direction in (1.0, -1.0):
        ends = runs(scene, START, direction, 0.0, (0.2, 0.5)).poses
        assert len(ends) == 6 * len(scene.sides)
        found = 0
        for number, side in enumerate(scene.sides):
            for pose in ends[6 * number : 6 * number + 6]:
                first, last = (START, pose) if direction > 0.0 else (pose, START)
                curve = shortest_push_curve(
                    side.robot_pose(first),
                    side.robot_pose(last),
                    side.trusted.minimum,
                    side.trusted.maximum,
                )
                found += curve is not None and curve.length < 0.52
        assert found == len(ends)


def test_scattered_poses_lie_near_the_guide_and_nearby_ones_about_theirs(scene):
    points = np.array([[-1.0, 0.0], [1.0, 0.0]])
    guide = path_cost(scene.field, points, scene.settings)
    cloud = scattered(scene, guide, 500, np.random.default_rng(1))
    assert np.abs(cloud.poses[:, 1]).max() <= 1.0 and np.abs(cloud.poses[:, 0]).max() <= 2.0
    assert (np.abs(cloud.poses[:, 0] - (cloud.way - 1.0)) <= 1.0 + 1e-9).all()
    poses = np.array([START, GOALS[0]])
    about = nearby(poses, 100, 0.05, np.random.default_rng(1)).poses.reshape(2, 100, 3)
    assert np.array_equal(about[:, 0], poses)
    assert about[:, :, :2].std(axis=1) == pytest.approx(0.05, rel=0.3)
    assert about.mean(axis=1) == pytest.approx(poses, abs=0.1)
