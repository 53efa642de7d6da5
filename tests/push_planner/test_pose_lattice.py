"""Arcs, turns and cheapest ways on a lattice of poses."""

import math

import numpy as np
import pytest

from push_model import se2
from push_planner.pose_lattice import PoseLattice, costs_to, joined, least_costs

RADIUS = 1.0
LATTICE = PoseLattice(np.array([1.5, 1.0]), RADIUS)
COUNT = len(LATTICE.poses)
ALL = np.ones(COUNT, dtype=bool)


def away(a, b):
    """[m] and [rad] between poses ``(n, 3)``."""
    turned = np.abs(np.angle(np.exp(1j * (a[:, 2] - b[:, 2]))))
    return np.hypot(*(a - b)[:, :2].T), turned


def test_every_pose_is_the_nearest_to_what_is_close_to_it():
    random = np.random.default_rng(1)
    assert (LATTICE.nearest(LATTICE.poses) == np.arange(COUNT)).all()
    poses = random.uniform([-1.5, -1.0, -9.0], [1.5, 1.0, 9.0], (500, 3))
    off, turned = away(LATTICE.poses[LATTICE.nearest(poses)], poses)
    everywhere = np.hypot(*(LATTICE.poses[:, None, :2] - poses[None, :50, :2]).T)
    assert np.allclose(off[:50], everywhere.min(axis=1))
    assert turned.max() <= math.pi / 32 + 1e-9
    outside = poses + [3.0, 0.0, 0.0]
    assert (LATTICE.nearest(outside) == -1).all()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_arc_ends_near_where_a_robot_comes_that_drives_it(sign):
    """By many small steps; the end is off by no more than the lattice is coarse."""
    begins, to, costs = LATTICE.arcs(ALL, sign, 0.5)
    random = np.random.default_rng(2)
    bends = set()
    for k in random.choice(len(begins), 300, replace=False):
        start, end = LATTICE.poses[begins[k]], LATTICE.poses[to[k]]
        turn = sign * float(se2.wrap(end[2] - start[2]))
        length = RADIUS * math.pi / 8.0
        bend = round(turn / (math.pi / 8.0), 3)
        pose = start.copy()
        for _ in range(1000):
            pose[2] += 0.5e-3 * sign * turn
            pose[:2] += 1e-3 * sign * length * np.array([math.cos(pose[2]), math.sin(pose[2])])
            pose[2] += 0.5e-3 * sign * turn
        off, turned = away(pose[None], end[None])
        assert off[0] <= 0.125 / math.sqrt(2.0) + 1e-6 and turned[0] < 1e-6
        more = {0.0: 0.0, 0.5: 0.05, 1.0: 0.5}[abs(bend)]
        assert costs[k] == pytest.approx(length * (1.0 + more))
        bends.add(bend)
    assert bends == {-1.0, -0.5, 0.0, 0.5, 1.0}


def test_arcs_and_turns_join_free_poses_only():
    free = np.random.default_rng(3).random(COUNT) < 0.5
    for begins, to, _ in (LATTICE.arcs(free, 1.0, 0.0), LATTICE.arcs(free, -1.0, 0.0)):
        assert len(begins) and free[begins].all() and free[to].all()
    begins, to, costs = LATTICE.turns(free, 0.05)
    off, turned = away(LATTICE.poses[begins], LATTICE.poses[to])
    assert off.max() == 0.0 and np.allclose(turned, math.pi / 16) and (costs == 0.05).all()
    assert (np.bincount(begins, minlength=COUNT) == 2 * free).all()


@pytest.mark.parametrize("seed", range(5))
def test_costs_and_ways_are_those_of_the_cheapest_way(seed):
    """Bellman's equation, at all nodes; and the ways that are told cost what is told."""
    random = np.random.default_rng(seed)
    free = random.random(COUNT) < 0.7
    edges = joined([LATTICE.arcs(free, 1.0, 0.5), LATTICE.turns(free, 0.05)])
    goals = np.zeros(COUNT, dtype=bool)
    goals[random.choice(np.flatnonzero(free), 20)] = True
    cost, following = costs_to(edges, COUNT, goals)
    begins, to, lengths = edges
    best = np.where(goals, 0.0, np.inf)
    np.minimum.at(best, begins, lengths + cost[to])
    assert np.allclose(best, cost, atol=1e-6) and np.isinf(cost[~free]).all()
    price = {(a, b): c for a, b, c in zip(*edges, strict=True)}
    reached = np.flatnonzero(np.isfinite(cost) & ~goals)
    assert len(reached) > 100
    for start in random.choice(reached, 20):
        node, spent = int(start), 0.0
        while following[node] >= 0:
            spent += price[node, int(following[node])]
            node = int(following[node])
        assert goals[node] and spent == pytest.approx(cost[start], abs=1e-6)
        there, before = least_costs(edges, COUNT, int(start))
        assert there[goals].min() == pytest.approx(cost[start], abs=1e-6)
        node = int(np.flatnonzero(goals)[there[goals].argmin()])
        while node != start:
            node = int(before[node])


def test_without_a_goal_nothing_is_reached():
    cost, following = costs_to(LATTICE.turns(ALL, 0.05), COUNT, ~ALL)
    assert np.isinf(cost).all() and (following == -1).all()
