"""Section 3.2.3: e-pucks push the ellipse along trajectories, from optimised and other places.

The thesis has Figures 3.13 to 3.18 of it, without numbers. Two and three robots, poses with noise,
frictions that are not as believed; the optimised placement beside the starting point of the
thesis's optimisation, evenly spread behind the object.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from grasp_opt.contact_outline import ContactOutline
from grasp_opt.group_push import GroupPush
from grasp_opt.object_trajectory import ObjectTrajectory, polynomial, sinusoid
from push_model.arrays import Array
from push_model.jobs import JobError
from push_model.settings import SettingsError
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_scenario.bodies import load_object, load_robot
from push_study import given_grasp
from push_study.given_grasp import task_along
from push_study.pool import Row
from push_study.push_record import PushRecord
from push_study.statistics import sign_test
from push_study.study import StudyOptions
from push_study.summary import by_cell
from push_study.team_run import TeamTrace, made_scenario, run_team
from push_study.uncertainty import Uncertainty, uncertainty

SCENARIOS = ("bend", "double-bend", "wave")
"""Trajectories, where none are named."""
OPTIONS = {"uncertainty": "mild", "world": "pybullet"}
ROBOTS, PLACEMENTS = (2, 3), ("optimised", "even")
ROBOT, OBJECT = "epuck_ring", "plate_ellipse"
SPEED, ACCELERATION = 0.05, 0.05  # [m/s], [m/s^2]
_BACK = -0.5 * math.pi  # [rad] the object's y axis points ahead, as in the thesis
_APART = 0.1  # [m] that robots have to go to the object from where they set out
_FORCE_SHARE = 0.9  # of its traction that a robot of an optimised placement may use
_MARGIN = 0.8  # [m] about the trajectory
_LONGER = 200.0  # [s] that going to the places and the push may take beyond the trajectory
_SMOOTH = 25  # ticks over which forces are averaged in plots
_LABELS = ("y [m]", "position error [mm]", "contact force [N]")
THETA0 = {
    2: (7 * math.pi / 4, 5 * math.pi / 4),
    3: (7 * math.pi / 4, 1.5 * math.pi, 5 * math.pi / 4),
}
"""[rad] Polar angles that the thesis's optimisation starts from, and compares with."""


def trajectories() -> dict[str, ObjectTrajectory]:
    """By name: to one side, to both sides, and a wave of constant heading. Sizes are ours."""
    return {
        "bend": polynomial((0.25,), 0.9, SPEED, ACCELERATION, _BACK),
        "double-bend": polynomial((0.8, -0.7), 0.9, SPEED, ACCELERATION, _BACK),
        "wave": sinusoid(0.06, 1.0, 0.9, SPEED, ACCELERATION, _BACK),
    }


@dataclass(frozen=True)
class TrackingTask:
    """One push; scenario: name of the trajectory; placement: optimised or even."""

    scenario: str
    seed: int
    out: str
    robots: int
    placement: str
    world: str
    uncertainty: str

    @property
    def doubt(self) -> Uncertainty:
        """What the nodes do not know."""
        return uncertainty(self.uncertainty)

    @property
    def trace(self) -> Path:
        """Where its push is kept."""
        name = f"{self.scenario}-{self.robots}-{self.placement}-{self.seed}.npz"
        return Path(self.out) / "pushes" / name


def tasks(options: StudyOptions) -> list[TrackingTask]:
    """Every trajectory, number of robots and placement, with as many seeds as there are trials."""
    unknown = [name for name in options.scenarios if name not in trajectories()]
    if unknown:
        known = ", ".join(trajectories())
        raise SettingsError(f"no trajectory called '{unknown[0]}'; expected one of: {known}")
    return [
        TrackingTask(
            name,
            options.seed + k,
            str(options.out),
            count,
            placement,
            options.world or "pybullet",
            options.uncertainty,
        )
        for name in options.scenarios
        for count in ROBOTS
        for k in range(options.trials)
        for placement in PLACEMENTS
    ]


