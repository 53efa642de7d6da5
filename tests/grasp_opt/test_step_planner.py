"""What a group does next: places, who goes where, and what is refused."""

import math

import numpy as np
import pytest

from grasp_opt.moves import Mover, MoveSettings, back_off
from grasp_opt.object_trajectory import screw
from grasp_opt.sequencing import NoStep, Sequencer
from grasp_opt.slices import finish
from grasp_opt.step_planner import StepPlanner, TooFew
from grasp_opt.step_settings import StepSettings
from push_model import se2
from push_model.free_space import FreeSpace, Obstacles
from push_model.occupancy import OccupancyGrid, rasterise
from push_model.outlines import distance, inside
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from push_study.experiments.group_goals import GoalTask, plate, problem

ROBOT = load_robot("epuck_ring")
RADIUS = ROBOT.footprint_radius
OPEN = rasterise(EnvironmentSpec((4.0, 3.0), resolution=0.02))
NOBODY = np.zeros((0, 3))
ROW = np.array([[-1.5, y, 0.0] for y in (-0.6, -0.3, 0.0, 0.3, 0.6)])


def drive(batches, robots, watch, limit=300.0):
    """Robots that do as they are told; ``watch`` sees all poses 50 times a second."""
    mover, robots, time = Mover(batches, ROBOT.differential), robots.copy(), 0.0
    while not mover.done and time < limit:
        for robot, (v, omega) in zip(robots, mover.step(robots), strict=True):
            robot += 0.02 * np.array([v * math.cos(robot[2]), v * math.sin(robot[2]), omega])
        watch(robots)
        time += 0.02
    assert mover.done
    return robots


@pytest.mark.long
@pytest.mark.parametrize("scenario", ["open", "obstacles"])
def test_robots_come_to_their_places_without_touching_anything(scenario):
    """Random worlds, plates and numbers of robots; the moves driven as they are told."""
    for seed in (0, 1, 3, 6):
        task = GoalTask(scenario, seed, "", 2 + seed % 4, (0, 4, 5, 6, 7, 8, 3)[seed % 7], "", "")
        p = problem(task)
        planner = StepPlanner(rasterise(p.environment), p.item, ROBOT)
        try:
            plan = planner.plan(p.start, p.goal, p.robots, (), NOBODY)
        except NoStep:
            assert task.sides == 3 and task.robots < 4  # some it cannot hold from there
            continue
        outline = se2.transform(p.start, p.item.geometry.outline)
        circles = np.array([[*c.centre, c.radius] for c in p.environment.circles]).reshape(-1, 3)

        def watch(robots, outline=outline, circles=circles):
            gaps = np.hypot(*(robots[:, None, :2] - robots[None, :, :2]).transpose(2, 0, 1))
            assert gaps[np.triu_indices(len(robots), 1)].min() > 2.0 * RADIUS
            away = np.where(inside(outline, robots[:, :2]), 0.0, distance(outline, robots[:, :2]))
            assert away.min() > RADIUS
            for x, y, radius in circles:
                assert np.hypot(robots[:, 0] - x, robots[:, 1] - y).min() > radius + RADIUS

        ended = drive(plan.batches, p.robots, watch)
        centres = se2.transform(p.start, plan.placement.contacts.centres(RADIUS))
        away = np.hypot(*(ended[list(plan.pushers), :2] - centres).T)
        assert (away < 4.0 * StepSettings().standoff + 5e-3).all()  # farther, the more slanting
        ahead = np.column_stack([np.cos(ended[:, 2]), np.sin(ended[:, 2])])[list(plan.pushers)]
        normals = plan.placement.contacts.normals @ se2.rotation_matrix(p.start[2]).T
        assert ((ahead * normals).sum(axis=1) > 0.0).all()
        assert plan.placement.margin >= 0.0 and len(set(plan.pushers)) == len(plan.pushers)
        assert np.linalg.norm(plan.placement.forces, axis=2).max() <= planner.force + 1e-9


def test_the_fewest_robots_that_hold_it_well_enough_push():
    planner = StepPlanner(OPEN, load_object("plate_ellipse"), ROBOT)
    plan = planner.plan(np.zeros(3), np.array([0.0, 0.8, 0.0]), ROW, (), NOBODY)
    assert len(plan.pushers) == 2 and plan.placement.margin >= StepSettings().margin - 1e-9


def test_too_few_robots_are_told_what_is_missing():
    planner = StepPlanner(OPEN, load_object("plate_ellipse"), ROBOT)
    with pytest.raises(TooFew, match=r"needs 1\.77 N, 1 robots of 1\.\d+ N have"):
        planner.plan(np.zeros(3), np.array([0.0, 0.8, 0.0]), ROW[:2], (1,), NOBODY)


