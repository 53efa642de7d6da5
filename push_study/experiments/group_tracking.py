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

from grasp_opt.group_push import GroupPush, Phase
from grasp_opt.object_trajectory import ObjectTrajectory, polynomial, sinusoid
from grasp_opt.placement import Placement, Placer, robust_placement
from push_model import se2
from push_model.arrays import Array
from push_model.settings import SettingsError
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_model.traction import lift_share, standing_traction
from push_scenario.bodies import load_object, load_robot
from push_study.group_world import GroupWorld
from push_study.pool import Row
from push_study.statistics import sign_test
from push_study.study import StudyOptions
from push_study.uncertainty import uncertainty

SCENARIOS = ("bend", "double-bend", "wave")
"""Trajectories, where none are named."""
OPTIONS = {"uncertainty": "mild", "world": "pybullet"}
ROBOTS = (2, 3)
ROBOT, OBJECT = "epuck_ring", "plate_ellipse"
SPEED, ACCELERATION = 0.05, 0.05  # [m/s], [m/s^2]
_BACK = -0.5 * math.pi  # [rad] the object's y axis points ahead, as in the thesis
_APART = 0.01  # [m] between robots and object at the beginning
_MARGIN = 0.8  # [m] about the trajectory
_LONGER = 20.0  # [s] that a push may take beyond its trajectory
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
        for placement in ("optimised", "even")
    ]


def placement_of(task: TrackingTask, item: ObjectSpec, robot: RobotSpec) -> Placement:
    """Where the robots of a task push."""
    path, radius = trajectories()[task.scenario], robot.footprint_radius
    if task.placement == "optimised":
        most = 0.9 * standing_traction(robot, lift_share(robot, item))
        return robust_placement(item, path, task.robots, radius, most)
    placer = Placer(item, path, task.robots, radius)
    return placer.placement(placer.outline.way_of_angle(np.array(THETA0[task.robots])))


def trial(task: TrackingTask) -> Row:
    """Push once."""
    item, robot = load_object(OBJECT), load_robot(ROBOT)
    path, doubt = trajectories()[task.scenario], uncertainty(task.uncertainty)
    placed = placement_of(task, item, robot)
    push = GroupPush(item, robot, placed.way, path)
    start = path.pose[0]
    starts = push.starts(start, _APART)
    reach = 2.0 * (np.abs(path.pose[:, :2]).max(axis=0) + _MARGIN)
    room = EnvironmentSpec((float(reach[0]), float(reach[1])), resolution=0.05)
    begin = item.geometric_pose(start)
    times, objects, wanted, forces, lacking = [], [], [], [], []
    reason, collision = "", False
    with GroupWorld(room, robot, starts, item, begin, doubt, task.seed, task.world) as world:
        while world.time < path.duration + _LONGER:
            seen, robots = world.see()
            step = push.step(world.time, item.mass_pose(seen), robots)
            if step.phase is Phase.PUSH and step.command is not None:
                times.append(step.time)
                objects.append(item.mass_pose(world.truth()[0]))
                wanted.append(path.sample(step.time))
                lacking.append(step.command.lacking)
            world.step(step.twists)
            felt, touched = world.felt()
            collision = collision or touched
            if step.phase is Phase.PUSH:
                forces.append(felt)
            if step.phase in (Phase.DONE, Phase.FAILED):
                reason = step.reason
                break
        taken, drawn = world.time, world.drawn
    trace = {"time": times, "object": objects, "wanted": wanted, "force": forces}
    _trace_file(task).parent.mkdir(parents=True, exist_ok=True)
    arrays: dict[str, Any] = {k: np.array(v) for k, v in trace.items()}
    np.savez_compressed(_trace_file(task), **arrays)
    return (
        _row(task, placed, reason, taken, collision)
        | drawn
        | _figures(np.array(objects), np.array(wanted), np.array(forces), np.array(lacking))
    )


def _trace_file(task: TrackingTask) -> Path:
    name = f"{task.scenario}-{task.robots}-{task.placement}-{task.seed}.npz"
    return Path(task.out) / "pushes" / name


