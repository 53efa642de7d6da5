"""Starts so close to a wall that no stable push leads away: how many goals are reached from there.

Each trial draws start, goal and place of the robot at random, until the planner finds no plan
without a pre-emptive push. The pre-emptive pushes then include those on a corner of the object
(``push_planner/turning_push.py``).
"""

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from push_model.arrays import Array
from push_model.settings import SettingsError
from push_planner import PlannerSettings, PlanningFailed, PushPlanner, PushScene
from push_ros.claims import own_domain
from push_scenario.scenario import Scenario, load_scenario
from push_study.job import digest, run_job
from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.uncertainty import uncertainty

SCENARIOS = ("env1-target1",)
"""Rooms, robots and objects, where none are named."""
OPTIONS = {"uncertainty": "mild"}
CLOSE, FREE = 0.06, 0.15
"""[m] clearance of the object at the start, at most, and at the goal, at least."""
_ROBOT = 0.03  # [m] clearance of the robot at the start
_APART = 0.05  # [m] more between robot and object than both are wide
_TRIES = 1_000_000  # poses that are drawn


@dataclass(frozen=True)
class WallTask:
    """One trial. scenario: room, robot and object. digest: of the scenario's text."""

    scenario: str
    seed: int
    uncertainty: str = "mild"
    digest: str = ""


def tasks(options: StudyOptions) -> list[WallTask]:
    """Every scenario, as often as there are trials. Raises SettingsError where the robot has no
    flat bumper."""
    made = []
    for name in options.scenarios:
        scenario = load_scenario(name)
        _ = scenario.robot()[1].flat_bumper
        text = digest(scenario)
        made += [
            WallTask(name, seed, options.uncertainty, text)
            for seed in range(options.seed, options.seed + options.trials)
        ]
    return made


def drawn_scenario(task: WallTask) -> tuple[Scenario, int]:
    """The scenario with another start, goal and place of the robot, and how many starts beside a
    wall were drawn until one of them had no direct plan.

    Raises
    ------
    SettingsError: a million poses were drawn in vain.
    """
    scenario = load_scenario(task.scenario)
    random = np.random.default_rng([task.seed, zlib.crc32(scenario.name.encode()), 11])
    robot_name, robot = scenario.robot()
    item_name, item = scenario.object()
    planner = PushPlanner(PlannerSettings(), scenario.grid, robot, item)
    x0, x1, y0, y1 = scenario.grid.extent
    scene, drawn, left = planner.scene, 0, _TRIES

    def pose() -> Array:
        nonlocal left
        left -= 1
        if left < 0:
            raise SettingsError(f"no start, goal and place of the robot found in '{task.scenario}'")
        return random.uniform([x0, y0, -np.pi], [x1, y1, np.pi])

    while True:
        start = pose()
        clearance = scene.object_clearance(item.mass_pose(start))
        if not scene.settings.safety_distance < clearance < CLOSE:
            continue
        goal, beside = _goal(scene, pose), pose()
        wide = item.geometry.circumradius + robot.footprint_radius + _APART
        while scene.robot_clearance(beside) < _ROBOT or np.hypot(*(beside - start)[:2]) < wide:
            beside = pose()
        drawn += 1
        try:
            planner.solve(start, goal)
        except PlanningFailed:
            robots, objects = {robot_name: (robot, beside)}, {item_name: (item, start)}
            return replace(scenario, robots=robots, objects=objects, goals=(goal,)), drawn


def _goal(scene: PushScene, pose: Callable[[], Array]) -> Array:
    while True:
        goal = pose()
        if scene.object_clearance(scene.item.mass_pose(goal)) >= FREE:
            return goal


def trial(task: WallTask) -> Row:
    """Bring the object from there to the goal."""
    scenario, drawn = drawn_scenario(task)
    with own_domain():
        believed, world, values = uncertainty(task.uncertainty).draw(scenario, task.seed)
        measures, _ = run_job(believed, world)
    return {
        "scenario": task.scenario,
        "seed": task.seed,
        "starts_drawn": drawn,
        **measures,
        **values,
    }


def statistics(rows: Sequence[Row]) -> Mapping[str, Any]:
    """Starts that were drawn, those without a direct plan, and goals that were reached."""
    done = [r for r in rows if "starts_drawn" in r]
    return {
        "starts_beside_walls": sum(int(r["starts_drawn"]) for r in done),
        "without_direct_plan": len(done),
        "reached": sum(bool(r["success"]) for r in done),
    }


def conclude(options: StudyOptions, tasks: Sequence[WallTask], rows: list[Row]) -> None:
    """How many goals were reached, and how far off."""
    total = statistics(rows)
    print(
        f"\nof {total['starts_beside_walls']} starts beside a wall, "
        f"{total['without_direct_plan']} have no direct plan; "
        f"{total['reached']} of those goals were reached"
    )
    far = [1e3 * float(r["position_error_m"]) for r in rows if r.get("success")]
    if far:
        hits = sum(int(r.get("collisions", 0)) for r in rows)
        print(f"position {np.mean(far):.2f} mm mean, {max(far):.2f} most; {hits} collisions")
