"""Plans through gaps 4 cm wider than the object, out of traps, through doors, among clutter."""

import numpy as np
import pytest

from benchmarks.plan import after_first_push, attempt, exhaustive
from benchmarks.plan_problems import problems_of
from push_model.occupancy import rasterise
from push_planner import PlannerSettings, PlanningFailed, PushPlanner
from tests.push_planner.first_version import SEED, SOLVED


def unsolved(kind, robot, box, count, seed):
    """The problems without a plan that an exhaustive search solves, how many can be solved, and how
    many have no plan even after a pre-emptive push."""
    missed, solvable, stuck = [], 0, 0
    for number, problem in enumerate(problems_of(kind, box, count, seed)):
        planner = PushPlanner(PlannerSettings(), rasterise(problem.world), robot, box)
        outcome = attempt(planner, problem.start, problem.goal)
        if outcome.costs:
            solvable += 1
            continue
        stuck += not after_first_push(planner, problem.start, problem.goal)
        if np.isfinite(exhaustive(planner, problem.start, problem.goal, seed)):
            solvable += 1
            missed.append((number, outcome.why))
    return missed, solvable, stuck


@pytest.mark.long
@pytest.mark.parametrize("kind", ["gap", "trap"])
def test_a_few_hard_problems_have_plans(robot, box, kind):
    """The first three of a kind that are known to be solvable."""
    for number, problem in enumerate(problems_of(kind, box, 3, 1)):
        planner = PushPlanner(PlannerSettings(), rasterise(problem.world), robot, box)
        plan = planner.solve(problem.start, problem.goal)
        assert plan.segments[0].object_start == pytest.approx(problem.start, abs=1e-9), number
        assert plan.segments[-1].object_end == pytest.approx(problem.goal, abs=1e-9), number
        assert plan.clearance >= planner.settings.safety_distance - 1e-9


@pytest.mark.study
@pytest.mark.parametrize(
    ("kind", "count", "part"),
    [("gap", 100, 0.95), ("trap", 80, 0.98), ("door", 60, 0.98), ("clutter", 60, 0.98)],
)
def test_what_an_exhaustive_search_solves_is_solved(robot, box, kind, count, part):
    """With a pre-emptive push, most of the starts beside walls, too."""
    missed, solvable, stuck = unsolved(kind, robot, box, count, 2)
    assert solvable > 0.7 * count
    assert len(missed) <= (1.0 - part) * solvable, missed
    assert stuck <= 0.07 * count


@pytest.mark.long
@pytest.mark.parametrize("number", [30, 43, 77])
def test_starts_beside_a_wall_have_plans_after_a_push_on_a_corner(robot, box, number):
    problem = list(problems_of("gap", box, number + 1, 2))[-1]
    planner = PushPlanner(PlannerSettings(), rasterise(problem.world), robot, box)
    with pytest.raises(PlanningFailed, match=r"pushes found to leave the start .* clear the space"):
        planner.solve(problem.start, problem.goal)
    assert after_first_push(planner, problem.start, problem.goal)


def lost(kind, robot, box, numbers):
    """Those of the numbered problems for which there is no plan, or one that passes too near."""
    problems = list(problems_of(kind, box, max(numbers) + 1, SEED))
    found = []
    for number in numbers:
        problem = problems[number]
        planner = PushPlanner(PlannerSettings(), rasterise(problem.world), robot, box)
        try:
            plan = planner.solve(problem.start, problem.goal)
        except PlanningFailed as error:
            found.append((number, str(error)))
            continue
        assert plan.segments[-1].object_end == pytest.approx(problem.goal, abs=1e-9), number
        if plan.clearance < planner.settings.safety_distance - 1e-9:
            found.append((number, plan.clearance))
    return found


@pytest.mark.long
@pytest.mark.parametrize("kind", SOLVED)
def test_a_few_problems_that_the_first_version_solved_are_solved(robot, box, kind):
    """Every twentieth."""
    assert not lost(kind, robot, box, SOLVED[kind][::20])


@pytest.mark.study
@pytest.mark.parametrize("kind", SOLVED)
def test_no_problem_that_the_first_version_solved_is_lost(robot, box, kind):
    assert not lost(kind, robot, box, SOLVED[kind])
