"""The lower bound on the cost of a plan: never above what a plan costs, and not far below."""

import math
from dataclasses import replace

import numpy as np
import pytest
from ompl import base as ob
from scipy.optimize import minimize

from benchmarks.plan import cluttered, exhaustive, problems
from push_model import se2
from push_model.kinematics import unicycle_step
from push_model.occupancy import OccupancyGrid, rasterise
from push_model.settings import from_mapping
from push_model.specs import CircleSpec, EnvironmentSpec
from push_planner import PlannerSettings, PlanningFailed, PushPlanner
from push_planner.cost_bound import CostBound
from push_planner.dubins_bound import least_length
from push_planner.run_ends import RunEnds
from push_planner.single_run import least_single_run
from tests.samples import slice_and_study


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


def driven(pose, random, left, right, pieces, scale=0.4):
    """Where random arcs and lines lead from a pose, their length and what they turn.

    scale: [m] of each.
    """
    pose, total, turned = np.array(pose), 0.0, 0.0
    for _ in range(pieces):
        kappa = random.choice([1.0 / left, -1.0 / right, 0.0, random.uniform(-1 / right, 1 / left)])
        length = random.exponential(scale)
        turn = kappa * length
        chord = np.array([length * np.sinc(turn / np.pi), 0.0, 0.0])
        if kappa:
            chord[:2] = np.array([math.sin(turn), 1.0 - math.cos(turn)]) / kappa
        chord[2] = turn
        pose, total, turned = se2.compose(pose, chord), total + length, turned + abs(turn)
    return pose, total, turned


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
        (x, y, turn), length, _ = driven(np.zeros(3), random, left, right, random.integers(1, 6))
        bound = least_length(x, y, turn, left, right, 0.0, 0.0)
        assert bound <= length + 1e-6
        tight += bound > 0.99 * length
    assert tight > 400, "drives of one piece are the shortest ones"


def open_scene(robot, item):
    occupied = np.zeros((240, 240), dtype=bool)
    grid = OccupancyGrid(occupied, 0.05, np.full(2, -6.0))
    return PushPlanner(PlannerSettings(), grid, robot, item).scene


def costs_of(scene, sides, lengths, turns):
    """[s] of runs on these sides, of these lengths [m], which turn so much [rad]."""
    at = {side.index: number for number, side in enumerate(scene.sides)}
    time, numbers = scene.time, [at[side.index] for side in sides]
    change = sum(time.changes[a, b] for a, b in zip(numbers, numbers[1:], strict=False))
    farther = scene.drive.half_track * sum(turns)  # that the outer wheel drives
    return time.pace * (sum(lengths) + farther) + len(lengths) * time.begin + change


@pytest.mark.long
@pytest.mark.parametrize("com", [(0.0, 0.0), (0.01, 0.03)])
def test_no_random_plan_costs_less(robot, box, com):
    """One to four runs of random curvatures; the bound is not told what the plan costs."""
    random, scene = np.random.default_rng(3), open_scene(robot, replace(box, com=com))
    near = two = several = 0
    for _ in range(300):
        start = random.uniform([-1.0, -1.0, -np.pi], [1.0, 1.0, np.pi])
        pose, sides, lengths, turns, corners = start, [], [], [], []
        scale = random.choice([0.03, 0.4])  # short runs cost little more than their changes
        for _ in range(random.integers(1, 5)):
            corners.append(pose)
            others = [s for s in scene.sides if not sides or s is not sides[-1]]
            side = others[random.integers(len(others))]
            left, right = 1.0 / side.trusted.maximum, -1.0 / side.trusted.minimum
            robot_pose, length, turn = driven(side.robot_pose(pose), random, left, right, 1, scale)
            pose = se2.compose(robot_pose, side.grasp)
            sides.append(side)
            lengths.append(length)
            turns.append(turn)
        cost = costs_of(scene, sides, lengths, turns)
        bound = CostBound(scene, start, pose)
        before = bound.value
        for _ in bound.run(256):
            assert bound.value >= before, "it only rises"
            before = bound.value
        assert bound.value <= cost + 1e-9
        near += bound.value > 0.95 * cost
        if len(sides) == 1:
            assert bound.one <= cost + 1e-9
        if len(sides) > 2:
            assert bound.several <= cost + 1e-9
            several += bound.several > 0.93 * cost
        if len(sides) == 2:
            for width in (1e-9, 0.05, 0.5):  # boxes with the pose of this change of the side
                half, slack = width * random.uniform(0.0, [1.0, 1.5])
                middle = corners[1] + random.uniform(-1.0, 1.0, 3) * [half, half, slack]
                found = bound.of_boxes(np.array([[*middle, half, slack]]))[0]
                assert found <= cost + 1e-6
                two += found > 0.98 * cost
    assert near > 30 and two > 25 and several > 3


