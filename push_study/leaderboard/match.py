"""One match: a method at a contest, with a seed, in the graph in lockstep."""

import time
from dataclasses import dataclass, fields, replace

import numpy as np

from push_bringup.systems import OUTLINE_ESTIMATOR
from push_job.method import Task, method_spec
from push_model.arrays import Array
from push_model.distance_field import DistanceField
from push_model.occupancy import rasterise
from push_scenario.bodies import load_robot
from push_scenario.scenario import Scenario
from push_study.experiments.swarm_outline import mistaken
from push_study.leaderboard.contests import STALLED, Contest, Problem, contest, straight
from push_study.leaderboard.entries import POSITIONS, entry_of
from push_study.leaderboard.entry import Entry
from push_study.pool import Row
from push_study.team_run import OBJECT, made_scenario, run_team
from push_study.uncertainty import uncertainty

_SLACK = 1.05  # of a tolerance, for methods only know noisy poses


@dataclass(frozen=True)
class Match:
    """scenario: name of the contest. method: name of the entry, or MODULE:ATTRIBUTE. source: of the
    files of an entry from outside, which changes when they do."""

    scenario: str
    seed: int
    out: str
    method: str
    world: str
    uncertainty: str
    source: str = ""


def play(match: Match) -> Row:
    """Run it; the measures of a row."""
    what, entry = contest(match.scenario), entry_of(match.method)
    problem = what.draw(match.seed)
    scenario = _scenario(match, what, entry, problem)
    began = time.process_time()
    outcome = run_team(
        entry.system,
        scenario,
        Task((problem.goal,)),
        uncertainty(match.uncertainty),
        match.seed,
        what.limit,
        world=match.world,
        mistake=_disc if entry.disc else None,
    )
    spent = time.process_time() - began
    away, turned = outcome.error
    reached = outcome.success and (what.kind == POSITIONS or not outcome.trace.obstacle_ticks)
    near = away <= _SLACK * what.tolerance[0] and turned <= _SLACK * what.tolerance[1]
    row: Row = {
        "scenario": match.scenario,
        "seed": match.seed,
        "method": match.method,
        "success": bool(reached and near),
        **outcome.row(),
        "cpu_s": spent,
    }
    if row["success"]:
        direct, (ways, *robots) = straight(problem), np.array(outcome.trace.ways).swapaxes(0, 1)
        row["lambda"] = outcome.charged * problem.robot.max_speed / direct
        row["path_ratio"] = _length(ways) / direct
        row["robot_path_m"] = float(np.mean([_length(r) for r in robots]))
        row["clearance_m"] = _clearance(problem, ways)
    elif outcome.success and not reached:
        row["reason"] = f"touched obstacles, in {outcome.trace.obstacle_ticks} ticks"
    elif outcome.success:
        row["reason"] = f"said it was done {1e3 * away:.0f} mm, {turned:.2f} rad off"
    return row


def _scenario(match: Match, what: Contest, entry: Entry, problem: Problem) -> Scenario:
    robot = load_robot(entry.robot) if entry.robot else problem.robot
    parameters = {k: dict(v) for k, v in entry.parameters.items()}
    spec = method_spec(entry.system)
    if what.kind == POSITIONS and spec is not None:
        rules = {
            "position_tolerance": what.tolerance[0],
            "orientation": False,
            "stalled": min(STALLED, what.limit),
            "seed": match.seed,
        }
        known = {f.name for f in fields(spec.sections[""])} if "" in spec.sections else set()
        own = {name: value for name, value in rules.items() if name in known}
        parameters[entry.system] = {**own, **parameters.get(entry.system, {})}
    return made_scenario(
        match.scenario,
        problem.environment,
        robot,
        problem.robots,
        problem.item,
        problem.start,
        parameters,
    )


def _disc(scenario: Scenario) -> Scenario:
    """The object is believed to be its circumscribed disc, and the estimator learns its outline."""
    item, start = scenario.objects[OBJECT]
    scenario = replace(scenario, objects={OBJECT: (mistaken(item, None), start)})
    return scenario.settings(OUTLINE_ESTIMATOR, enabled=True)


def _clearance(problem: Problem, ways: Array) -> float:
    """[m] least distance of the object's nominal outline from obstacles of the map, every
    ``TRACE`` seconds of its true poses ``(n, 3)``."""
    field = DistanceField(rasterise(problem.environment))
    return float(field.clearances(problem.item.outline, ways).min())


def _length(ways: Array) -> float:
    """[m] of the path of a body, sampled so coarsely that noise of the physics is no way."""
    steps = np.hypot(*np.diff(ways[::5, :2], axis=0).T)
    return float(steps.sum())