def test_the_dead_do_not_push_and_are_gone_round():
    planner = StepPlanner(OPEN, load_object("plate_ellipse"), ROBOT)
    robots = np.vstack([[-0.32, 0.0, 0.0], ROW[:3]])  # the first one stands beside the object
    plan = planner.plan(np.zeros(3), np.array([0.9, 0.0, 0.0]), robots, (0,), NOBODY)
    assert 0 not in plan.pushers and all(m.robot != 0 for b in plan.batches for m in b)

    def watch(moved):
        assert np.hypot(*(moved[1:, :2] - robots[0, :2]).T).min() > 2.0 * RADIUS

    drive(plan.batches, robots, watch)
    for pose in plan.trajectory.pose[::20]:
        centres = se2.transform(pose, plan.placement.contacts.centres(RADIUS))
        assert np.hypot(*(centres - robots[0, :2]).T).min() > 2.0 * RADIUS


def test_who_does_not_push_goes_out_of_the_way():
    planner = StepPlanner(OPEN, load_object("plate_ellipse"), ROBOT)
    robots = np.vstack([ROW[:2], [0.0, 0.6, 0.0]])  # the third one stands on the object's way
    plan = planner.plan(np.zeros(3), np.array([0.0, 1.0, 0.0]), robots, (), NOBODY)
    ended = drive(plan.batches, robots, lambda poses: None)
    idle = [i for i in range(3) if i not in plan.pushers]
    for pose in plan.trajectory.pose[::10]:
        outline = se2.transform(pose, load_object("plate_ellipse").geometry.outline)
        for i in idle:
            assert distance(outline, ended[i, None, :2])[0] > RADIUS


@pytest.mark.long
def test_trajectories_that_cannot_be_pushed_are_refused():
    """A turn on the spot by two robots on a triangle, which have no couple; a way into a wall."""
    planner = StepPlanner(OPEN, plate(3), ROBOT)
    turn = screw(np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.05, 0.05, 0.2)
    with pytest.raises(NoStep, match="no placement of 2 robots supports the task"):
        planner.along(turn, np.zeros(3), ROW[:2], (), NOBODY)
    assert len(planner.along(turn, np.zeros(3), ROW, (), NOBODY).pushers) >= 3
    ahead = screw(np.zeros(3), np.array([2.0, 0.0, 0.0]), 0.05, 0.05, 0.2)
    with pytest.raises(NoStep, match="too close to an obstacle"):
        planner.along(ahead, np.zeros(3), ROW, (), NOBODY)


def test_backing_off_ends_where_there_is_room_and_never_runs_into_others():
    settings = MoveSettings()
    robots = np.array([[0.0, 0.0, 0.0], [-0.105, 0.0, 0.0], [0.0, 0.5, math.pi]])
    gaps, ahead = np.array([0.0, 0.2, 0.001]), np.array([1.0, 1.0, -1.0])
    twists = back_off(robots, gaps, ahead, [0, 1, 2], 2.0 * RADIUS + 4e-3, settings)
    assert twists[0, 0] == 0.0, "somebody stands behind it"
    assert twists[1, 0] == 0.0, "it is far enough"
    assert twists[2, 0] == settings.back_speed, "its back is to the object: ahead is away"
    free = back_off(robots[[0, 2]], gaps[[0, 2]], ahead[[0, 2]], [0], 0.104, settings)
    assert free[0, 0] == -settings.back_speed and not free[1].any()


def test_who_stands_in_the_way_and_cannot_leave_is_not_run_over():
    """In a cell of its own; beside it the object passes, or goes through."""
    occupied = np.zeros((150, 200), dtype=bool)
    occupied[60:90, 80:120] = True
    occupied[65:85, 85:115] = False  # 60 cm by 40 cm, walled
    space = FreeSpace(OccupancyGrid(occupied, 0.02, np.array([-2.0, -1.5])))
    outline = plate(6).geometry.outline
    for middle, passes in ((0.0, False), (0.27, True), (1.5, True)):
        sequencer = Sequencer(space, RADIUS, 0.01, 0.05, Obstacles(), np.zeros((1, 3)), [0])
        moved = [outline + [0.0, middle]]
        if passes:
            finish(sequencer.clear((), moved, np.array([[1.0, 1.0]])))
            assert sequencer.batches() == ()
        else:
            with pytest.raises(NoStep, match="stands in the way and cannot leave"):
                finish(sequencer.clear((), moved, np.array([[1.0, 1.0]])))


@pytest.mark.long
def test_robots_stop_side_by_side_before_they_come_to_the_object():
    """As far apart as at their places, less a tenth, whatever their contacts slant: from there they
    go on together, and one that stood nearer would be run into from behind."""
    gap = StepSettings().gap
    for seed in range(18):
        p = problem(GoalTask("open", seed, "", 3 + seed % 3, (0, *range(3, 9))[seed % 7], "", ""))
        planner = StepPlanner(rasterise(p.environment), p.item, load_robot("epuck_ring"))
        plan = planner.plan(p.start, p.goal, p.robots, (), np.zeros((0, 3)), 3)
        stops = {move.robot: move.points[-1] for batch in plan.batches for move in batch}
        there = np.array([stops[robot] for robot in plan.pushers])
        away = np.hypot(*(there[:, None] - there).transpose(2, 0, 1))
        radius = load_robot("epuck_ring").footprint_radius
        assert away[np.triu_indices(len(there), 1)].min() > 2.0 * radius + 0.9 * gap, seed
