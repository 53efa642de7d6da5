"""Time to the first and to the final plan of every scenario that ships with a goal."""

import time
from typing import Any

from benchmarks.measure import at_most
from push_planner import PlannerSettings, PlanningFailed, PushPlanner
from push_scenario.scenario import load_scenario, scenario_names


def run() -> dict[str, Any]:
    """Wall time to plans in a warm process."""
    result: dict[str, Any] = {}
    bounds = {}
    for name in [n for n in scenario_names() if n.startswith("env")]:
        scenario = load_scenario(name)
        planner = PushPlanner(
            PlannerSettings(), scenario.grid, scenario.robot()[1], scenario.object()[1]
        )
        start = next(iter(scenario.objects.values()))[1]
        try:
            planner.solve(start, scenario.goal)
            started = time.perf_counter()
            first = first_cost = None
            best = None
            for progress in planner.plan(start, scenario.goal):
                best = progress.best
                if best is not None and first is None:
                    first, first_cost = time.perf_counter() - started, best.cost
            final = time.perf_counter() - started
        except PlanningFailed as error:
            print(f"  {name}: no plan: {error}")
            bounds[f"{name}: scenarios without a plan"] = at_most(1.0, 0.0)
            continue
        print(
            f"  {name}: first {first:.3f} s, {first_cost:.3f} m; final {final:.3f} s, "
            f"{best.cost:.3f} m; {len(best.segments)} pushes"
        )
        result[name] = {
            "first_s": first,
            "final_s": final,
            "first_m": first_cost,
            "final_m": best.cost,
        }
        bounds[f"{name}: first plan [s]"] = at_most(first, 0.5)
        bounds[f"{name}: final plan [s]"] = at_most(final, 2.0)
        bounds[f"{name}: final over first cost"] = at_most(best.cost / first_cost, 1.0)
    result["bounds"] = bounds
    return result
