"""The group with a chosen grasp, and the synchronised LTV-MPCs: what they take and refuse."""

import numpy as np
import pytest

from grasp_opt.object_trajectory import study_trajectories
from push_job.method import Arena, Certificate, Refusal, Seen, Task, method_spec
from push_model.belief import Belief
from push_model.jobs import JobError, JobPhase
from push_model.occupancy import rasterise
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from push_study import formation, given_grasp, synchronised
from push_study.given_grasp import task_along

ITEM, ROBOT = load_object("plate_hexagon"), load_robot("epuck_ring")
PATH = study_trajectories(0.05, 0.05)["polynomial-1"]
ROBOTS = {f"e{i}": ROBOT for i in range(3)}
BELIEF = Belief({"object": ITEM}, ROBOTS)


def made(name, **grasp):
    """The method with a grasp, and what it sees at the start."""
    spec = method_spec(name)
    settings = spec.settings({"grasp": grasp})
    grid = rasterise(EnvironmentSpec((4.0, 3.0), resolution=0.02))
    places = {n: np.array([-0.6, 0.3 * k - 0.3, 0.0]) for k, n in enumerate(ROBOTS)}
    seen = Seen(0.0, ITEM.geometric_pose(PATH.pose[0]), places)
    return spec.make(Arena(grid, ROBOTS, "object", ITEM, settings)), seen


def planned(method, seen):
    """Steps until the plan is made or refused; CPU time that it took [s]."""
    method.begin(task_along(PATH, ITEM), BELIEF)
    return sum(
        method.step(Seen(0.01 * k, seen.object, seen.robots), BELIEF).planning for k in range(5)
    )


@pytest.mark.parametrize("name", [given_grasp.NAME, synchronised.NAME])
def test_only_trajectories_are_taken_and_they_arrive_as_they_are(name):
    method, seen = made(name)
    goal = method.assess(Task((np.zeros(3),)), BELIEF, seen)
    assert isinstance(goal, Refusal) and goal.code is JobError.INVALID_GOAL
    assert isinstance(method.assess(task_along(PATH, ITEM), BELIEF, seen), Certificate)
    method.begin(task_along(PATH, ITEM), BELIEF)
    assert method.job.goal == pytest.approx(PATH.pose[-1])


def test_given_places_are_taken_and_the_choice_is_charged():
    for grasp in ({"choice": "given", "ways": [0.1, 0.3, 0.5]}, {"choice": "random", "seed": 2}):
        method, seen = made(given_grasp.NAME, **grasp)
        cost = planned(method, seen)
        chosen = method.plans.grasp
        assert cost > 0.0 and chosen is not None
        if "ways" in grasp:
            assert chosen.way.tolist() == grasp["ways"] and chosen.selection is None
        else:
            assert chosen.selection is not None and chosen.selection.margin >= 0.02 - 1e-9
        assert method.along(0.05) is None, "nobody pushes yet"


def test_a_grasp_that_cannot_be_is_told():
    method, seen = made(given_grasp.NAME, choice="given", ways=[0.1, 0.3])
    planned(method, seen)
    assert method.job.state is JobPhase.IDLE and method.job.error is JobError.PLANNING_FAILED
    assert "2 places are given for 3 robots" in method.job.reason


def test_a_formation_takes_a_trajectory_for_as_many_discs_as_it_has_places():
    disc = formation.pusher(0.05)
    robots = {f"d{i}": disc for i in range(2)}
    spec = method_spec(formation.NAME)
    grid = rasterise(EnvironmentSpec((4.0, 3.0), resolution=0.02))
    settings = spec.settings({"x": [-0.3, -0.3], "y": [-0.1, 0.1]})
    method = spec.make(Arena(grid, robots, "object", ITEM, settings))
    belief, task = Belief({"object": ITEM}, robots), task_along(PATH, ITEM)
    assert isinstance(method.assess(task, belief, None), Certificate)
    assert isinstance(method.assess(Task((np.zeros(3),)), belief, None), Refusal)
    method.begin(task, belief)
    start = PATH.pose[0]
    places = {n: np.array([*p, 0.0]) for n, p in zip(robots, method._places, strict=True)}
    told = method.step(Seen(1.0, ITEM.geometric_pose(start), places), belief)
    after = PATH.sample(0.02)
    assert all(len(c) == 3 for c in told.commands.values())
    assert told.commands["d0"][0] == pytest.approx((after[0] - start[0]) / 0.02, rel=0.1)
    assert told.commands["d0"][2] == pytest.approx((after[2] - start[2]) / 0.02)
