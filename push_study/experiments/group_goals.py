"""Random goals for groups: any plate, two to five e-pucks, with and without obstacles.

The whole job of ``grasp_opt``: the object's way, how many push, where, how they get there, the
pushes, and what is done when something goes wrong.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from grasp_opt.group_job import GroupJob
from grasp_opt.step_settings import StepSettings
from push_job.method import Task
from push_model import se2
from push_model.arrays import Array
from push_model.free_space import FreeSpace, Obstacles
from push_model.jobs import JobPhase
from push_model.object_way import NoObjectWay, WayFinder
from push_model.occupancy import rasterise
from push_model.settings import SettingsError, from_mapping
from push_model.specs import EnvironmentSpec, ObjectSpec
from push_scenario.bodies import load_object, load_robot
from push_scenario.events import Kill
from push_scenario.scatter import scattered
from push_study.graph_run import LockstepRun
from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.summary import by_cell
from push_study.team_run import made_scenario, run_team
from push_study.uncertainty import uncertainty

SCENARIOS = ("open", "obstacles", "dead")
"""Nothing in the way; obstacles; obstacles, and one of four robots dies in its first push."""
OPTIONS = {"uncertainty": "mild", "world": "pybullet"}
ROBOT = "epuck_ring"
SIZE = (4.0, 3.0)  # [m]
_GOAL = 0.02, 0.1  # [m], [rad] that count as success
_RADIUS = 0.2  # [m] of the circle about a plate
_LIMIT = 1200.0  # [s] of simulation
_DRAWS = 2000
_GRID = 0.02  # [m]


@dataclass(frozen=True)
class GoalTask:
    """One goal. scenario: one of SCENARIOS; robots: how many there are; sides: of the plate, 0 for
    the ellipse."""

    scenario: str
    seed: int
    out: str
    robots: int
    sides: int
    world: str
    uncertainty: str


@dataclass(frozen=True)
class Problem:
    """A room with an object and robots in it, and a goal; poses ``(3,)`` of the centre of mass,
    robots ``(n, 3)``."""

    environment: EnvironmentSpec
    item: ObjectSpec
    start: Array
    goal: Array
    robots: Array


def tasks(options: StudyOptions) -> list[GoalTask]:
    """As many trials of each; shapes and numbers of robots take turns."""
    unknown = [name for name in options.scenarios if name not in SCENARIOS]
    if unknown:
        known = ", ".join(SCENARIOS)
        raise SettingsError(f"no worlds called '{unknown[0]}'; expected one of: {known}")
    shapes = (0, *range(3, 9))
    return [
        GoalTask(
            name,
            seed,
            str(options.out),
            4 if name == "dead" else 2 + seed % 4,
            shapes[seed % len(shapes)],
            options.world or "pybullet",
            options.uncertainty,
        )
        for name in options.scenarios
        for seed in range(options.seed, options.seed + options.trials)
    ]


def plate(sides: int) -> ObjectSpec:
    """A regular plate of the weight and friction of chapter 3's; 0 sides: its ellipse."""
    ellipse = load_object("plate_ellipse")
    if not sides:
        return ellipse
    angles = 2.0 * math.pi * (np.arange(sides) + 0.5) / sides
    corners = _RADIUS * np.column_stack([np.cos(angles), np.sin(angles)])
    values = {
        "shape": {"polygon": {"vertices": corners.tolist()}},
        "mass": ellipse.mass,
        "height": ellipse.height,
        "floor_friction": ellipse.floor_friction,
        "contact_friction": ellipse.contact_friction,
    }
    return from_mapping(ObjectSpec, values, f"plate of {sides} sides")


def problem(task: GoalTask) -> Problem:
    """The random problem of a task, the same in every world.

    Start and goal have room for robots all round, and there is a way between them that has.
    """
    random = np.random.default_rng([task.seed, SCENARIOS.index(task.scenario)])
    item, robot = plate(task.sides), load_robot(ROBOT)
    radius, outline = robot.footprint_radius, item.geometry.outline
    room = 2.0 * radius + StepSettings().room
    for _ in range(_DRAWS):
        environment = _environment(random, task.scenario != "open")
        space = FreeSpace(rasterise(environment))
        finder = WayFinder(space, outline, room)
        half = 0.5 * np.array(SIZE)
        start, goal = (
            np.append(random.uniform(-half, half), random.uniform(-math.pi, math.pi))
            for _ in range(2)
        )
        if np.hypot(*(goal - start)[:2]) < 0.3:
            continue
        if finder.clearance(np.array([start, goal]), Obstacles()).min() < room + 0.01:
            continue
        try:
            finder.way(start, goal, Obstacles())
        except NoObjectWay:
            continue
        here = se2.transform(start, outline)
        robots = scattered(random, task.robots, space, here, radius, gap=0.03)
        return Problem(environment, item, start, goal, robots)
    raise RuntimeError("no solvable problem was found among the random ones")


