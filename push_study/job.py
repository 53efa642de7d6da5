"""One job of one robot in lockstep, and what it amounts to."""

import hashlib
from collections.abc import Callable, Mapping
from pathlib import Path

from push_model.settings import SettingsError
from push_planner import DistanceField, PlannerSettings, PushScene
from push_scenario.scenario import Scenario
from push_study.graph_run import LockstepRun
from push_study.job_time import job_times
from push_study.observer import Trace, final_errors
from push_study.pool import Row

SUCCESS_POSITION = 0.02
"""[m] of the object at the end."""
SUCCESS_ORIENTATION = 0.1
"""[rad]."""


def digest(scenario: Scenario) -> str:
    """Of a scenario's text, for tasks: a changed scenario is another task."""
    return hashlib.sha256(scenario.text.encode()).hexdigest()[:16]


def check_goal(scenario: Scenario) -> None:
    """Raise SettingsError for a scenario without a goal, or with several: a job has one."""
    if scenario.goal is None:
        raise SettingsError(f"scenario '{scenario.name}' has no goal")
    if len(scenario.goals) > 1:
        raise SettingsError(
            f"scenario '{scenario.name}' has {len(scenario.goals)} goals; this study takes one"
        )


def min_clearance(scenario: Scenario, trace: Trace) -> float:
    """[m] least clearance of robot and object over a run, from ground truth, every 0.1 s."""
    _, robot = scenario.robot()
    _, item = scenario.object()
    scene = PushScene(DistanceField(scenario.grid), robot, item, PlannerSettings())
    least = min(
        (
            min(scene.robot_clearance(r), scene.object_clearance(o))
            for r, o in zip(trace.robot[::10], trace.object[::10], strict=False)
        ),
        default=float("nan"),
    )
    return float(least)


def run_job(
    believed: Scenario,
    world: Scenario,
    meanwhile: Callable[[LockstepRun], None] | None = None,
    record: Path | None = None,
    about: Mapping[str, str] | None = None,
) -> tuple[Row, Trace]:
    """Bring the object to the scenario's goal once; measures, and what was seen.

    Parameters
    ----------
    believed, world, record, about: see ``LockstepRun``.
    meanwhile: called as soon as the goal is sent; may spin the run.

    Raises
    ------
    ValueError: the scenario has no goal.
    """
    if believed.goal is None:
        raise ValueError(f"scenario '{believed.name}' has no goal")
    with LockstepRun(believed, world=world, quiet=True, record=record, about=about) as run:
        run.start()
        state = run.reach(believed.goal, meanwhile=meanwhile)
        trace = run.observer.trace
        duration = run.bridge.time
        latency, spread = run.bridge.applied_latency
        planning = run.planner.planning_time
    position, orientation = final_errors(trace, believed.goal)
    reached = state is not None and state.error_code == 0
    success = (
        reached
        and position <= SUCCESS_POSITION
        and orientation <= SUCCESS_ORIENTATION
        and trace.collisions == 0
    )
    return {
        "success": bool(success),
        "reason": "no end within the time limit" if state is None else state.reason,
        "position_error_m": position,
        "orientation_error_rad": orientation,
        "duration_s": duration,
        "pushes": trace.pushes,
        "contact_losses": trace.contact_losses,
        "min_clearance_m": min_clearance(believed, trace),
        "collisions": trace.collisions,
        "replans": 0 if state is None else int(state.replans),
        "applied_latency_s": latency,
        "applied_latency_std_s": spread,
        **job_times(trace, believed.robot()[1].differential, planning),
    }, trace
