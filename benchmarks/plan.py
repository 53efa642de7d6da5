"""Plans: of the scenarios that ship with a goal, and of random problems, also among clutter.

What can be solved at all is what an exhaustive search solves: the same pushes and clearances, with
thousands of poses all over the map, others turned along every narrow place on it, many more pushes
out of the start and into the goal, and many times the effort. It is asked only where the planner
has no plan.

    python -m benchmarks.plan --problems 300 --worlds 6 --seed 1
"""

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter

from benchmarks.measure import Bound, at_least, at_most
from benchmarks.plan_problems import KINDS, problems_of
from push_model.occupancy import rasterise
from push_model.specs import BoxSpec, CircleSpec, EnvironmentSpec
from push_planner import PlannerSettings, PlanningFailed, PushPlanner
from push_planner.candidate_poses import Candidates, runs
from push_planner.preemptive import plan_after_preemptive_push
from push_planner.push_graph import PushGraph, SearchStatistics
from push_planner.push_search import PushSearch
from push_scenario.scenario import load_scenario, scenario_names

PROBLEMS, WORLDS, SEED = 110, 4, 1
_PER_WORLD = 25
_POSES, _SECOND, _EFFORT = 4000, 1000, 60000  # of an exhaustive search
_NARROW = 1000  # of its poses that lie along narrow places
_ANGLES = 90  # that are tried for each of those
_PER_KIND = 20
_LENGTHS = (0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0)
_BENDS = tuple(float(b) for b in np.linspace(-0.98, 0.98, 9))


@dataclass(frozen=True)
class Outcome:
    """Of one problem: CPU time [s] to the first plan and to the end, cost [s] of each plan."""

    start: np.ndarray
    goal: np.ndarray
    first: float
    final: float
    costs: tuple[float, ...]
    bound: float  # [s] lower bound of the cost of a plan
    why: str = ""


