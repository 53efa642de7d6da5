"""What a group's job survives: frozen poses, robots that stand, beliefs and clocks that change."""

from dataclasses import replace

import numpy as np
import pytest

from grasp_opt.contact_outline import ContactOutline
from grasp_opt.group_job import GroupJob
from grasp_opt.group_method import GroupMethod
from grasp_opt.group_push import GroupPush
from grasp_opt.object_trajectory import screw
from grasp_opt.step_planner import NoStep, StepPlanner
from push_bringup.node_kinds import SECTIONS
from push_job.method import Arena, Certificate, Refusal, Seen, Task
from push_model.belief import POSES, Belief, Interval
from push_model.jobs import JobError, JobPhase
from push_model.occupancy import rasterise
from push_model.settings import SettingsError, from_mapping
from push_model.specs import EnvironmentSpec
from push_model.stick_certificate import ContactBelief
from push_scenario.bodies import load_object
from push_study.uncertainty import uncertainty
from tests.driving import GroupWorld, answer
from tests.grasp_opt.test_group_job import ITEM, ROBOT, ROOM, STARTS, Run

NAMES = ("a", "b", "c")
PLATE = load_object("plate_rectangle")
GRID = rasterise(EnvironmentSpec(size=(4.0, 3.0)))
AROUND = np.array([[-0.6, -0.3, 0.0], [-0.6, 0.3, 0.0], [-0.6, 0.0, 0.0]])
TOLD = Belief({"plate": PLATE}, dict.fromkeys(NAMES, ROBOT))
SEEN = Seen(1.0, np.zeros(3), dict(zip(NAMES, AROUND, strict=True)))


def method(grid=GRID):
    return GroupMethod(Arena(grid, dict.fromkeys(NAMES, ROBOT), "plate", PLATE))


def frozen(run, limit):
    """Go on with the poses of now, with fresh stamps. How far [m] the object and each robot move
    meanwhile, and how long [s] robots are commanded to move."""
    world = run.world
    item, robots = world.see()
    before, places = world.truth()
    end, driven = world.time + limit, 0.0
    while world.time < end and run.job.busy:
        twists = run.job.step(world.time, ITEM.mass_pose(item), robots)
        answer(run.job, run.planner)
        driven += 0.02 * bool(twists.any())
        world.step(twists)
    after, ends = world.truth()
    return np.hypot(*(after - before)[:2]), np.hypot(*(ends - places)[:, :2].T), driven


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("phase", [JobPhase.POSITIONING, JobPhase.APPROACH, JobPhase.PUSHING])
def test_frozen_poses_end_the_job_with_a_true_reason(phase, seed):
    """FAULTS 8: fresh stamps, old poses."""
    doubt = uncertainty("mild" if seed else "none")
    with GroupWorld(ROOM, ROBOT, STARTS, ITEM, np.zeros(3), doubt, seed, "planar") as world:
        run = Run(world)
        run.job.begin(np.array([0.9, 0.0, 0.0]))
        assert run.until(lambda: run.job.state is phase)
        since = world.time + (0.5 + seed if phase is not JobPhase.APPROACH else 0.3)
        assert run.until(lambda: world.time >= since) and run.job.state is phase
        object_moved, robots_moved, driven = frozen(run, 60.0)
        assert not run.job.busy and run.job.error is JobError.EXECUTION_FAILED, run.job.reason
        assert "frozen" in run.job.reason
        assert object_moved < 0.12 and driven < 4.0, (object_moved, robots_moved, driven)


def test_all_robots_that_are_switched_off_are_not_told_as_a_heavy_object():
    with GroupWorld(
        ROOM, ROBOT, STARTS, ITEM, np.zeros(3), uncertainty("none"), 1, "planar"
    ) as world:
        run = Run(world)
        run.job.begin(np.array([0.8, 0.0, 0.0]))
        world.kill(world.names)
        assert run.until(lambda: not run.job.busy, 20.0)
        assert run.job.error is JobError.EXECUTION_FAILED and "switched off" in run.job.reason


@pytest.mark.parametrize("stamp", [0.0, 50.0, 1000.0, 1.7e9])
def test_a_job_begins_whatever_the_clock_says(stamp):
    job = GroupJob(PLATE, ROBOT, 3)
    job.begin(np.array([0.5, 0.0, 0.0]))
    job.step(stamp, np.zeros(3), AROUND)
    assert job.state is JobPhase.PLANNING and job.replans == 0 and job.request is not None


def test_a_belief_that_comes_while_a_step_is_planned_is_tested_like_one_that_comes_later():
    """The plan is for a friction of 0.2, and 0.05 is believed when it comes."""
    slippery = replace(PLATE, contact_friction=0.05)
    exact = Interval.exact(0.0)
    believed = ContactBelief(Interval(0.05, 0.04, 0.06), exact, exact)
    expected = []
    for late in (False, True):
        job = GroupJob(PLATE, ROBOT, 3)
        job.begin(np.array([0.5, 0.25, 0.8]))
        job.step(0.0, np.zeros(3), AROUND)
        r = job.request
        assert r is not None
        plan = StepPlanner(GRID, PLATE, ROBOT).plan(
            r.pose, r.goal, r.robots, r.dead, np.zeros((0, 3)), r.fewest
        )
        if not late:
            job.believe(slippery, ROBOT, believed)
        job.planned(plan)
        if late:
            job.believe(slippery, ROBOT, believed)
        assert job.watch is not None
        expected.append(job.watch.ahead(0.0))
    assert expected[0] == expected[1] < 1.0