@pytest.mark.long
def test_the_bound_of_a_box_is_not_above_that_of_a_pose_in_it(robot, box):
    random, scene = np.random.default_rng(5), open_scene(robot, replace(box, com=(0.01, 0.03)))
    near = 0
    for _ in range(250):
        start, goal, middle = random.uniform([-1.0, -1.0, -np.pi], [1.0, 1.0, np.pi], (3, 3))
        half, slack = random.uniform(0.0, [random.choice([0.001, 0.2]), 0.3])
        within = random.choice([-1.0, 1.0, 0.3], (200, 3)) * [half, half, slack]
        poses = np.hstack([middle + within, np.zeros((200, 2))])
        bound = CostBound(scene, start, goal)
        of_poses = bound.of_boxes(poses).min()
        of_box = bound.of_boxes(np.array([[*middle, half, slack]]))[0]
        assert of_box <= of_poses + 1e-9
        near += of_box > 0.9 * of_poses
    assert near > 30


def test_the_centre_of_mass_moves_no_faster(robot, box):
    scene = open_scene(robot, replace(box, com=(0.01, 0.03)))
    bound = CostBound(scene, np.zeros(3), np.ones(3))
    for side, fastest in zip(scene.sides, bound.ends.fastest, strict=True):
        moved = []
        for kappa in np.linspace(side.trusted.minimum, side.trusted.maximum, 21):
            after = se2.compose(np.array([1e-6, 0.0, 1e-6 * kappa]), side.grasp)
            moved.append(np.hypot(*(after - side.grasp)[:2]) / 1e-6)
        assert fastest == pytest.approx(max(1.0, *moved), abs=1e-4)
    assert max(bound.ends.fastest) > 1.02


def test_it_holds_from_a_slot_with_less_room_than_the_safety_distance(robot, box):
    size, middle = 0.004, 150
    cells = np.zeros((300, 450), dtype=bool)
    cells[:, middle - 13 : middle + 6] = True
    cells[middle - 12 : middle + 12, middle - 13 : middle + 6] = False  # 3 mm at both sides
    settings = PlannerSettings()
    planner = PushPlanner(
        settings, OccupancyGrid(cells, size, np.full(2, -middle * size)), robot, box
    )
    start, goal = np.zeros(3), np.array([0.6, 0.1, 0.3])
    assert 0.0 < planner.scene.leaving(start) < 0.5 * settings.safety_distance
    plan = planner.solve(start, goal)
    bound = CostBound(planner.scene, start, goal)
    for _ in bound.run(1000):
        pass
    assert plan.cost_bound <= plan.cost and 0.5 * plan.cost < bound.value <= plan.cost