def _row(task: TrackingTask, placed: Placement, reason: str, taken: float, collision: bool) -> Row:
    return {
        "scenario": task.scenario,
        "seed": task.seed,
        "robots": task.robots,
        "placement": task.placement,
        "success": not reason,
        "reason": reason,
        "collision": collision,
        "duration_s": taken,
        "margin": placed.margin,
        "planned_force_n": float(np.linalg.norm(placed.forces, axis=2).mean()),
    }


def _figures(objects: Array, wanted: Array, forces: Array, lacking: Array) -> Row:
    """Errors and forces; force_spread_n: standard deviation between robots, at each moment."""
    if not len(objects):
        return {}
    off = objects - wanted
    away = np.hypot(*off[:, :2].T)
    turned = np.abs([se2.wrap(float(a)) for a in off[:, 2]])
    return {
        "position_error_m": float(away.mean()),
        "worst_position_error_m": float(away.max()),
        "orientation_error_rad": float(turned.mean()),
        "worst_orientation_error_rad": float(turned.max()),
        "force_n": float(forces.mean()),
        "force_spread_n": float(forces.std(axis=1).mean()),
        "greatest_force_n": float(forces.max(axis=1).mean()),
        "lacking": float(lacking.mean()),
    }


def conclude(options: StudyOptions, tasks: Sequence[TrackingTask], rows: list[Row]) -> None:
    """Optimised beside even placements, task by task."""
    print(
        "\ntrajectory   robots  placement  margin  pushed     position [mm]   orientation [rad]"
        "   force [N]  spread [N]"
    )
    for name in options.scenarios:
        for count in ROBOTS:
            both = []
            for placement in ("optimised", "even"):
                mine = [
                    r
                    for r in rows
                    if (r["scenario"], r.get("robots"), r.get("placement"))
                    == (name, count, placement)
                ]
                good = [r for r in mine if r["success"]]
                if not mine:
                    continue
                print(_line(name, count, placement, mine, good))
                both.append({r["seed"]: r["position_error_m"] for r in good})
            if len(both) == 2:
                seeds = sorted(set(both[0]) & set(both[1]))
                lower = sum(both[0][s] < both[1][s] for s in seeds)
                print(
                    f"{'':13s}the optimised one is nearer in {lower} of {len(seeds)} trials, "
                    f"p = {sign_test(lower, len(seeds)):.3f}"
                )
    _plots(tasks, options)


def _line(name: str, count: int, placement: str, mine: list[Row], good: list[Row]) -> str:
    def mean(column: str) -> float:
        return float(np.mean([r[column] for r in good])) if good else float("nan")

    worst = max((r["position_error_m"] for r in good), default=float("nan"))
    return (
        f"{name:13s}{count:5d}   {placement:10s} {mine[0]['margin']:6.3f}  {len(good):3d} of "
        f"{len(mine):<3d} {1e3 * mean('position_error_m'):6.2f} (<= {1e3 * worst:5.2f}) "
        f"{mean('orientation_error_rad'):12.4f}   {mean('force_n'):12.2f} "
        f"{mean('force_spread_n'):10.2f}"
    )


def _plots(tasks: Sequence[TrackingTask], options: StudyOptions) -> None:
    """As Figures 3.13, 3.14 and 3.16: ways, errors and forces of the first trial of each task."""
    for name in options.scenarios:
        for count in ROBOTS:
            mine = [
                t
                for t in tasks
                if (t.scenario, t.robots, t.seed) == (name, count, options.seed)
                and _trace_file(t).is_file()
            ]
            if mine:
                _figure(f"{name}-{count}", mine, options)


def _figure(name: str, tasks: Sequence[TrackingTask], options: StudyOptions) -> None:
    figure, axes = plt.subplots(1, 3, figsize=(13, 3.6))
    for task, style in zip(tasks, ("-", "--"), strict=False):
        trace = np.load(_trace_file(task))
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