@pytest.mark.parametrize("first", range(1, 4))
def test_an_outline_that_begins_at_another_corner_is_the_same_outline(first):
    again = TOLD.updated({}, {"plate": np.roll(PLATE.outline, -first, axis=0)}).object("plate")
    ways = np.sort(
        ContactOutline(PLATE.geometry).nearest(np.array([[-0.2, 0.08], [-0.2, -0.08]]))[0]
    )
    push = GroupPush(PLATE, ROBOT, ways, screw(np.zeros(3), np.array([0.5, 0, 0]), 0.05, 0.05, 0.3))
    before = push.controller.places.copy()
    push.believe(again, ROBOT, np.zeros(2))
    assert np.allclose(push.controller.places, before, atol=1e-9)
    m = method()
    m.begin(Task((np.array([0.5, 0.0, 0.0]),)), TOLD)
    for k in range(3):
        m.step(replace(SEEN, time=1.0 + 0.02 * k), TOLD)
    plan = m.job.plan
    assert plan is not None
    places = ContactOutline(PLATE.geometry).at(plan.placement.way).points
    m.step(replace(SEEN, time=1.06), TOLD.updated({}, {"plate": again.outline}))
    assert m.job.plan is not None
    now = ContactOutline(again.geometry).at(m.job.plan.placement.way).points
    assert np.allclose(now, places, atol=1e-9)


def test_an_outline_with_a_dent_is_taken_as_its_hull():
    dent = np.insert(PLATE.outline, 1, 0.9 * PLATE.outline[:2].mean(axis=0), axis=0)
    m = method()
    m.begin(Task((np.array([0.5, 0.0, 0.0]),)), TOLD)
    m.step(SEEN, TOLD.updated({}, {"plate": dent}))
    outline = m.job._outline.shape.outline
    assert m.job._outline.shape.convex and len(outline) == len(PLATE.outline)
    told = TOLD.updated({}, {"plate": dent})
    for k in range(1, 4):
        m.step(replace(SEEN, time=1.0 + 0.02 * k), told)
    assert m.job.plan is not None and m.job.state is JobPhase.POSITIONING, m.job.reason
    points = m.job._outline.at(m.job.plan.placement.way).points
    assert np.allclose(points, m.job.plan.placement.contacts.points, atol=1e-9)


def test_a_goal_is_judged_with_what_is_believed_now():
    goal = Task((np.array([0.0, 1.5 - 0.18, 0.0]),))
    large = TOLD.updated({}, {"plate": 1.6 * PLATE.outline})
    assert isinstance(method().assess(goal, TOLD, SEEN), Certificate)
    verdict = method().assess(goal, large, SEEN)
    assert isinstance(verdict, Refusal) and verdict.code is JobError.GOAL_OCCUPIED


@pytest.mark.parametrize("mass", [0.3, 50.0])
def test_an_object_that_all_robots_together_cannot_move_is_refused(mass):
    """FAULTS 33."""
    told = TOLD.updated({("plate", "mass"): Interval.exact(mass)})
    verdict = method().assess(Task((np.array([0.5, 0.0, 0.0]),)), told, SEEN)
    if mass < 1.0:
        assert isinstance(verdict, Certificate) and 2 <= verdict.robots <= 5
    else:
        assert isinstance(verdict, Refusal) and verdict.code is JobError.TOO_HEAVY
        assert "3 robots have" in verdict.reason


def test_a_latency_that_nobody_tells_any_more_is_that_of_the_settings():
    m = method()
    m.begin(Task((np.array([0.5, 0.0, 0.0]),)), TOLD)
    own = m.job.pose_delay
    m.step(SEEN, TOLD.updated({(POSES, "latency"): Interval(0.08, 0.07, 0.09)}))
    assert m.job.pose_delay == 0.08
    m.step(replace(SEEN, time=1.02), TOLD)
    assert m.job.pose_delay == own


def test_a_goal_where_the_object_is_and_a_trajectory_that_stands_are_refused_in_words():
    planner = StepPlanner(GRID, PLATE, ROBOT)
    with pytest.raises(NoStep, match="at the goal already"):
        planner.plan(np.zeros(3), np.zeros(3), AROUND, (), np.zeros((0, 3)))
    still = Task(tuple(np.zeros((4, 3))), (0.0, 1.0, 2.0, 3.0))
    verdict = method().assess(still, TOLD, SEEN)
    assert isinstance(verdict, Refusal) and "does not move" in verdict.reason


def test_placements_have_no_settings_that_the_planner_chooses_itself():
    """FAULTS 29."""
    for name in ("least_margin", "only_pushing", "most_force"):
        with pytest.raises(SettingsError, match=name):
            from_mapping(SECTIONS["optimizer"]["placement"], {name: 0.5}, "optimizer")
