"""A problem that needs a pre-emptive push: looked for, with a planner that may try little."""

from dataclasses import replace

import numpy as np

from push_planner import (
    PlanError,
    PlannerSettings,
    PlanningFailed,
    PushPlanner,
    plan_after_preemptive_push,
)

GOALS = np.array([[-0.1, 0.5, 0.0], [-0.05, 0.5, 0.0], [-0.15, 0.3, 0.0], [0.1, 0.3, 0.0]])
LITTLE = {
    "rrt_iterations": 100,
    "clearance_levels": 1,
    "improvement_rounds": 0,
    "max_preemptive": 40,
}


def needs_preemptive_push(scenario, start):
    """Planner, goal and the changed settings: no direct plan, but one after a pre-emptive push."""
    robot, item = scenario.robot()[1], scenario.object()[1]
    for effort in (2, 3, 4, 6, 8, 12, 20, 40, 80):
        few = LITTLE | {"max_expansions": effort, "total_expansions": effort}
        planner = PushPlanner(replace(PlannerSettings(), **few), scenario.grid, robot, item)
        for goal in GOALS:
            try:
                planner.solve(start, goal)
                continue
            except PlanningFailed as error:
                if error.code is not PlanError.NO_PUSH_SEQUENCE:
                    continue
            try:
                for _ in plan_after_preemptive_push(
                    planner, start, goal, planner.settings.seed + 1
                ):
                    pass
            except PlanningFailed:
                continue
            return planner, goal, few
    raise AssertionError("no such problem was found")
