"""Whole jobs of groups in the planar world, and how they end when they cannot be done."""

import numpy as np
import pytest

from grasp_opt.group_job import GroupJob, GroupJobSettings
from grasp_opt.step_planner import StepPlanner
from push_model.jobs import JobError, JobPhase
from push_model.occupancy import rasterise
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from push_study.experiments import group_goals
from push_study.experiments.group_goals import GoalTask
from push_study.study import StudyOptions, run_study
from push_study.uncertainty import uncertainty
from tests.driving import GroupWorld, answer
from tests.samples import slice_and_study

ITEM, ROBOT = load_object("plate_ellipse"), load_robot("epuck_ring")
ROOM = EnvironmentSpec((4.0, 3.0), resolution=0.02)
STARTS = np.array([[-0.9, y, 0.0] for y in (-0.4, 0.0, 0.4)])


@pytest.mark.parametrize("scenario", group_goals.SCENARIOS)
@pytest.mark.parametrize("seed", slice_and_study([24, 26], 1))
def test_random_goals_are_reached_also_when_a_robot_dies(scenario, seed):
    robots = 4 if scenario == "dead" else 2 + seed % 4
    task = GoalTask(scenario, seed, "", robots, (0, 3, 4, 5, 6, 7, 8)[seed % 7], "planar", "mild")
    row = group_goals.trial(task)
    assert row["success"], row["reason"]
    assert row["position_error_m"] < 0.01 and row["orientation_error_rad"] < 0.05
    assert bool(row["killed"]) == (scenario == "dead") and row["replans"] <= 3
    if scenario != "dead":
        assert row["collision_ticks"] == 0


class Run:
    """A job in an empty room, and the world that it is in."""

    def __init__(self, world, count=3, **settings):
        self.world, self.job = world, GroupJob(ITEM, ROBOT, count, GroupJobSettings(**settings))
        self.planner = StepPlanner(rasterise(ROOM), ITEM, ROBOT)

    def until(self, condition, limit=200.0):
        end = self.world.time + limit
        while self.world.time < end and not condition():
            item, robots = self.world.see()
            twists = self.job.step(self.world.time, ITEM.mass_pose(item), robots)
            answer(self.job, self.planner)
            self.world.step(twists)
        return condition()


@pytest.fixture
def world():
    with GroupWorld(
        ROOM, ROBOT, STARTS, ITEM, np.zeros(3), uncertainty("none"), 1, "planar"
    ) as running:
        yield running


def test_a_goal_where_the_object_stands_needs_no_push(world):
    run = Run(world)
    run.job.begin(np.array([1e-3, 0.0, 0.0]))
    assert run.until(lambda: not run.job.busy, 5.0)
    assert run.job.error is JobError.NONE and run.job.pushes == 0


def test_all_but_one_dead_is_told_as_too_little_force(world):
    """They are tried again first: who was only held fast would go on."""
    run = Run(world)
    run.job.begin(np.array([0.8, 0.0, 0.0]))
    world.kill(world.names[:2])
    assert run.until(lambda: not run.job.busy)
    assert run.job.error in (JobError.TOO_HEAVY, JobError.EXECUTION_FAILED)
    assert set(run.job.dead) <= {0, 1} and run.job.replans >= 1
    assert np.hypot(*world.truth()[0][:2]) < 0.02


@pytest.mark.long
def test_a_dead_robot_that_would_have_to_turn_first_is_found_out(world):
    """On its way to a place, far from the object: it is left, and another one goes."""
    run = Run(world)
    world.kill(world.names[1:2])
    run.job.begin(np.array([0.0, 0.8, 0.0]))
    assert run.until(lambda: not run.job.busy)
    assert run.job.error is JobError.NONE and world.time < 120.0
    assert run.job.dead in ((), (1,))


def test_an_end_stops_all_robots_and_the_next_job_goes_on_from_there(world):
    run = Run(world)
    run.job.begin(np.array([0.0, 0.8, 0.0]))
    assert run.until(lambda: run.job.state is JobPhase.PUSHING and run.job.last.time > 4.0)
    run.job.end(JobError.CANCELED, "canceled")
    item, robots = world.see()
    assert not run.job.step(world.time, item, robots).any()
    assert run.job.state is JobPhase.IDLE and run.job.error is JobError.CANCELED
    run.job.begin(np.array([0.3, 0.5, 0.3]))
    assert run.until(lambda: not run.job.busy) and run.job.error is JobError.NONE


def test_a_step_that_fails_again_and_again_ends_the_job(world):
    run = Run(world, failures=1)
    run.job.begin(np.array([0.0, 0.8, 0.0]))
    for _ in range(2):
        assert run.until(lambda: run.job.state is JobPhase.PUSHING and run.job.last.time > 2.0)
        world.move(np.array([0.6, 0.0, 0.0]))
        run.until(lambda: run.job.state is not JobPhase.PUSHING, 5.0)
    assert run.job.error is JobError.EXECUTION_FAILED and "from its trajectory" in run.job.reason


def test_a_late_answer_changes_nothing():
    job = GroupJob(ITEM, ROBOT, 3)
    job.failed(JobError.PLANNING_FAILED, "nobody asked")
    assert job.error is JobError.NONE and not job.busy


@pytest.mark.long
def test_a_study_tells_what_was_reached(tmp_path, capsys):
    options = StudyOptions(("open",), 1, 23, tmp_path, world="planar", workers=1)
    summary = run_study("group-goals", options)
    assert summary["trials"][0]["success"]
    assert "open" in capsys.readouterr().out
