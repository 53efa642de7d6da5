from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from push_model import CurvatureLimits, se2
from push_model.occupancy import rasterise
from push_model.specs import BoxSpec, CircleSpec, EnvironmentSpec
from push_planner import (
    DistanceField,
    NoRobotPath,
    PlanError,
    PlannerSettings,
    PlanningFailed,
    PushPlanner,
    plan_robot_path,
    preemptive_pushes,
    shortest_push_curve,
)
from push_planner.guide_path import guide_paths, path_cost, shortest_path
from push_planner.push_graph import PushGraph
from push_planner.push_reference import joined
from push_planner.rough_cost import guessed_length
from push_planner.shortest_chord import chord, shortest_chords
from push_scenario.scenario import load_scenario, scenario_names
from tests.samples import mostly_long

START, GOAL = np.array([-1.15, -0.7, 0.0]), np.array([1.3, 0.75, 0.0])


@pytest.fixture(scope="module")
def planner(scenario, robot, box):
    return PushPlanner(PlannerSettings(), scenario.grid, robot, box)


@pytest.fixture(scope="module")
def plan(planner):
    return planner.solve(START, GOAL)


def test_distance_field_against_geometry(scenario):
    field = DistanceField(scenario.grid)
    assert field.at(1.0, 0.0) == pytest.approx(0.5, abs=0.012)  # the right wall
    assert field.at(0.0, 0.0) == pytest.approx(0.18, abs=0.012)  # the passage's half width
    assert field.at(0.0, 0.5) == 0.0
    assert field.at(9.0, 9.0) == 0.0
    assert field.segment((-1.0, 0.0), (1.0, 0.0)) == pytest.approx(0.18, abs=0.012)


def test_plan_is_continuous_stable_and_free(plan, planner, scenario, box):
    assert plan.segments[0].object_start == pytest.approx(START)
    assert plan.segments[-1].object_end == pytest.approx(GOAL)
    exact = scenario.grid
    for before, after in zip(plan.segments, plan.segments[1:], strict=False):
        assert before.object_end == pytest.approx(after.object_start)
    for segment in plan.segments:
        side = planner.scene.sides[segment.side]
        assert segment.grasp == pytest.approx(side.grasp)
        assert segment.limits == side.nominal
        v, omega = segment.trajectory.twist[1:-1].T
        assert (omega <= (side.trusted.maximum + 1e-3) * v).all()
        assert (omega >= (side.trusted.minimum - 1e-3) * v).all()
        poses = segment.trajectory.pose
        assert se2.compose(poses[0], side.grasp)[:2] == pytest.approx(START[:2], abs=1e-6)
        # independent of the planner's own check: no cell under the object's corners or the robot
        for pose in poses:
            item = se2.compose(pose, side.grasp)
            for x, y in [*se2.transform(item, box.geometry.outline), pose[:2]]:
                column, row = ((np.array([x, y]) - exact.origin) / exact.resolution).astype(int)
                assert not exact.occupied[row, column]


