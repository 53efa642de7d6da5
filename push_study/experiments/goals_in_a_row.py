"""Random goals one after the other in environment 3, without a reset: nothing wears out."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from push_model.arrays import Array
from push_planner import DistanceField, PlannerSettings, PushScene
from push_ros.claims import own_domain
from push_scenario.scenario import Scenario, load_scenario
from push_study.graph_run import LockstepRun
from push_study.job import digest
from push_study.observer import final_errors
from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.uncertainty import uncertainty

SCENARIOS = ("env3-target1",)
"""Where none are named."""
OPTIONS = {"uncertainty": "mild"}

GOALS = 56
"""Of a trial."""
POSITION, ORIENTATION = 0.01, 0.05
"""[m], [rad] within which each must end."""


@dataclass(frozen=True)
class RowTask:
    """One row of goals. digest: of the scenario's text."""

    scenario: str
    seed: int
    out: str
    uncertainty: str = "mild"
    goals: int = GOALS
    digest: str = ""


def tasks(options: StudyOptions) -> list[RowTask]:
    """Every scenario, as often as there are trials."""
    made = []
    for name in options.scenarios:
        text = digest(load_scenario(name))
        made += [
            RowTask(name, seed, str(options.out), options.uncertainty, digest=text)
            for seed in range(options.seed, options.seed + options.trials)
        ]
    return made


def draw_goals(scenario: Scenario, count: int, seed: int) -> list[Array]:
    """Poses ``(3,)`` anywhere on the map where the robot has room behind every side.

    From others there may be no way on: a robot that can only push never gets an object out of a
    corner.
    """
    item = scenario.object()[1]
    field = DistanceField(scenario.grid)
    scene = PushScene(field, scenario.robot()[1], item, PlannerSettings())
    random = np.random.default_rng([seed, 56])
    x0, x1, y0, y1 = scenario.grid.extent
    goals: list[Array] = []
    while len(goals) < count:
        pose = random.uniform([x0, y0, -np.pi], [x1, y1, np.pi])
        centre = item.mass_pose(pose)
        free = scene.object_clearance(centre) >= scene.settings.safety_distance
        if free and all(scene.has_room(side.robot_pose(centre), side) for side in scene.sides):
            goals.append(pose)
    return goals


def trial(task: RowTask) -> Row:
    """Bring the object to one goal after the other."""
    scenario = load_scenario(task.scenario)
    believed, world, drawn = uncertainty(task.uncertainty).draw(scenario, task.seed)
    positions, orientations, missed = [], [], []
    with own_domain(), LockstepRun(believed, world=world, quiet=True) as run:
        run.start()
        for number, goal in enumerate(draw_goals(scenario, task.goals, task.seed), 1):
            state = run.reach(goal, 600.0)
            position, orientation = final_errors(run.observer.trace, goal)
            positions.append(position)
            orientations.append(orientation)
            good = state is not None and state.error_code == 0
            if not (good and position <= POSITION and orientation <= ORIENTATION):
                why = "no end" if state is None else state.reason
                missed.append(f"{number}: {1e3 * position:.0f} mm, {orientation:.2f} rad, {why}")
        collisions, duration = run.observer.trace.collisions, run.bridge.time
    return {
        "scenario": task.scenario,
        "seed": task.seed,
        "success": not missed and collisions == 0,
        "reason": "; ".join(missed) or f"all {task.goals} goals",
        "sent": task.goals,
        "missed": len(missed),
        "position_error_m": float(np.max(positions)),
        "orientation_error_rad": float(np.max(orientations)),
        "position_median_m": float(np.median(positions)),
        "collisions": collisions,
        "duration_s": duration,
        **drawn,
    }


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Goals of all rows, and how many of them were missed."""
    done = [r for r in rows if "missed" in r]
    return {f"goals_{name}": sum(int(r[name]) for r in done) for name in ("sent", "missed")}


def conclude(options: StudyOptions, tasks: Sequence[RowTask], rows: list[Row]) -> None:
    """The worst of each row."""
    for row in (r for r in rows if "missed" in r):
        print(
            f"\nseed {row['seed']}: {row['missed']} of {row['sent']} goals missed; median "
            f"{1e3 * row['position_median_m']:.2f} mm, most "
            f"{1e3 * row['position_error_m']:.2f} mm, {row['orientation_error_rad']:.4f} rad; "
            f"{row['collisions']} collisions, {row['duration_s']:.0f} s"
        )
