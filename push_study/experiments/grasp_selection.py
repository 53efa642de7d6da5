"""Section 3.1.6: three e-pucks take a grasp that was chosen by MHD, and push; beside a random one.

The best of the random grasps that meet the requirements, refined by (3.9)-(3.10), and one
that only passes the test. The robots stand anywhere, go to their places round the object and each
other, find contact and push together. The thesis drives each along its own way with the LTV-MPC;
here the group law does it.
"""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from grasp_opt.free_space import FreeSpace
from grasp_opt.group_job import GroupJob
from grasp_opt.marshal import NoStep
from grasp_opt.object_trajectory import study_trajectories
from grasp_opt.selection import GraspSelector, NoGraspFound, Selection
from grasp_opt.step_planner import StepPlanner
from push_model import se2
from push_model.arrays import Array
from push_model.jobs import JobError, JobPhase
from push_model.occupancy import rasterise
from push_model.settings import SettingsError
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from push_study.experiments.group_goals import scattered
from push_study.group_world import GroupWorld
from push_study.pool import Row
from push_study.statistics import sign_test
from push_study.study import StudyOptions
from push_study.uncertainty import uncertainty

SCENARIOS = ("plate_square", "plate_triangle", "plate_hexagon", "plate_ellipse")
"""Objects, where none are named."""
CHOOSES_WORLD = True
ROBOT, ROBOTS = "epuck_ring", 3
SPEED, ACCELERATION = 0.05, 0.05  # [m/s], [m/s^2]
_TRIES = 500
_MARGIN = 0.02  # of the compatibility test, that both grasps have
_GAP = 0.015  # [m] between robots
_ROOM = 2.2  # [m] about the trajectory
_LIMIT = 400.0  # [s]
_GOAL = 0.02, 0.1  # [m], [rad] at the end that count as success


@dataclass(frozen=True)
class SelectionTask:
    """One push. scenario: name of the object; grasp: selected or random."""

    scenario: str
    seed: int
    out: str
    trajectory: str
    grasp: str
    world: str
    uncertainty: str


def tasks(options: StudyOptions) -> list[SelectionTask]:
    """Every object along every trajectory, with both grasps."""
    for name in options.scenarios:
        if not load_object(name).geometry.convex:
            raise SettingsError(f"'{name}' is not convex: groups push convex objects")
    return [
        SelectionTask(
            name,
            options.seed + k,
            str(options.out),
            trajectory,
            grasp,
            options.world or "pybullet",
            options.uncertainty,
        )
        for name in options.scenarios
        for trajectory in study_trajectories()
        for k in range(options.trials)
        for grasp in ("selected", "random")
    ]


def choose(task: SelectionTask) -> Selection:
    """The grasp of a task; raises NoGraspFound."""
    item, robot = load_object(task.scenario), load_robot(ROBOT)
    path = study_trajectories(SPEED, ACCELERATION)[task.trajectory]
    seed = zlib.crc32(f"{task.seed} {task.scenario} {task.trajectory}".encode())
    radius = robot.footprint_radius
    selector = GraspSelector(item, path, ROBOTS, radius, least_margin=_MARGIN, gap=_GAP)
    if task.grasp == "selected":
        return selector.select(_TRIES, seed)
    return selector.first(_TRIES, seed)


