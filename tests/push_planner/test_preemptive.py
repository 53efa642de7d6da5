"""Plans that begin with a pre-emptive push, and plans round other bodies."""

import numpy as np
import pytest

from push_model import se2
from push_model.occupancy import rasterise
from push_model.specs import BoxSpec, EnvironmentSpec
from push_planner import (
    PlanError,
    PlannerSettings,
    PlanningFailed,
    PushPlanner,
    plan_after_preemptive_push,
    with_bodies,
)
from push_scenario.scenario import load_scenario
from tests.push_planner.preemptive_case import needs_preemptive_push

START = np.array([-0.45, 0.0, 0.0])


def last(work):
    return list(work)[-1].best


@pytest.mark.long
def test_the_pre_emptive_push_is_the_first_of_the_plan():
    planner, goal, _ = needs_preemptive_push(load_scenario("short"), START)
    reports = list(plan_after_preemptive_push(planner, START, goal, planner.settings.seed + 1))
    plan = reports[-1].best
    assert plan.segments[0].object_start == pytest.approx(START)
    assert plan.segments[-1].object_end == pytest.approx(goal)
    for before, after in zip(plan.segments, plan.segments[1:], strict=False):
        assert before.object_end == pytest.approx(after.object_start)
    settings, segments = planner.settings, plan.segments
    assert plan.length == pytest.approx(sum(s.length for s in segments))
    assert plan.cost == pytest.approx(planner.scene.time.of_plan(segments))
    if segments[0].side != segments[1].side:
        assert plan.cost >= plan.length / settings.push_speed + settings.contact_time
    assert plan.clearance == pytest.approx(min(s.clearance for s in segments))
    # the same object as long as the plan is the same: what is published is published once
    told = [r.best for r in reports if r.best is not None]
    assert len({id(p) for p in told}) == len({p.cost for p in told})


@pytest.mark.long
def test_equal_seeds_draw_equal_pushes():
    planner, goal, _ = needs_preemptive_push(load_scenario("short"), START)
    once, again = (last(plan_after_preemptive_push(planner, START, goal, 2)) for _ in range(2))
    assert np.array_equal(once.segments[0].trajectory.pose, again.segments[0].trajectory.pose)
    assert once.cost == again.cost


@pytest.mark.parametrize(
    ("start", "goal", "code"),
    [
        (START, [1.49, 0.0, 0.0], PlanError.GOAL_OCCUPIED),
        ([1.49, 0.0, 0.0], START, PlanError.START_OCCUPIED),
        (START, [9.0, 0.0, 0.0], PlanError.OUTSIDE_MAP),
    ],
)
def test_what_no_push_can_mend_keeps_its_code(robot, box, start, goal, code):
    scenario = load_scenario("short")
    planner = PushPlanner(PlannerSettings(), scenario.grid, robot, box)
    with pytest.raises(PlanningFailed) as failure:
        last(plan_after_preemptive_push(planner, np.array(start), np.array(goal), 1))
    assert failure.value.code is code


def test_the_number_of_pushes_tried_is_bounded(robot, box):
    """In a room with a wall across nothing helps; the last failure is told."""
    walled = EnvironmentSpec((3.0, 2.0), boxes=(BoxSpec((0.0, 0.0), (0.1, 2.0)),))
    for turning in (0, 2):
        limits = {"max_preemptive": 3, "max_turning": turning, "rrt_iterations": 50}
        planner = PushPlanner(PlannerSettings(**limits), rasterise(walled), robot, box)
        with pytest.raises(PlanningFailed) as failure:
            last(plan_after_preemptive_push(planner, START, np.array([0.8, 0.0, 0.0]), 1))
        assert failure.value.code is PlanError.NO_PUSH_SEQUENCE
        assert f"none of {3 + turning} pre-emptive pushes" in str(failure.value)


def test_cells_under_a_body_are_occupied_and_no_others(box):
    """250 random circles: every cell that a disc reaches into, no cell that it does not."""
    random = np.random.default_rng(6)
    grid = rasterise(EnvironmentSpec((2.0, 1.6), resolution=0.02))
    away = np.array([9.0, 9.0, 0.0])
    for _ in range(250):
        circle = np.array([*random.uniform([-1.2, -1.0], [1.2, 1.0]), random.uniform(0.0, 0.3)])
        marked = with_bodies(grid, circle[None], box.outline, away, 0.012)
        assert not (grid.occupied & ~marked.occupied).any()
        rows, columns = np.indices(grid.occupied.shape)
        low = np.stack([columns, rows], axis=-1) * grid.resolution + grid.origin
        nearest = np.clip(circle[:2], low, low + grid.resolution)
        apart = np.hypot(*np.moveaxis(nearest - circle[:2], -1, 0))
        assert marked.occupied[apart < circle[2] - 1e-9].all()
        assert not (marked.occupied & ~grid.occupied)[apart > circle[2] + 1e-9].any()


def test_a_plan_goes_round_a_body(robot, box):
    open_grid = rasterise(EnvironmentSpec((3.0, 2.0)))
    goal = np.array([0.6, 0.0, 0.0])
    body = np.array([[0.1, 0.0, 0.08]])
    grid = with_bodies(open_grid, body, box.outline, START, 0.012)
    plan = PushPlanner(PlannerSettings(), grid, robot, box).solve(START, goal)
    direct = PushPlanner(PlannerSettings(), open_grid, robot, box).solve(START, goal)
    assert plan.length > direct.length + 0.005
    for segment in plan.segments:
        for pose in segment.trajectory.pose:
            item = se2.compose(pose, segment.grasp)
            for body_points in (
                se2.transform(item, box.geometry.dense_outline(0.01)),
                se2.transform(pose, robot.outline),
            ):
                assert np.hypot(*(body_points - body[0, :2]).T).min() > 0.08


def test_a_body_next_to_the_object_does_not_shut_it_in(robot, box):
    """The circle about a body holds more than the body; where the object stands it stands."""
    open_grid = rasterise(EnvironmentSpec((3.0, 2.0)))
    neighbour = np.array([[-0.45, 0.095, 0.064]])  # another such box, 5 mm beside
    grid = with_bodies(open_grid, neighbour, box.outline, START, 0.012)
    assert grid.occupied.sum() > open_grid.occupied.sum()
    goal = np.array([0.3, -0.1, 0.0])
    plan = PushPlanner(PlannerSettings(), grid, robot, box).solve(START, goal)
    assert plan.segments[-1].object_end == pytest.approx(goal)
