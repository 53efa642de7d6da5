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

from grasp_opt.object_trajectory import ObjectTrajectory, study_trajectories
from push_model import se2
from push_model.arrays import Array
from push_model.free_space import FreeSpace
from push_model.jobs import JobError
from push_model.occupancy import rasterise
from push_model.settings import SettingsError
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_scenario.bodies import load_object, load_robot
from push_scenario.scatter import scattered
from push_study import given_grasp, synchronised
from push_study.given_grasp import task_along
from push_study.pool import Row
from push_study.push_record import PushRecord
from push_study.statistics import sign_test
from push_study.study import StudyOptions
from push_study.summary import by_cell
from push_study.team_run import made_scenario, run_team
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
_MEASURES = ("position_error_m", "force_n", "charged_s", "planning_cpu_s")
METHODS = {"mpc": synchronised.NAME, "group": given_grasp.NAME}
"""That run in the graph, by law."""


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


def settings_of(task: SelectionTask) -> dict[str, Any]:
    """How the grasp of a task is chosen, as a scenario has it."""
    seed = zlib.crc32(f"{task.seed} {task.scenario} {task.trajectory}".encode())
    drawn = {"tries": _TRIES, "seed": seed, "margin": _MARGIN, "gap": _GAP}
    return {"choice": task.grasp, **drawn}


def trial(task: SelectionTask) -> Row:
    """Choose the grasp, go to the places and push."""
    item, robot = load_object(task.scenario), load_robot(ROBOT)
    path = study_trajectories(SPEED, ACCELERATION)[task.trajectory]
    method = METHODS[task.law]
    settings = {method: {"grasp": settings_of(task)}}
    places, start = _spots(task, item, robot, path), item.geometric_pose(path.pose[0])
    room = _room(path)
    scenario = made_scenario(task.scenario, room, robot, places, item, start, settings)
    record = PushRecord(item, path)
    outcome = run_team(
        method,
        scenario,
        task_along(path, item),
        uncertainty(task.uncertainty),
        task.seed,
        _LIMIT,
        record,
        task.world,
    )
    away, turned = outcome.error
    reason = "" if outcome.code in (JobError.NONE, JobError.OFF_TARGET) else outcome.reason
    if not reason and (away > _GOAL[0] or turned > _GOAL[1]):
        reason = f"{1e3 * away:.0f} mm and {turned:.2f} rad off at the end"
    row = outcome.row()
    row["final_position_error_m"] = row.pop("position_error_m")
    row["final_orientation_error_rad"] = row.pop("orientation_error_rad")
    row = {
        "scenario": task.scenario,
        "seed": task.seed,
        "trajectory": task.trajectory,
        "grasp": task.grasp,
        "law": task.law,
        "success": not reason,
        **row,
        "reason": reason,
    }
    grasp = None if record.method is None else record.method.plans.grasp
    if grasp is not None and grasp.selection is not None:
        chosen = grasp.selection
        row |= {"margin": chosen.margin, "mhd": chosen.value, "passed": chosen.passed}
    return row | record.figures(outcome.trace)


def _room(path: ObjectTrajectory) -> EnvironmentSpec:
    reach = np.abs(path.pose[:, :2]).max(axis=0) * 2.0 + _ROOM
    return EnvironmentSpec((float(reach[0]), float(reach[1])), resolution=0.02)


def _spots(
    task: SelectionTask, item: ObjectSpec, robot: RobotSpec, path: ObjectTrajectory
) -> Array:
    """``(n, 3)`` random poses of the robots."""
    space, random = FreeSpace(rasterise(_room(path))), np.random.default_rng(task.seed)
    outline = se2.transform(path.pose[0], item.geometry.outline)
    return scattered(random, ROBOTS, space, outline, robot.footprint_radius, gap=0.03)


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Means by grasp and law, and the sign tests of the pairs."""
    result: dict[str, Any] = dict(by_cell(rows, ("grasp", "law"), _MEASURES))
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
            f"{law}: the selected grasp has a smaller error in {lower} of {len(pairs)} pairs, "
            f"p = {sign_test(lower, len(pairs)):.3f}"
        )
    pairs = _pairs(rows, "law")
    lower = sum(p["group"] < p["mpc"] for p in pairs)
    print(
        f"the group law has a smaller error than the LTV-MPC in {lower} of {len(pairs)} pairs, "
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