def trial(task: SelectionTask) -> Row:
    """Go to the places and push."""
    item, robot = load_object(task.scenario), load_robot(ROBOT)
    path = study_trajectories(SPEED, ACCELERATION)[task.trajectory]
    row: Row = {
        "scenario": task.scenario,
        "seed": task.seed,
        "trajectory": task.trajectory,
        "grasp": task.grasp,
    }
    try:
        chosen = choose(task)
    except NoGraspFound as error:
        return row | {"success": False, "reason": str(error)}
    reach = np.abs(path.pose[:, :2]).max(axis=0) * 2.0 + _ROOM
    room = EnvironmentSpec((float(reach[0]), float(reach[1])), resolution=0.02)
    grid, start = rasterise(room), path.pose[0]
    outline = se2.transform(start, item.geometry.outline)
    random = np.random.default_rng(task.seed)
    size = (float(reach[0]), float(reach[1]))
    spots = scattered(random, ROBOTS, FreeSpace(grid), outline, robot.footprint_radius, size)
    planner, job = StepPlanner(grid, item, robot), GroupJob(item, robot, ROBOTS)
    job.begin_along(path)
    errors: list[float] = []
    turned: list[float] = []
    forces: list[Array] = []
    collisions = 0
    doubt, begin = uncertainty(task.uncertainty), item.geometric_pose(start)
    with GroupWorld(room, robot, spots, item, begin, doubt, task.seed, task.world) as world:
        while world.time < _LIMIT and job.busy:
            seen, robots = world.see()
            twists = job.step(world.time, item.mass_pose(seen), robots)
            if job.request is not None:
                try:
                    job.planned(planner.taking(chosen.way, path, job.request.pose, robots))
                except NoStep as error:
                    job.failed(JobError.PLANNING_FAILED, str(error))
            if job.state is JobPhase.PUSHING and job.last is not None:
                off = se2.between(path.sample(job.last.time), item.mass_pose(world.truth()[0]))
                errors.append(float(np.hypot(off[0], off[1])))
                turned.append(abs(float(off[2])))
            world.step(twists)
            felt, touched = world.felt()
            collisions += touched
            if job.state is JobPhase.PUSHING:
                forces.append(felt)
        off = se2.between(path.pose[-1], item.mass_pose(world.truth()[0]))
        drawn = world.drawn
    ended = job.error in (JobError.NONE, JobError.OFF_TARGET) and not job.busy
    good = bool(ended and np.hypot(off[0], off[1]) <= _GOAL[0] and abs(off[2]) <= _GOAL[1])
    row |= {
        "final_position_error_m": float(np.hypot(off[0], off[1])),
        "final_orientation_error_rad": abs(float(off[2])),
        "success": good,
        "reason": "" if good else job.reason,
        "margin": chosen.margin,
        "mhd": chosen.value,
        "passed": chosen.passed,
        "collision_ticks": collisions,
    }
    if errors:
        row |= {
            "position_error_m": float(np.mean(errors)),
            "worst_position_error_m": float(np.max(errors)),
            "orientation_error_rad": float(np.mean(turned)),
            "force_n": float(np.mean(forces)),
        }
    return row | drawn


def conclude(options: StudyOptions, tasks: Sequence[SelectionTask], rows: list[Row]) -> None:
    """Selected beside random grasps."""
    print("\nobject            grasp      pushed     position [mm]   orientation [rad]   force [N]")
    for name in options.scenarios:
        for grasp in ("selected", "random"):
            mine = [r for r in rows if r["scenario"] == name and r.get("grasp") == grasp]
            good = [r for r in mine if r["success"]]
            if not good:
                print(f"{name:17s} {grasp:9s}  0 of {len(mine)}")
                continue
            print(
                f"{name:17s} {grasp:9s} {len(good):2d} of {len(mine):<2d}"
                f" {1e3 * np.mean([r['position_error_m'] for r in good]):10.2f}"
                f" {np.mean([r['orientation_error_rad'] for r in good]):18.4f}"
                f" {np.mean([r['force_n'] for r in good]):13.2f}"
            )
    key = ("scenario", "seed", "trajectory")
    both: dict[tuple[str, ...], dict[str, float]] = {}
    for r in rows:
        if r["success"]:
            pair = both.setdefault(tuple(str(r[k]) for k in key), {})
            pair[r["grasp"]] = r["position_error_m"]
    pairs = [p for p in both.values() if len(p) == 2]
    lower = sum(p["selected"] < p["random"] for p in pairs)
    print(
        f"the selected grasp is nearer in {lower} of {len(pairs)} pairs, "
        f"p = {sign_test(lower, len(pairs)):.3f}"
    )
    for r in rows:
        if not r["success"]:
            print(f"{r['scenario']} {r.get('trajectory')} {r.get('grasp')}: {r['reason']}")