@pytest.mark.long
def test_it_is_near_the_best_plan_of_two_runs(robot, box):
    """Where no obstacle is near, and the pose in between is optimised."""
    random, scene = np.random.default_rng(4), open_scene(robot, box)
    dubins = Dubins(1.0 / scene.sides[0].trusted.maximum)
    gaps = []

    def run(a, b):
        return [dubins(a, b)], [abs(se2.wrap(b[2] - a[2]))]

    for _ in range(8):
        start, goal = (random.uniform([-0.8, -0.8, -np.pi], [0.8, 0.8, np.pi]) for _ in range(2))
        best = math.inf
        for a in scene.sides:
            begin = a.robot_pose(start)
            single = costs_of(scene, [a], *run(begin, a.robot_pose(goal)))
            best = min(best, single)
            for b in scene.sides:
                if a is b:
                    continue
                end = b.robot_pose(goal)

                def cost(pose, a=a, b=b, begin=begin, end=end):
                    there, on = run(begin, a.robot_pose(pose)), run(b.robot_pose(pose), end)
                    return costs_of(scene, [a, b], there[0] + on[0], there[1] + on[1])

                draws = random.uniform([-1.5, -1.5, -np.pi], [1.5, 1.5, np.pi], (150, 3))
                values = [cost(d) for d in draws]
                for k in np.argsort(values)[:2]:
                    found = minimize(cost, draws[k], method="Nelder-Mead", options={"maxfev": 250})
                    best = min(best, float(found.fun))
        bound = CostBound(scene, start, goal)
        for _ in bound.run(5000):
            pass
        assert bound.value <= best + 1e-9
        gaps.append(min(best, bound.several) / bound.value - 1.0)
    assert np.median(gaps) < 0.06 and max(gaps) < 0.25


def random_run(scene, random):
    """A run of random arcs among obstacles: side, start and end of the object, time [s]."""
    x0, x1, y0, y1 = scene.field.grid.extent
    needed = scene.settings.safety_distance
    pose = start = random.uniform([x0, y0, -np.pi], [x1, y1, np.pi])
    number = int(random.integers(len(scene.sides)))
    side, spent = scene.sides[number], 0.0
    for _ in range(random.integers(4, 12)):
        for bend in random.permutation([side.trusted.minimum, 0.0, side.trusted.maximum]):
            poses = [pose]
            for _ in range(15):
                robot = unicycle_step(side.robot_pose(poses[-1]), 0.02, 0.02 * bend, 1.0)
                poses.append(se2.compose(robot, side.grasp))
                if min(scene.object_clearance(poses[-1]), scene.robot_clearance(robot)) < needed:
                    break
            else:  # nothing is in the way of this arc
                pose = poses[-1]
                farther = scene.drive.half_track * abs(bend)
                spent += scene.time.pace * 0.3 * (1.0 + farther)
                break
    return number, start, pose, spent