def _environment(random: np.random.Generator, obstacles: bool) -> EnvironmentSpec:
    circles = []
    for _ in range(int(random.integers(3, 6)) if obstacles else 0):
        centre = random.uniform(-0.5, 0.5, 2) * (np.array(SIZE) - 0.4)
        circles.append({"centre": centre.tolist(), "radius": float(random.uniform(0.08, 0.2))})
    values = {"size": list(SIZE), "resolution": _GRID, "circles": circles}
    return from_mapping(EnvironmentSpec, values, "environment")


def trial(task: GoalTask) -> Row:
    """One job."""
    p, robot, doubt = problem(task), load_robot(ROBOT), uncertainty(task.uncertainty)
    start, goal = p.item.geometric_pose(p.start), p.item.geometric_pose(p.goal)
    scenario = made_scenario(task.scenario, p.environment, robot, p.robots, p.item, start)
    killed = ""

    def meanwhile(run: LockstepRun, now: float, poses: Array) -> None:
        nonlocal killed
        job = run.supervisor.method.job
        if task.scenario == "dead" and not killed and _in_the_middle(job):
            pushers = job.plan.pushers
            killed = f"e{pushers[task.seed % len(pushers)]}"
            run.bridge.disturb(Kill(at=0.0, robot=killed))

    outcome = run_team(
        "group", scenario, Task((goal,)), doubt, task.seed, _LIMIT, meanwhile, task.world
    )
    away, turned = outcome.error
    clean = outcome.trace.collision_ticks == 0
    reached = outcome.success and away <= _GOAL[0] and turned <= _GOAL[1]
    reason = "" if outcome.success else outcome.reason
    if reached and not clean:
        reason = f"collisions in {outcome.trace.collision_ticks} ticks"
    return {
        "scenario": task.scenario,
        "seed": task.seed,
        "robots": task.robots,
        "sides": task.sides,
        "success": bool(reached and clean),
        "killed": killed,
        "distance_m": float(np.hypot(*(p.goal - p.start)[:2])),
        **outcome.row(),
        "reason": reason,
    }


def _in_the_middle(job: GroupJob) -> bool:
    """Of a push that is long enough for it."""
    if job.state is not JobPhase.PUSHING or job.plan is None or job.last is None:
        return False
    return job.last.time > 0.5 * job.plan.trajectory.duration


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Means by world and number of robots, over the goals that were reached."""
    return dict(
        by_cell(
            rows,
            ("scenario", "robots"),
            ("position_error_m", "orientation_error_rad", "charged_s"),
        )
    )


def conclude(options: StudyOptions, tasks: Sequence[GoalTask], rows: list[Row]) -> None:
    """By worlds, numbers of robots and shapes."""
    print(
        "\nworlds      robots   reached     position [mm]      orientation [rad]   "
        "time [s]  planning [s]"
    )
    for name in options.scenarios:
        counts = sorted({t.robots for t in tasks if t.scenario == name})
        for count in [*counts, 0] if len(counts) > 1 else counts:
            mine = [
                r for r in rows if r["scenario"] == name and (not count or r.get("robots") == count)
            ]
            good = [r for r in mine if r["success"]]
            if not good:
                print(f"{name:10s} {count or 'all'!s:>6s}   0 of {len(mine)}")
                continue
            away = 1e3 * np.array([r["position_error_m"] for r in good])
            turned = np.array([r["orientation_error_rad"] for r in good])
            print(
                f"{name:10s} {count or 'all'!s:>6s}  {len(good):3d} of {len(mine):<3d}"
                f"  {away.mean():6.2f} (<= {away.max():5.2f})  {turned.mean():8.4f} "
                f"(<= {turned.max():6.4f})  {np.mean([r['charged_s'] for r in good]):7.0f}"
                f"  {np.mean([r['planning_cpu_s'] for r in good]):8.1f}"
            )
    for row in rows:
        if not row["success"]:
            print(f"{row['scenario']} seed {row['seed']}: {row['reason']}")