def problems(
    planner: PushPlanner, count: int, seed: int
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Random start and goal poses ``(3,)`` on the map at which the object keeps its clearance."""
    x0, x1, y0, y1 = planner.scene.field.grid.extent

    def draw(random: np.random.Generator) -> np.ndarray:
        while True:
            pose = random.uniform([x0, y0, -np.pi], [x1, y1, np.pi])
            centre = planner.scene.item.mass_pose(pose)
            if planner.scene.object_clearance(centre) >= planner.settings.safety_distance:
                return pose

    for number in range(count):
        random = np.random.default_rng([seed, number])
        yield draw(random), draw(random)


def attempt(planner: PushPlanner, start: np.ndarray, goal: np.ndarray) -> Outcome:
    """Plan, and record every intermediate plan."""
    bound = planner.lower_bound(start, goal)  # raised by the last plan
    began = time.thread_time()
    first, costs, best = np.inf, [], None
    why = ""
    try:
        for progress in planner.plan(start, goal):
            if progress.best is not None and progress.best is not best:
                best = progress.best
                first = min(first, time.thread_time() - began)
                bound = best.cost_bound
                if not costs or best.cost < costs[-1]:
                    costs.append(best.cost)
    except PlanningFailed as error:
        why = str(error)
    final = time.thread_time() - began
    return Outcome(start, goal, first, final, tuple(costs), bound, why)


def after_first_push(planner: PushPlanner, start: np.ndarray, goal: np.ndarray) -> bool:
    """Whether there is a plan after a pre-emptive push, which the supervisor tries next."""
    try:
        plans = plan_after_preemptive_push(planner, start, goal, SEED)
        return any(progress.best is not None for progress in plans)
    except PlanningFailed:
        return False


def exhaustive(planner: PushPlanner, start: np.ndarray, goal: np.ndarray, seed: int) -> float:
    """Cost [s] of the plan of an exhaustive search; inf if it finds none."""
    scene = planner.scene
    start, goal = scene.item.mass_pose(start), scene.item.mass_pose(goal)
    random = np.random.default_rng(seed)
    x0, x1, y0, y1 = scene.field.grid.extent
    anywhere = random.uniform([x0, y0, -np.pi], [x1, y1, np.pi], (_POSES, 3))
    candidates = Candidates(anywhere, np.zeros(_POSES))
    candidates += along_narrow_places(planner, random)
    for pose, direction in ((start, 1.0), (goal, -1.0)):
        near = runs(scene, pose, direction, 0.0, _LENGTHS, _BENDS).free(scene)
        candidates += near
        second = [runs(scene, p, direction, 0.0, _LENGTHS[2::2], _BENDS[::4]) for p in near.poses]
        if second:
            poses = np.vstack([s.poses for s in second])
            chosen = poses[random.permutation(len(poses))[:_SECOND]]
            candidates += Candidates(chosen, np.zeros(len(chosen)))
    graph = PushGraph(scene, start, goal, candidates.free(scene), np.inf)
    statistics = SearchStatistics()
    if graph.leave(statistics) == 0:
        return np.inf
    search = PushSearch(graph, np.inf, 1.5, _EFFORT)
    for _ in search.run(statistics):
        pass
    return search.cost


def along_narrow_places(planner: PushPlanner, random: np.random.Generator) -> Candidates:
    """Poses anywhere on the map where it is little wider than the object, on the ridge between
    obstacles, turned as the object has most clearance there and at the next centimetres."""
    scene = planner.scene
    field = scene.field
    least = scene.shape.inradius + scene.settings.safety_distance
    room = np.sqrt(field.values) * field.spacing
    ridge = room >= maximum_filter(room, 5) - 1e-9
    places = np.argwhere(ridge & (room >= least) & (room < 2.0 * scene.shape.circumradius))
    if not len(places):
        return Candidates(np.zeros((0, 3)), np.zeros(0))
    angles = np.linspace(-np.pi, np.pi, _ANGLES, endpoint=False)
    found = []
    for row, column in places[random.integers(len(places), size=_NARROW // 4)]:
        x, y = np.array([column, row]) * field.spacing + field.args[:2]
        worst = np.full(_ANGLES, np.inf)
        for step in (-0.06, -0.03, 0.0, 0.03, 0.06):
            ahead = step * np.column_stack([np.cos(angles), np.sin(angles)])
            poses = np.column_stack([np.array([x, y]) + ahead, angles])
            worst = np.minimum(worst, scene.object_clearances(poses))
        angle = float(angles[np.argmax(worst)])
        found += [(x, y, angle + quarter * np.pi / 2.0) for quarter in range(4)]
    return Candidates(np.array(found), np.zeros(len(found)))


def cluttered(seed: int) -> EnvironmentSpec:
    """A room of 3 m x 2 m with boxes and circles at random."""
    random = np.random.default_rng([seed, 7])
    boxes = tuple(
        BoxSpec(
            tuple(random.uniform([-1.3, -0.8], [1.3, 0.8])),
            tuple(random.uniform(0.08, 0.4, 2)),
            float(random.uniform(-np.pi, np.pi)),
        )
        for _ in range(4)
    )
    circles = tuple(
        CircleSpec(
            tuple(random.uniform([-1.3, -0.8], [1.3, 0.8])), float(random.uniform(0.05, 0.18))
        )
        for _ in range(4)
    )
    return EnvironmentSpec((3.0, 2.0), boxes=boxes, circles=circles)


def study(name: str, planner: PushPlanner, count: int, seed: int) -> dict[str, Any]:
    """Random problems on one map; ``first`` and ``final`` [s] are those of each solved one."""
    outcomes = [attempt(planner, s, g) for s, g in problems(planner, count, seed)]
    solved = [o for o in outcomes if o.costs]
    result: dict[str, Any] = {"seed": seed, "problems": count, "solved": len(solved)}
    first, final = (np.array([getattr(o, k) for o in solved]) for k in ("first", "final"))
    worse = sum(any(b > a for a, b in zip(o.costs, o.costs[1:], strict=False)) for o in solved)
    assert solved, f"{name}: none of {count} problems solved"
    last = np.array([o.costs[-1] for o in solved])
    gap = last / np.array([o.bound for o in solved]) - 1.0
    saved = 1.0 - last / np.array([o.costs[0] for o in solved])
    result |= {
        "first_s": {q: float(np.quantile(first, q)) for q in (0.5, 0.95, 1.0)},
        "final_s": {q: float(np.quantile(final, q)) for q in (0.5, 0.99, 1.0)},
        "failure_s": max((o.final for o in outcomes if not o.costs), default=0.0),
        "cost_s": float(last.mean()),
        "gap_median": float(np.median(gap)),
        "saved_mean": float(saved.mean()),
        "worse": worse,
    }
    print(
        f"  {name}, seed {seed}: {len(solved)} of {count} solved; "
        f"first plan median {np.median(first):.3f} s, 95 % {np.quantile(first, 0.95):.3f} s, "
        f"most {first.max():.3f} s; final median {np.median(final):.3f} s, "
        f"99 % {np.quantile(final, 0.99):.3f} s, most {final.max():.3f} s; "
        f"a failure at most {result['failure_s']:.3f} s\n"
        f"  {name}: cost {last.mean():.2f} s on average, {100 * saved.mean():.1f} % less than the "
        f"first plan's; {100 * np.median(gap):.0f} % (median) above the lower bound",
        flush=True,
    )
    missed = []
    for number, outcome in enumerate(outcomes):
        if not outcome.costs:
            cost = exhaustive(planner, outcome.start, outcome.goal, seed)
            found = "none either" if np.isinf(cost) else f"{cost:.2f} s"
            print(f"    {name} {number}: {outcome.why}; exhaustive search: {found}", flush=True)
            if np.isfinite(cost):
                missed.append(number)
    solvable = len(solved) + len(missed)
    result |= {"solvable": solvable, "missed": missed, "first": first, "final": final}
    print(f"  {name}: {solvable} of {count} can be solved", flush=True)
    return result


def kind_study(kind: str, count: int, seed: int) -> dict[str, Any]:
    """Random problems of a kind, a map each; those without a plan go to the exhaustive search."""
    scenario = load_scenario("env1-target1")
    robot, item = scenario.robot()[1], scenario.object()[1]
    outcomes, missed, freed = [], [], 0
    for number, problem in enumerate(problems_of(kind, item, count, seed)):
        planner = PushPlanner(PlannerSettings(), rasterise(problem.world), robot, item)
        outcome = attempt(planner, problem.start, problem.goal)
        outcomes.append(outcome)
        if not outcome.costs:
            cost = exhaustive(planner, problem.start, problem.goal, seed)
            freed += after_first_push(planner, problem.start, problem.goal)
            print(
                f"    {kind} {number}: {outcome.why}; exhaustive search: {cost:.2f} s", flush=True
            )
            if np.isfinite(cost):
                missed.append(number)
    solved = [o for o in outcomes if o.costs]
    first, final = (np.array([getattr(o, k) for o in solved]) for k in ("first", "final"))
    print(
        f"  {kind}, seed {seed}: {len(solved)} of {len(solved) + len(missed)} that can be solved, "
        f"of {count}, and {freed} more with a pre-emptive push; first plan median "
        f"{np.median(first):.3f} s, most {first.max():.3f} s; final most {final.max():.3f} s",
        flush=True,
    )
    return {
        "seed": seed,
        "problems": count,
        "solved": len(solved),
        "solvable": len(solved) + len(missed),
        "missed": missed,
        "with_preemptive_push": len(solved) + freed,
        "worse": sum(
            any(b > a for a, b in zip(o.costs, o.costs[1:], strict=False)) for o in solved
        ),
        "first": first,
        "final": final,
    }


def judged(name: str, studies: Sequence[dict[str, Any]]) -> dict[str, Bound]:
    """Bounds on all problems of some studies together: 25 are too few to tell 98 % from 95 %."""
    first, final = (np.concatenate([s.pop(key) for s in studies]) for key in ("first", "final"))
    solvable = sum(s["solvable"] for s in studies)
    return {
        f"{name}: solved, of what can be": at_least(len(first) / solvable, 0.98),
        f"{name}: first plan within 0.5 s": at_least(float((first <= 0.5).mean()), 0.95),
        f"{name}: final plan within 2 s": at_least(float((final <= 2.0).mean()), 0.99),
        f"{name}: plans worse than an earlier one": at_most(sum(s["worse"] for s in studies), 0.0),
    }


def scenarios() -> tuple[dict[str, Any], dict[str, Bound]]:
    """Every scenario of an environment that ships with a goal."""
    result: dict[str, Any] = {}
    bounds: dict[str, Bound] = {}
    for name in [n for n in scenario_names() if n.startswith("env")]:
        scenario = load_scenario(name)
        planner = PushPlanner(
            PlannerSettings(), scenario.grid, scenario.robot()[1], scenario.object()[1]
        )
        start = next(iter(scenario.objects.values()))[1]
        attempt(planner, start, scenario.goal)  # load the compiled code
        outcome = attempt(planner, start, scenario.goal)
        if not outcome.costs:
            print(f"  {name}: no plan: {outcome.why}")
            bounds[f"{name}: scenarios without a plan"] = at_most(1.0, 0.0)
            continue
        first, final = outcome.costs[0], outcome.costs[-1]
        print(
            f"  {name}: first {outcome.first:.3f} s, {first:.2f} s; "
            f"final {outcome.final:.3f} s, {final:.2f} s; at least {outcome.bound:.2f} s"
        )
        result[name] = {
            "first_s": outcome.first,
            "final_s": outcome.final,
            "first_m": first,
            "final_m": final,
        }
        bounds[f"{name}: first plan [s]"] = at_most(outcome.first, 0.5)
        bounds[f"{name}: final plan [s]"] = at_most(outcome.final, 2.0)
        bounds[f"{name}: final over first cost"] = at_most(final / first, 1.0)
    return result, bounds


def run(count: int = PROBLEMS, worlds: int = WORLDS, seed: int = SEED) -> dict[str, Any]:
    """CPU time to plans in a warm process, and the fraction of solved problems."""
    result, bounds = scenarios()
    scenario = load_scenario("env1-target1")
    robot, item = scenario.robot()[1], scenario.object()[1]
    planner = PushPlanner(PlannerSettings(), scenario.grid, robot, item)
    result["env1"] = study("env1", planner, count, seed)
    bounds |= judged("env1", [result["env1"]])
    clutter = []
    for number in range(worlds):
        world = rasterise(cluttered(seed + number))
        planner = PushPlanner(PlannerSettings(), world, robot, item)
        name = f"clutter {number + 1}"
        result[name] = study(name, planner, _PER_WORLD, seed + number)
        clutter.append(result[name])
    bounds |= judged("clutter", clutter) if clutter else {}
    for kind in KINDS:
        result[kind] = kind_study(kind, _PER_KIND, seed)
        bounds |= judged(kind, [result[kind]])
    result["bounds"] = bounds
    return result


def _main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--problems", type=int, default=PROBLEMS, help="random ones in env1")
    parser.add_argument("--worlds", type=int, default=WORLDS, help="of clutter")
    parser.add_argument("--seed", type=int, default=SEED)
    arguments = parser.parse_args()
    bounds = run(arguments.problems, arguments.worlds, arguments.seed)["bounds"]
    for bound, (value, limit, holds) in bounds.items():
        print(f"  {'ok  ' if holds else 'FAIL'} {bound}: {value:.4g} (bound {limit})")
    return 0 if all(holds for _, _, holds in bounds.values()) else 1


if __name__ == "__main__":
    raise SystemExit(_main())