@pytest.mark.parametrize("count", [60, pytest.param(600, marks=pytest.mark.long)])
def test_no_run_among_obstacles_takes_less_time(robot, box, count):
    random, ratios = np.random.default_rng(6), []
    for seed in range(count // 20):
        scene = PushPlanner(PlannerSettings(), rasterise(cluttered(seed)), robot, box).scene
        while len(ratios) < 20 * (seed + 1):
            side, start, goal, spent = random_run(scene, random)
            if spent == 0.0:
                continue
            ends = RunEnds.of(scene, start, goal)
            bounds = list(least_single_run(scene, ends, side, math.inf))
            assert bounds == sorted(bounds) and bounds[-1] <= spent + 1e-9
            ratios.append(bounds[-1] / spent)
    assert len(ratios) == count and np.median(ratios) > 0.8


def test_a_wall_across_the_way_raises_the_bound_of_one_run(robot, box):
    """An opening far aside; then none at all."""
    values = {"size": [3.0, 3.0], "resolution": 0.02}
    start, goal = np.array([-0.8, 0.0, 0.0]), np.array([0.8, 0.0, 0.0])
    found = []
    for length in (0.0, 2.2, 3.0):
        boxes = [{"centre": [0.0, -1.5 + 0.5 * length], "size": [0.05, length]}] if length else []
        grid = rasterise(from_mapping(EnvironmentSpec, values | {"boxes": boxes}, "room"))
        scene = PushPlanner(PlannerSettings(), grid, robot, box).scene
        ends = RunEnds.of(scene, start, goal)
        side = next(k for k, s in enumerate(scene.sides) if abs(s.contact.heading) < 0.1)
        *_, last = least_single_run(scene, ends, side, 60.0)
        found.append(last)
    free, aside, shut = found
    assert free < 1.6 * scene.time.pace + 1e-6 < 1.2 * free
    assert aside > 1.25 * free and shut == 60.0


@pytest.mark.parametrize("count", [100, pytest.param(2000, marks=pytest.mark.study)])
def test_boxes_in_which_something_can_stand_are_not_left_out(robot, box, count):
    """Against poses in them at which the side could be changed."""
    random, asked, finite = np.random.default_rng(7), 0, 0
    for seed in range(5):
        scene = PushPlanner(PlannerSettings(), rasterise(cluttered(seed)), robot, box).scene
        needed = scene.settings.safety_distance
        x0, x1, y0, y1 = scene.field.grid.extent
        while asked < count // 5 * (seed + 1):
            start, goal, pose = random.uniform([x0, y0, -np.pi], [x1, y1, np.pi], (3, 3))
            if scene.object_clearance(pose) < needed:
                continue
            rooms = [
                scene.has_room(s.robot_pose(pose), s)
                and scene.robot_clearance(s.robot_pose(pose)) >= needed
                for s in scene.sides
            ]
            if sum(rooms) < 2:
                continue
            asked += 1
            half, slack = random.uniform(0.0, [random.choice([0.005, 0.08]), 0.3])
            middle = pose + random.uniform(-1.0, 1.0, 3) * [half, half, slack]
            bound = CostBound(scene, start, goal)
            exact, wide = bound.of_boxes(np.array([[*pose, 0.0, 0.0], [*middle, half, slack]]))
            assert wide <= exact + 1e-9
            finite += np.isfinite(wide)
    assert asked == count and finite > 0.5 * count


def test_a_side_may_be_left_where_only_the_farther_place_behind_it_has_room(robot, box):
    """Two posts beside the robot where it would turn, had it backed off half as far."""
    planner = PushPlanner(PlannerSettings(), rasterise(EnvironmentSpec((3.0, 2.0))), robot, box)
    side = planner.scene.sides[0]
    near = planner.scene.backs(side)[1]
    pose, found = np.zeros(3), 0
    ends = se2.compose(pose, np.array([-0.6, 0.0, 0.0])), np.array([0.6, 0.4, 0.5])
    for gap in np.arange(0.056, 0.07, 0.002):
        posts = []
        for across in (-gap, gap):
            offset = np.array([-near, across + math.copysign(0.01, across), 0.0])
            posts.append(CircleSpec(tuple(se2.compose(side.robot_pose(pose), offset)[:2]), 0.01))
        grid = rasterise(EnvironmentSpec((3.0, 2.0), circles=tuple(posts), resolution=0.002))
        scene = PushPlanner(PlannerSettings(), grid, robot, box).scene
        contact = scene.sides[0].robot_pose(pose)
        there = se2.compose(contact, np.array([-near, 0.0, 0.0]))
        turning = robot.footprint_radius + 0.25 * scene.settings.safety_distance
        if not scene.has_room(contact, scene.sides[0]) or scene.field.at(*there[:2]) >= turning:
            continue
        found += 1
        within, free = (CostBound(s, *ends) for s in (scene, planner.scene))
        here = np.array([[*pose, 0.0, 0.0]])
        assert within.of_boxes(here)[0] == pytest.approx(free.of_boxes(here)[0], rel=0.02)
    assert found > 0


@pytest.mark.parametrize(("rooms", "count"), slice_and_study([(1, 2), (2, 4)], 1))
def test_no_search_finds_a_cheaper_plan(scenario, robot, box, rooms, count):
    """Final plans and an exhaustive search, in environment 1 and among clutter."""
    gaps = []
    worlds = [scenario.grid, *(rasterise(cluttered(k)) for k in range(rooms))]
    for world in worlds:
        planner = PushPlanner(PlannerSettings(), world, robot, box)
        for start, goal in problems(planner, count, 11):
            try:
                plan = planner.solve(start, goal)
            except PlanningFailed:
                continue
            bound = CostBound(planner.scene, *map(box.mass_pose, (start, goal)))
            for _ in bound.run(planner.settings.bound_boxes):
                pass
            assert bound.value <= plan.cost + 1e-9, "without being told what the plan costs"
            assert bound.value <= exhaustive(planner, start, goal, 1) + 1e-9
            assert planner.lower_bound(start, goal) <= plan.cost_bound <= plan.cost
            gaps.append(plan.cost / plan.cost_bound - 1.0)
    assert len(gaps) > 0.5 * count * len(worlds)
    if len(gaps) > 6:  # a median of fewer tells nothing
        assert np.median(gaps) < 0.2