def settings_of(task: TrackingTask) -> dict[str, Any]:
    """The settings of the grasp of a task, as a scenario has them."""
    if task.placement == "optimised":
        return {"choice": "optimised", "force_share": _FORCE_SHARE}
    outline = ContactOutline(load_object(OBJECT).geometry)
    ways = outline.way_of_angle(np.array(THETA0[task.robots]))
    return {"choice": "given", "ways": ways.tolist()}


def starts(item: ObjectSpec, robot: RobotSpec, path: ObjectTrajectory, count: int) -> Array:
    """``(n, 3)`` poses behind the object from which robots set out, whatever places they take."""
    outline = ContactOutline(item.geometry)
    ways = outline.way_of_angle(np.array(THETA0[count]))
    return GroupPush(item, robot, ways, path).starts(path.pose[0], _APART)


def trial(task: TrackingTask) -> Row:
    """Choose the places, go to them and push."""
    item, robot = load_object(OBJECT), load_robot(ROBOT)
    path = trajectories()[task.scenario]
    reach = 2.0 * (np.abs(path.pose[:, :2]).max(axis=0) + _MARGIN)
    room = EnvironmentSpec((float(reach[0]), float(reach[1])), resolution=0.05)
    places, start = starts(item, robot, path, task.robots), item.geometric_pose(path.pose[0])
    settings = {given_grasp.NAME: {"grasp": settings_of(task)}}
    scenario = made_scenario(task.scenario, room, robot, places, item, start, settings)
    record = PushRecord(item, path)
    outcome = run_team(
        given_grasp.NAME,
        scenario,
        task_along(path, item),
        task.doubt,
        task.seed,
        path.duration + _LONGER,
        record,
        task.world,
    )
    row = outcome.row()
    done = outcome.code in (JobError.NONE, JobError.OFF_TARGET)
    row["final_position_error_m"] = row.pop("position_error_m")
    row["final_orientation_error_rad"] = row.pop("orientation_error_rad")
    row = {
        "scenario": task.scenario,
        "seed": task.seed,
        "robots": task.robots,
        "placement": task.placement,
        "success": done,
        **row,
        "reason": "" if done else outcome.reason,
    }
    plan = None if record.method is None else record.method.job.plan
    if plan is not None:
        row["margin"] = plan.placement.margin
        row["planned_force_n"] = float(np.linalg.norm(plan.placement.forces, axis=2).mean())
    if record.times:
        _keep(task, record, outcome.trace)
    return row | record.figures(outcome.trace)


