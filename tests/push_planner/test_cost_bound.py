"""The lower bound on the cost of a plan: never above what a plan costs, and not far below."""

import math

import numpy as np
import pytest
from ompl import base as ob
from scipy.optimize import minimize

from benchmarks.plan import cluttered, exhaustive, problems
from push_model import se2
from push_model.distance_field import DistanceField
from push_model.free_space import FreeSpace
from push_model.occupancy import OccupancyGrid, rasterise
from push_planner import PlannerSettings, PlanningFailed, PushPlanner
from push_planner.cost_bound import CostBound, least_way
from push_planner.dubins_bound import least_length


class Dubins:
    """Shortest lengths by OMPL, for equal limits to both sides."""

    def __init__(self, radius):
        self.space = ob.DubinsStateSpace(radius)
        self.states = self.space.allocState(), self.space.allocState()

    def __call__(self, a, b):
        for state, (x, y, theta) in zip(self.states, (a, b), strict=True):
            state.setX(float(x))
            state.setY(float(y))
            state.setYaw(float(se2.wrap(theta)))
        return float(self.space.distance(*self.states))


def driven(pose, random, left, right, pieces):
    """Where random arcs and lines lead from a pose, and their length."""
    pose, total = np.array(pose), 0.0
    for _ in range(pieces):
        kappa = random.choice([1.0 / left, -1.0 / right, 0.0, random.uniform(-1 / right, 1 / left)])
        length = random.exponential(0.4)
        turn = kappa * length
        chord = np.array([length * np.sinc(turn / np.pi), 0.0, 0.0])
        if kappa:
            chord[:2] = np.array([math.sin(turn), 1.0 - math.cos(turn)]) / kappa
        chord[2] = turn
        pose, total = se2.compose(pose, chord), total + length
    return pose, total


def test_the_shortest_length_is_that_of_ompl_and_a_bound_for_all_poses_about():
    random, dubins = np.random.default_rng(1), Dubins(0.6)
    for _ in range(4000):
        x, y, turn = random.uniform([-2.0, -2.0, -np.pi], [2.0, 2.0, np.pi])
        exact = least_length(x, y, turn, 0.6, 0.6, 0.0, 0.0)
        assert exact == pytest.approx(dubins((0.0, 0.0, 0.0), (x, y, turn)), abs=1e-6)
        off, slack, way = random.uniform(0.0, [0.2, 0.5, 2.0 * np.pi])
        there = (
            x + off * math.cos(way),
            y + off * math.sin(way),
            turn + random.choice([-1, 1]) * slack,
        )
        bound = least_length(x, y, turn, 0.6, 0.6, off, slack)
        assert bound <= exact + 1e-9 and bound <= dubins((0.0, 0.0, 0.0), there) + 1e-6


def test_no_random_drive_is_shorter_also_where_the_limits_differ():
    random, tight = np.random.default_rng(2), 0
    for _ in range(4000):
        left, right = random.uniform(0.2, 1.5, 2)
        (x, y, turn), length = driven(np.zeros(3), random, left, right, random.integers(1, 6))
        bound = least_length(x, y, turn, left, right, 0.0, 0.0)
        assert bound <= length + 1e-6
        tight += bound > 0.99 * length
    assert tight > 400, "drives of one piece are the shortest ones"


@pytest.fixture(scope="module")
def open_scene(robot, box):
    occupied = np.zeros((240, 240), dtype=bool)
    grid = OccupancyGrid(occupied, 0.05, np.full(2, -6.0))
    return PushPlanner(PlannerSettings(), grid, robot, box).scene


def costs_of(scene, sides, lengths):
    change = 0.0
    for a, b in zip(sides, sides[1:], strict=False):
        apart = se2.inverse(a.grasp)[:2] - se2.inverse(b.grasp)[:2]
        change += float(np.hypot(*apart)) + scene.settings.side_change_cost
    return sum(lengths) + len(lengths) * scene.settings.push_cost + change


