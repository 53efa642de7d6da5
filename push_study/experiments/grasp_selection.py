"""Section 3.1.6: three e-pucks take a grasp that was chosen by MHD, and push; beside a random one.

The best of the random grasps that meet the requirements, refined by (3.9)-(3.10), and one
that only passes the test. The robots stand anywhere, go to their places round the object and each
other, find contact and push together: each along its own way with the LTV-MPC, without a look at
the object, as in the thesis; and by the group law, which sees it.
"""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from grasp_opt.group_job import GroupJob
from grasp_opt.object_trajectory import study_trajectories
from grasp_opt.selection import GraspSelector, NoGraspFound, Selection
from grasp_opt.sequencing import NoStep
from grasp_opt.step_planner import GroupPlan, StepPlanner
from push_model import se2
from push_model.arrays import Array
from push_model.free_space import FreeSpace
from push_model.jobs import JobError, JobPhase
from push_model.occupancy import rasterise
from push_model.settings import SettingsError
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_scenario.bodies import load_object, load_robot
from push_study.group_world import TICK, GroupWorld
from push_study.pool import Row
from push_study.rooms import scattered
from push_study.statistics import sign_test
from push_study.study import StudyOptions
from push_study.summary import by_cell
from push_study.synchronised import SynchronisedTrackers
from push_study.uncertainty import uncertainty

SCENARIOS = ("plate_square", "plate_triangle", "plate_hexagon", "plate_ellipse")
"""Objects, where none are named."""
OPTIONS = {"uncertainty": "mild", "world": "pybullet"}
ROBOT, ROBOTS = "epuck_ring", 3
GRASPS, LAWS = ("selected", "random"), ("mpc", "group")
SPEED, ACCELERATION = 0.05, 0.05  # [m/s], [m/s^2]
_TRIES = 500
_MARGIN = 0.02  # of the compatibility test, that both grasps have
_GAP = 0.015  # [m] between robots
_ROOM = 2.2  # [m] about the trajectory
_LIMIT = 400.0  # [s]
_GOAL = 0.02, 0.1  # [m], [rad] at the end that count as success
_SETTLE = 1.0  # [s] after the end of a trajectory, until robots stand


@dataclass(frozen=True)
class SelectionTask:
    """One push. scenario: name of the object; grasp: selected or random; law: mpc or group."""

    scenario: str
    seed: int
    out: str
    trajectory: str
    grasp: str
    law: str
    world: str
    uncertainty: str


def tasks(options: StudyOptions) -> list[SelectionTask]:
    """Every object along every trajectory, with both grasps and both laws."""
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
            law,
            options.world or "pybullet",
            options.uncertainty,
        )
        for name in options.scenarios
        for trajectory in study_trajectories()
        for k in range(options.trials)
        for grasp in GRASPS
        for law in LAWS
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
        "law": task.law,
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
    radius = robot.footprint_radius
    spots = scattered(random, ROBOTS, FreeSpace(grid), outline, radius, gap=0.03)
    planner, job = StepPlanner(grid, item, robot), GroupJob(item, robot, ROBOTS)
    doubt, begin = uncertainty(task.uncertainty), item.geometric_pose(start)
    with GroupWorld(room, robot, spots, item, begin, doubt, task.seed, task.world) as world:
        record = _Record(item, world)
        job.begin_along(path)
        while world.time < _LIMIT and job.busy:
            if task.law == "mpc" and job.state is JobPhase.PUSHING:
                reason = _follow(world, record, item, robot, job.plan)
                break
            seen, robots = world.see()
            twists = job.step(world.time, item.mass_pose(seen), robots)
            if job.request is not None:
                try:
                    job.planned(planner.taking(chosen.way, path, job.request.pose, robots))
                except NoStep as error:
                    job.failed(JobError.PLANNING_FAILED, str(error))
            pushing = job.state is JobPhase.PUSHING and job.last is not None
            record.step(twists, path.sample(job.last.time) if pushing and job.last else None)
        else:
            ended = job.error in (JobError.NONE, JobError.OFF_TARGET) and not job.busy
            reason = "" if ended else job.reason
        off = se2.between(path.pose[-1], item.mass_pose(world.truth()[0]))
        drawn = world.drawn
    away, turned = float(np.hypot(off[0], off[1])), abs(float(off[2]))
    if not reason and (away > _GOAL[0] or turned > _GOAL[1]):
        reason = f"{1e3 * away:.0f} mm and {turned:.2f} rad off at the end"
    row |= {
        "final_position_error_m": away,
        "final_orientation_error_rad": turned,
        "success": not reason,
        "reason": reason,
        "margin": chosen.margin,
        "mhd": chosen.value,
        "passed": chosen.passed,
    }
    return row | record.figures() | drawn