def _keep(task: TrackingTask, record: PushRecord, trace: TeamTrace) -> None:
    """Write what is plotted."""
    arrays: dict[str, Any] = {
        "time": np.array(record.times),
        "object": np.array(record.objects),
        "wanted": np.array(record.wanted),
        "force": record.forces(trace),
    }
    task.trace.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(task.trace, **arrays)


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Means by trajectory, number of robots and placement; the sign tests of the pairs."""
    result: dict[str, Any] = dict(
        by_cell(
            rows,
            ("scenario", "robots", "placement"),
            ("position_error_m", "force_n", "force_spread_n", "charged_s"),
        )
    )
    for name in dict.fromkeys(r["scenario"] for r in rows):
        for count in ROBOTS:
            lower, pairs = _nearer(rows, name, count)
            if pairs:
                result[f"pairs_{name}_{count}"] = pairs
                result[f"optimised_nearer_{name}_{count}"] = lower
                result[f"sign_p_{name}_{count}"] = sign_test(lower, pairs)
    return result


def _mine(rows: list[Row], name: str, count: int, placement: str) -> list[Row]:
    key = name, count, placement
    return [r for r in rows if (r["scenario"], r.get("robots"), r.get("placement")) == key]


def _nearer(rows: list[Row], name: str, count: int) -> tuple[int, int]:
    """In how many trials the optimised placement is nearer, of how many that both completed."""
    best, even = (
        {r["seed"]: r["position_error_m"] for r in _mine(rows, name, count, p) if r["success"]}
        for p in PLACEMENTS
    )
    seeds = set(best) & set(even)
    return sum(best[s] < even[s] for s in seeds), len(seeds)


def conclude(options: StudyOptions, tasks: Sequence[TrackingTask], rows: list[Row]) -> None:
    """Optimised beside even placements, task by task."""
    print(
        "\ntrajectory   robots  placement  margin  pushed     position [mm]   orientation [rad]"
        "   force [N]  spread [N]  time [s]  planning [s]"
    )
    for name in options.scenarios:
        for count in ROBOTS:
            for placement in PLACEMENTS:
                mine = _mine(rows, name, count, placement)
                if mine:
                    print(_line(name, count, placement, mine))
            lower, pairs = _nearer(rows, name, count)
            if pairs:
                print(
                    f"{'':13s}the optimised placement has a smaller error in {lower} of {pairs} "
                    f"trials, p = {sign_test(lower, pairs):.3f}"
                )
    _plots(tasks, options)


def _line(name: str, count: int, placement: str, mine: list[Row]) -> str:
    good = [r for r in mine if r["success"]]

    def mean(column: str) -> float:
        return float(np.mean([r[column] for r in good])) if good else float("nan")

    worst = max((r["position_error_m"] for r in good), default=float("nan"))
    return (
        f"{name:13s}{count:5d}   {placement:10s} {mean('margin'):6.3f}  {len(good):3d} of "
        f"{len(mine):<3d} {1e3 * mean('position_error_m'):6.2f} (<= {1e3 * worst:5.2f}) "
        f"{mean('orientation_error_rad'):12.4f}   {mean('force_n'):12.2f} "
        f"{mean('force_spread_n'):10.2f} {mean('charged_s'):9.1f} {mean('planning_cpu_s'):9.2f}"
    )


def _plots(tasks: Sequence[TrackingTask], options: StudyOptions) -> None:
    """As Figures 3.13, 3.14 and 3.16: ways, errors and forces of the first trial of each task."""
    for name in options.scenarios:
        for count in ROBOTS:
            mine = [
                t
                for t in tasks
                if (t.scenario, t.robots, t.seed) == (name, count, options.seed)
                and t.trace.is_file()
            ]
            if mine:
                _figure(f"{name}-{count}", mine, options)


def _figure(name: str, tasks: Sequence[TrackingTask], options: StudyOptions) -> None:
    figure, axes = plt.subplots(1, 3, figsize=(13, 3.6))
    for task, style in zip(tasks, ("-", "--"), strict=False):
        trace = np.load(task.trace)
        label = f"{task.placement} places"
        axes[0].plot(*trace["object"][:, :2].T, style, label=label)
        off = 1e3 * np.hypot(*(trace["object"] - trace["wanted"])[:, :2].T)
        axes[1].plot(trace["time"], off, style, label=label)
        for i, force in enumerate(trace["force"].T):
            smooth = np.convolve(force, np.full(_SMOOTH, 1.0 / _SMOOTH), mode="same")
            axes[2].plot(trace["time"], smooth, style, color=f"C{i}", label=f"robot {i}, {label}")
        axes[0].plot(*trace["wanted"][:, :2].T, "k:", label=f"trajectory, {label}")
    axes[0].set_aspect("equal")
    for axis, x, y in zip(axes, "xtt", _LABELS, strict=True):
        axis.set_xlabel(f"{x} [{'m' if x == 'x' else 's'}]")
        axis.set_ylabel(y)
        axis.legend(fontsize=6)
    figure.tight_layout()
    figure.savefig(options.out / f"{name}.png", dpi=110)
    plt.close(figure)