def test_pushes_are_as_fast_as_wheels_and_settings_allow(plan, planner, robot):
    """Bends take the wheels to what their reserve leaves, and nothing exceeds push_speed."""
    settings, drive = planner.settings, robot.drive
    (segment,) = joined(plan.segments, drive, settings)
    assert segment.length / segment.trajectory.duration > 0.9 * settings.push_speed
    v, omega = segment.trajectory.twist.T
    wheel = np.abs(v) + drive.half_track * np.abs(omega)
    reserved = (1.0 - settings.wheel_reserve) * drive.max_speed
    assert wheel.max() <= reserved + 1e-9 and v.max() <= settings.push_speed
    rate = np.diff(v) / np.diff(segment.trajectory.time)
    assert np.abs(rate).max() <= 1.1 * settings.push_acceleration
    hasty = replace(settings, push_speed=2.0, easing=0.0)  # with tight bends
    fast = PushPlanner(hasty, planner.scene.field, robot, planner.scene.item)
    push, *_ = joined(fast.solve(START, GOAL).segments, drive, hasty)
    v, omega = push.trajectory.twist.T
    wheel = np.abs(v) + drive.half_track * np.abs(omega)
    assert np.sort(wheel)[len(wheel) // 2] == pytest.approx(reserved)
    assert v[np.abs(omega) > 1.0 * v].max() < v.max(), "slower where it turns"


def test_equal_seeds_give_equal_plans(planner, plan):
    again = planner.solve(START, GOAL)
    assert again.cost == plan.cost
    assert np.array_equal(again.segments[0].trajectory.pose, plan.segments[0].trajectory.pose)
    assert np.array_equal(again.guide.points, plan.guide.points)


def test_plans_only_get_better(planner):
    costs = [p.best.cost for p in planner.plan(START, np.array([0.9, -0.5, 1.0])) if p.best]
    *cheaper, final = costs
    assert cheaper and all(b <= a for a, b in zip(cheaper, cheaper[1:], strict=False))
    assert final <= (1.0 + planner.settings.easing) * cheaper[-1], "for wider bends"


@pytest.mark.parametrize("goal", [(0.9, -0.5, 1.0), (1.3, 0.75, np.pi / 2)])
def test_no_slice_after_the_first_plan_tries_many_pushes(planner, goal, monkeypatch):
    """Slices are done while a robot pushes."""
    tried, one = [0], PushGraph._try
    monkeypatch.setattr(
        PushGraph, "_try", lambda *args: (tried.__setitem__(0, tried[0] + 1), one(*args))[1]
    )
    counts = Counter()
    before = 0
    for progress in planner.plan(START, np.array(goal)):
        if progress.best is not None:
            assert tried[0] - before <= 30, progress.stage
            counts[progress.stage.split(",")[0]] += 1
        before = tried[0]
    assert tried[0] > 300 and min(counts["search over arcs"], counts["wider bends"]) > 20, counts


def test_change_of_side_where_one_push_cannot_do(robot, box):
    """Straight across without turning, on less way than an S would take: two sides in turn."""
    open_space = PushPlanner(PlannerSettings(), rasterise(EnvironmentSpec((3.0, 2.0))), robot, box)
    start, goal = np.array([-0.2, -0.4, 0.0]), np.array([0.2, 0.4, 0.0])
    plan = open_space.solve(start, goal)
    assert plan.segments[-1].object_end == pytest.approx(goal)
    assert len({s.side for s in plan.segments}) >= 2
    for before, after in zip(plan.segments, plan.segments[1:], strict=False):
        assert before.object_end == pytest.approx(after.object_start)


NINE = [n for n in scenario_names() if n.startswith("env")]


@pytest.mark.parametrize("name", mostly_long(NINE, 2))
def test_every_scenario_has_a_plan_that_later_ones_do_not_make_longer(name):
    scenario = load_scenario(name)
    planner = PushPlanner(
        PlannerSettings(), scenario.grid, scenario.robot()[1], scenario.object()[1]
    )
    start = next(iter(scenario.objects.values()))[1]
    plans = [p.best for p in planner.plan(start, scenario.goal) if p.best is not None]
    assert plans[-1].segments[-1].object_end == pytest.approx(scenario.goal)
    assert plans[-1].segments[0].object_start == pytest.approx(start)
    assert plans[-2].cost <= plans[0].cost
    assert plans[-1].cost <= (1.0 + planner.settings.easing) * plans[-2].cost, "for wider bends"


def test_a_waypoint_that_leads_nowhere_hides_no_other(planner):
    """Environment 1, second target: the pushes that end there from far off need a box that lies
    turned; Algorithm 2, which looks no further, ends without a plan."""
    plan = planner.solve(START, np.array([1.3, 0.75, np.pi / 2]))
    assert len(plan.segments) >= 2
    assert plan.statistics.curves_solved > plan.statistics.curves_feasible > len(plan.segments)


def test_a_waypoint_without_a_pose_ends_no_search(scenario, robot, box):
    """Without straight runs the waypoints next to start and goal are empty."""
    bare = PushPlanner(replace(PlannerSettings(), run_lengths=()), scenario.grid, robot, box)
    plan = bare.solve(START, GOAL)
    assert plan.segments[-1].object_end == pytest.approx(GOAL)


def test_pushes_that_are_ruled_out_unsolved_would_have_to_loop():
    """The quick test against the solver: what it rules out has no curve without a loop (but for one
    in a hundred, at the limit), and four in five that it lets pass have a curve."""
    random = np.random.default_rng(4)
    limits = CurvatureLimits(-1.6, 1.2)
    chords = shortest_chords(limits.minimum, limits.maximum)
    ruled_out = wrongly = passed = solved = 0
    for _ in range(1500):
        start = np.array([0.0, 0.0, random.uniform(-1.9, 1.9)])
        end = np.array([random.uniform(0.1, 1.5), 0.0, random.uniform(-1.9, 1.9)])
        guess = guessed_length(
            *start[:2],
            np.cos(start[2]),
            np.sin(start[2]),
            *end[:2],
            np.cos(end[2]),
            np.sin(end[2]),
            chords,
        )
        curve = shortest_push_curve(start, end, limits.minimum, limits.maximum)
        if np.isfinite(guess):
            passed += 1
            solved += curve is not None
        else:
            ruled_out += 1
            if curve is not None:
                wrongly += np.ptp(curve.sample(400)[1]) < np.pi
    assert ruled_out > 400 and passed > 100
    assert wrongly < 0.01 * ruled_out
    assert solved > 0.8 * passed


def test_the_shortest_chord_of_a_turn_against_arcs():
    """A turn by equal angles is an arc of the tightest circle, which a cubic nearly is; an S needs
    more; and a mirror image as much with the limits swapped."""
    table = shortest_chords(-1.0, 2.0)
    for angle in (0.2, 0.5, 0.9):
        half = np.tan(0.5 * angle)
        # chord 2 r sin(angle), r = 1 / 2 to the left and 1 to the right
        assert chord(table, half, half) == pytest.approx(np.sin(angle), rel=0.05)
        assert chord(table, -half, -half) == pytest.approx(2.0 * np.sin(angle), rel=0.05)
        assert chord(table, half, -half) > 1.5 * np.sin(angle)
        mirrored = chord(shortest_chords(-2.0, 1.0), -half, 0.5 * half)
        assert chord(table, half, -0.5 * half) == pytest.approx(mirrored, rel=1e-2)
    with pytest.raises(ValueError, match="enclose 0"):
        shortest_chords(0.5, 1.0)


@pytest.mark.parametrize(
    ("start", "goal", "code"),
    [
        (START, [0.0, 0.6, 0.0], PlanError.GOAL_OCCUPIED),
        ([0.0, 0.6, 0.0], GOAL, PlanError.START_OCCUPIED),
        (START, [5.0, 0.0, 0.0], PlanError.OUTSIDE_MAP),
        (START, [np.nan, 0.0, 0.0], PlanError.INVALID_GOAL),
    ],
)
def test_impossible_requests_are_refused_with_a_reason(planner, start, goal, code):
    with pytest.raises(PlanningFailed) as error:
        planner.solve(np.array(start), np.array(goal))
    assert error.value.code is code and len(str(error.value)) > 20


def test_walled_off_goal_has_no_guide_path(robot, box):
    walled = EnvironmentSpec((3.0, 2.0), boxes=(BoxSpec((0.0, 0.0), (0.1, 2.0)),))
    blocked = PushPlanner(
        replace(PlannerSettings(), rrt_iterations=300), rasterise(walled), robot, box
    )
    with pytest.raises(PlanningFailed) as error:
        blocked.solve(START, GOAL)
    assert error.value.code is PlanError.NO_GUIDE_PATH


def test_bottleneck_sweep_beats_the_shortest_path_by_2_1():
    """Two ways round an obstacle: the short one hugs the wall, (2.1) wants the wide one."""
    environment = EnvironmentSpec((3.0, 2.0), circles=(CircleSpec((0.0, -0.25), 0.5),))
    field = DistanceField(rasterise(environment))
    settings = replace(PlannerSettings(), clearance_weight=0.3, rrt_iterations=2000)
    start, goal = np.array([-1.0, -0.4]), np.array([1.0, -0.4])
    short = path_cost(field, shortest_path(field, start, goal, 0.05, 2000, 0.3, 1), settings)
    best = min(guide_paths(field, start, goal, 0.05, settings, 1), key=lambda g: g.cost)
    assert best.cost < 0.6 * short.cost
    assert best.clearance > 1.5 * short.clearance
    assert best.length >= short.length - 1e-6


def test_preemptive_pushes_are_free_sorted_and_stable(planner):
    offers = preemptive_pushes(planner, START, GOAL, 1)
    assert offers
    gaps = [np.hypot(*(s.object_end - GOAL)[:2]) for s in offers]
    assert gaps == sorted(gaps)
    assert all(s.clearance >= planner.settings.safety_distance for s in offers)


def test_robot_path_goes_round_the_object(planner, robot):
    circle = np.array([[0.5, 0.0, 0.2]])
    path = plan_robot_path(
        planner.scene.field,
        robot,
        planner.settings,
        np.array([0.2, 0.0, 0.0]),
        np.array([0.8, 0.0, 0.0]),
        circle,
    )
    assert path.pose[-1] == pytest.approx([0.8, 0.0, 0.0], abs=1e-6)
    kept = 0.2 + planner.settings.safety_distance
    assert np.hypot(path.pose[:, 0] - 0.5, path.pose[:, 1]).min() >= kept - 1e-6
    # it drives round in curves: between its first and its last turn it does not stop
    driving = np.flatnonzero(path.twist[:, 0])
    assert (path.twist[driving[0] : driving[-1], 0] != 0.0).all()
    assert np.abs(path.twist[:, 0] * path.twist[:, 1]).max() > 0.05


def test_no_robot_path_through_a_wall(robot):
    walled = EnvironmentSpec((3.0, 2.0), boxes=(BoxSpec((0.0, 0.0), (0.1, 2.0)),))
    with pytest.raises(NoRobotPath):
        plan_robot_path(
            DistanceField(rasterise(walled)),
            robot,
            PlannerSettings(),
            np.array([-1.0, 0, 0]),
            np.array([1.0, 0, 0]),
            np.zeros((0, 3)),
        )