class _Record:
    """What an object and the robots do while they push."""

    def __init__(self, item: ObjectSpec, world: GroupWorld) -> None:
        self._item, self._world = item, world
        self._errors: list[float] = []
        self._turned: list[float] = []
        self._forces: list[Array] = []
        self._collisions = 0

    def step(self, twists: Array, wanted: Array | None) -> None:
        """Go on by a tick; wanted ``(3,)``: where the object is to be, None before the push."""
        if wanted is not None:
            off = se2.between(wanted, self._item.mass_pose(self._world.truth()[0]))
            self._errors.append(float(np.hypot(off[0], off[1])))
            self._turned.append(abs(float(off[2])))
        self._world.step(twists)
        felt, touched = self._world.felt()
        self._collisions += touched
        if wanted is not None:
            self._forces.append(felt)

    def figures(self) -> Row:
        """Means of the push."""
        row: Row = {"collision_ticks": self._collisions}
        if self._errors:
            row |= {
                "position_error_m": float(np.mean(self._errors)),
                "worst_position_error_m": float(np.max(self._errors)),
                "orientation_error_rad": float(np.mean(self._turned)),
                "force_n": float(np.mean(self._forces)),
            }
        return row


def _follow(
    world: GroupWorld, record: _Record, item: ObjectSpec, robot: RobotSpec, plan: GroupPlan | None
) -> str:
    """Every robot of a plan along its own way; why that failed, or nothing."""
    assert plan is not None
    pushers, begin = list(plan.pushers), world.time
    trackers = SynchronisedTrackers(item, robot, plan.placement.way, plan.trajectory)
    while (now := world.time - begin) < plan.trajectory.duration + _SETTLE:
        _, robots = world.see()
        twists = np.zeros((len(robots), 2))
        twists[pushers] = trackers.step(now, TICK, robots[pushers])
        if trackers.lost:
            return "a robot cannot follow its way"
        record.step(twists, plan.trajectory.sample(now))
    return ""


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Means by grasp and law, and the sign tests of the pairs."""
    result: dict[str, Any] = dict(by_cell(rows, ("grasp", "law"), ("position_error_m", "force_n")))
    for law in LAWS:
        pairs = _pairs([r for r in rows if r.get("law") == law], "grasp")
        lower = sum(p["selected"] < p["random"] for p in pairs)
        result[f"pairs_of_grasps_{law}"] = len(pairs)
        result[f"selected_nearer_{law}"] = lower
        result[f"sign_p_grasp_{law}"] = sign_test(lower, len(pairs))
    pairs = _pairs(rows, "law")
    lower = sum(p["group"] < p["mpc"] for p in pairs)
    result["pairs_of_laws"], result["group_law_nearer"] = len(pairs), lower
    result["sign_p_law"] = sign_test(lower, len(pairs))
    return result


def conclude(options: StudyOptions, tasks: Sequence[SelectionTask], rows: list[Row]) -> None:
    """Selected beside random grasps, the LTV-MPC beside the group law."""
    print(
        "\nobject           grasp    law    at the end   position [mm], worst   [rad]   force [N]"
    )
    for name in options.scenarios:
        for grasp in GRASPS:
            for law in LAWS:
                mine = [
                    r
                    for r in rows
                    if (r["scenario"], r.get("grasp"), r.get("law")) == (name, grasp, law)
                ]
                print(_line(f"{name:17s}{grasp:9s}{law:6s}", mine))
    for law in LAWS:
        pairs = _pairs([r for r in rows if r.get("law") == law], "grasp")
        lower = sum(p["selected"] < p["random"] for p in pairs)
        print(
            f"{law}: the selected grasp is nearer in {lower} of {len(pairs)} pairs, "
            f"p = {sign_test(lower, len(pairs)):.3f}"
        )
    pairs = _pairs(rows, "law")
    lower = sum(p["group"] < p["mpc"] for p in pairs)
    print(
        f"the group law is nearer than the LTV-MPC in {lower} of {len(pairs)} pairs, "
        f"p = {sign_test(lower, len(pairs)):.3f}"
    )
    for r in rows:
        if not r["success"]:
            print(
                f"{r['scenario']} {r.get('trajectory')} {r.get('grasp')} {r.get('law')}: "
                f"{r['reason']}"
            )


def _line(head: str, mine: list[Row]) -> str:
    """Of everything that pushed, also where it missed the end."""
    good = sum(bool(r["success"]) for r in mine)
    pushed = [r for r in mine if "position_error_m" in r]
    text = f"{head} {good:2d} of {len(mine):<2d}"
    if not pushed:
        return text
    worst = max(r["worst_position_error_m"] for r in pushed)
    return (
        f"{text} {1e3 * np.mean([r['position_error_m'] for r in pushed]):15.2f}"
        f" (<= {1e3 * worst:5.1f})"
        f" {np.mean([r['orientation_error_rad'] for r in pushed]):8.4f}"
        f" {np.mean([r['force_n'] for r in pushed]):9.2f}"
    )


def _pairs(rows: list[Row], column: str) -> list[dict[str, float]]:
    """Mean errors [m] of tasks that are alike but for one column, by its value."""
    rest = [c for c in ("scenario", "seed", "trajectory", "grasp", "law") if c != column]
    both: dict[tuple[str, ...], dict[str, float]] = {}
    for r in rows:
        if "position_error_m" in r:
            pair = both.setdefault(tuple(str(r[c]) for c in rest), {})
            pair[r[column]] = r["position_error_m"]
    return [p for p in both.values() if len(p) == 2]