def test_no_random_plan_costs_less(open_scene):
    """One to four runs, each of random curvatures."""
    random, scene = np.random.default_rng(3), open_scene
    near = 0
    for _ in range(200):
        start = random.uniform([-1.0, -1.0, -np.pi], [1.0, 1.0, np.pi])
        pose, sides, lengths = start, [], []
        for _ in range(random.integers(1, 5)):
            others = [s for s in scene.sides if not sides or s is not sides[-1]]
            side = others[random.integers(len(others))]
            radius = 1.0 / side.trusted.maximum
            robot, length = driven(side.robot_pose(pose), random, radius, radius, 1)
            pose = se2.compose(robot, side.grasp)
            sides.append(side)
            lengths.append(length)
        cost = costs_of(scene, sides, lengths)
        bound = CostBound(scene, start, pose)
        before = bound.value
        for _ in bound.run(128, cost):
            assert bound.value >= before, "it only rises"
            before = bound.value
        assert bound.value <= cost + 1e-9
        near += bound.value > 0.95 * cost
    assert near > 40


def test_it_is_near_the_best_plan_of_two_runs(open_scene):
    """Where no obstacle is near, and the pose in between is optimised."""
    random, scene = np.random.default_rng(4), open_scene
    dubins = Dubins(1.0 / scene.sides[0].trusted.maximum)
    gaps = []
    for _ in range(8):
        start, goal = (random.uniform([-0.8, -0.8, -np.pi], [0.8, 0.8, np.pi]) for _ in range(2))
        best = math.inf
        for a in scene.sides:
            begin = a.robot_pose(start)
            single = dubins(begin, a.robot_pose(goal)) + scene.settings.push_cost
            best = min(best, single)
            for b in scene.sides:
                if a is b:
                    continue
                end = b.robot_pose(goal)

                def cost(pose, a=a, b=b, begin=begin, end=end):
                    lengths = dubins(begin, a.robot_pose(pose)), dubins(b.robot_pose(pose), end)
                    return costs_of(scene, [a, b], lengths)

                draws = random.uniform([-1.5, -1.5, -np.pi], [1.5, 1.5, np.pi], (150, 3))
                values = [cost(d) for d in draws]
                for k in np.argsort(values)[:2]:
                    found = minimize(cost, draws[k], method="Nelder-Mead", options={"maxfev": 250})
                    best = min(best, float(found.fun))
        bound = CostBound(scene, start, goal)
        for _ in bound.run(5000, best):
            pass
        assert bound.value <= best + 1e-9
        gaps.append(min(best, bound.others) / bound.value - 1.0)
    assert np.median(gaps) < 0.06 and max(gaps) < 0.25


def test_ways_about_obstacles_are_never_over_estimated(robot, box):
    """Against paths that a disc can take."""
    ratios = []
    for seed in range(12):
        grid = rasterise(cluttered(seed))
        field, random = DistanceField(grid), np.random.default_rng(seed)
        least = box.geometry.inradius + 0.012
        space = FreeSpace(grid)
        x0, x1, y0, y1 = grid.extent
        for _ in range(15):
            a, b = (random.uniform([x0, y0], [x1, y1]) for _ in range(2))
            if min(space.clearance(np.array([a, b]))) < least:
                continue
            reach = space.from_here(a, least)
            while not reach.settle(100000):
                pass
            way = reach.way_to(b)
            if way is None:
                continue
            length = float(np.hypot(*np.diff(way, axis=0).T).sum())
            lower = least_way(field, a, b, least)
            assert lower <= length + 1e-9
            ratios.append(lower / length)
    assert len(ratios) > 60 and np.median(ratios) > 0.85


@pytest.mark.long
def test_no_search_finds_a_cheaper_plan(scenario, robot, box):
    """Final plans and an exhaustive search, in environment 1 and among clutter."""
    gaps = []
    worlds = [scenario.grid, *(rasterise(cluttered(k)) for k in range(2))]
    for world in worlds:
        planner = PushPlanner(PlannerSettings(), world, robot, box)
        for start, goal in problems(planner, 4, 11):
            try:
                plan = planner.solve(start, goal)
            except PlanningFailed:
                continue
            assert planner.lower_bound(start, goal) <= plan.cost_bound <= plan.cost
            assert plan.cost_bound <= exhaustive(planner, start, goal, 1)
            gaps.append(plan.cost / plan.cost_bound - 1.0)
    assert len(gaps) > 6 and np.median(gaps) < 0.3
