"""Section 3.1.4: random grasps, four shapes, six trajectories; which test, which index tells.

Besides the thesis's indices: the margin of the compatibility test, MHD with torques in the limit
surface's scale, and the energy of the least forces (``grasp_opt/effort.py``).
"""

import hashlib
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from grasp_opt.contact_outline import ContactOutline, Contacts
from grasp_opt.effort import least_effort
from grasp_opt.indices import composed_quality, dexterity, extension, modified_hausdorff
from grasp_opt.object_trajectory import ObjectTrajectory, study_trajectories
from grasp_opt.selection import random_grasp
from grasp_opt.wrench_cone import HELD, margin, task_wrenches, wrench_rays
from push_model.specs import ObjectSpec
from push_scenario.bodies import load_object
from push_study.formation import push
from push_study.pool import Row
from push_study.statistics import (
    Correlation,
    contingency,
    correlation,
    cross_validated,
    fisher,
    rank_sum,
)
from push_study.study import StudyOptions

SCENARIOS = ("plate_square", "plate_triangle", "plate_hexagon", "plate_ellipse")
"""Objects, where none are named."""
OPTIONS = {"world": "pybullet"}
ROBOTS, RADIUS = 3, 0.05
"""How many, and [m] of each."""
_EVERY = 5  # samples of a trajectory of which the least forces are asked
THESIS_TABLE = ((181, 8), (18, 33))
"""Table 3.1."""
THESIS_CORRELATIONS = {"I_D": -0.1697, "I_E": -0.1321, "I_G": -0.0604, "MHD": -0.3717}
"""Table 3.2."""
PRINTED = {"I_D": "composed", "I_E": "extension", "I_G": "dexterity_printed", "MHD": "mhd_printed"}
"""Columns of the indices as printed, torques in Nm beside forces in N."""
OURS = {
    "least energy": "least_energy_n",
    "margin": "margin",
    "MHD, scaled": "mhd",
    "I_G, scaled": "dexterity",
}
"""Columns of what is ours."""


@dataclass(frozen=True)
class GraspTask:
    """One push. scenario: name of the object; grasp: number of the random one; digest: of what
    the object is."""

    scenario: str
    seed: int
    out: str
    trajectory: str
    grasp: int
    world: str
    digest: str = ""


def tasks(options: StudyOptions) -> list[GraspTask]:
    """Every object along every trajectory, with as many grasps as there are trials."""
    world = options.world or "pybullet"
    digests = {
        name: hashlib.sha256(repr(load_object(name)).encode()).hexdigest()[:16]
        for name in options.scenarios
    }
    return [
        GraspTask(name, options.seed, str(options.out), trajectory, grasp, world, digests[name])
        for name in options.scenarios
        for trajectory in study_trajectories()
        for grasp in range(options.trials)
    ]


def draw(task: GraspTask, item: ObjectSpec, trajectory: ObjectTrajectory) -> Contacts:
    """The random grasp of a task: the same in every world."""
    name = f"{task.scenario} {task.trajectory}"
    random = np.random.default_rng([task.seed, zlib.crc32(name.encode()), task.grasp])
    moving = np.hypot(*trajectory.twist[:, :2].T) > 0.0
    first = trajectory.body_twists[np.argmax(moving), :2]
    return random_grasp(ContactOutline(item.geometry), ROBOTS, RADIUS, first, random)


def predictors(item: ObjectSpec, contacts: Contacts, trajectory: ObjectTrajectory) -> Row:
    """What can be said of a grasp before it pushes."""
    surface, mu = item.limit_surface(), item.contact_friction
    points, normals, twists = contacts.points, contacts.normals, trajectory.body_twists
    row: Row = {
        "composed": float(composed_quality(points, normals)),
        "extension": float(extension(points)),
    }
    for suffix, length in (("", surface.radius), ("_printed", 1.0)):
        rays = wrench_rays(points, normals, mu, length, bisectors=True)
        wrenches = task_wrenches(twists, surface, length)
        row[f"dexterity{suffix}"] = float(dexterity(points, length))
        row[f"mhd{suffix}"] = float(modified_hausdorff(rays[None], wrenches)[0])
    row["margin"] = margin(
        wrench_rays(points, normals, mu, surface.radius),
        task_wrenches(twists, surface, surface.radius),
    )
    row["test"] = bool(row["margin"] >= -HELD)
    effort = least_effort(contacts, mu, twists[::_EVERY], surface)
    row["least_energy_n"], row["lacking"] = effort.energy, effort.lacking
    return row


def trial(task: GraspTask) -> Row:
    """Push once."""
    item = load_object(task.scenario)
    trajectory = study_trajectories()[task.trajectory]
    contacts = draw(task, item, trajectory)
    done = push(item, contacts, trajectory, RADIUS, task.world)
    row = {
        "scenario": task.scenario,
        "seed": task.seed,
        "trajectory": task.trajectory,
        "grasp": task.grasp,
        "success": done.success,
        "displacement": done.displacement,
        "widest_gap_m": done.widest,
        "astray_m": done.astray,
        "position_error_m": done.position,
        "orientation_error_rad": done.orientation,
        "length_m": trajectory.length,
        "duration_s": done.outcome.seconds,
        "planning_cpu_s": done.outcome.planning,
        "charged_s": done.outcome.charged,
        **predictors(item, contacts, trajectory),
    }
    return row | ({"energy_n": done.energy} if np.isfinite(done.energy) else {})


@dataclass(frozen=True)
class Findings:
    """Table 3.1 ``(2, 2)``, p-values, and the correlations of E with everything; by name."""

    table: Any
    rank_sum: float
    fisher: float
    correlations: dict[str, Correlation]
    validated: dict[str, Correlation]


def findings(rows: Sequence[Row]) -> Findings:
    """What the rows amount to; correlations are those of successful pushes, as in 3.1.4."""
    test = np.array([r["test"] for r in rows], dtype=bool)
    success = np.array([r["success"] for r in rows], dtype=bool)
    slid = np.array([r["displacement"] for r in rows], dtype=np.float64)
    done = [r for r in rows if r["success"] and "energy_n" in r]
    spent = np.array([r["energy_n"] for r in done], dtype=np.float64)
    columns = {**PRINTED, **OURS}
    values = {
        name: np.array([r[column] for r in done], dtype=np.float64)
        for name, column in columns.items()
    }
    table = contingency(test, success)
    known = {n: correlation(v, spent) for n, v in values.items()}
    validated = {}
    for name, value in values.items():
        good = np.isfinite(value)
        validated[name] = cross_validated(value[good, None], spent[good])
    return Findings(table, rank_sum(slid[test], slid[~test]), fisher(table), known, validated)


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Table 3.1, its p-values, and Pearson's r of E with every index, also cross-validated."""
    rows = [r for r in rows if "margin" in r]
    if not rows:
        return {}
    found = findings(rows)
    (failed_fails, failed_passes), (done_fails, done_passes) = found.table.astype(int).tolist()
    result: dict[str, Any] = {
        "failed_where_test_fails": failed_fails,
        "failed_where_test_passes": failed_passes,
        "succeeded_where_test_fails": done_fails,
        "succeeded_where_test_passes": done_passes,
        "ranksum_p": found.rank_sum,
        "fisher_p": found.fisher,
    }
    for kind, by_index in (
        ("correlation", found.correlations),
        ("cross_validated", found.validated),
    ):
        for index, c in by_index.items():
            result[f"{kind}_{index}"] = {
                "r": c.r,
                "p": c.p,
                "low": c.low,
                "high": c.high,
                "count": c.count,
            }
    return result


def conclude(options: StudyOptions, tasks: Sequence[GraspTask], rows: list[Row]) -> None:
    """Tables 3.1 and 3.2 beside the thesis's, Figures 3.5 and 3.6."""
    rows = [r for r in rows if "margin" in r]
    if not rows:
        return
    found = findings(rows)
    t, p = found.table.astype(int), THESIS_TABLE
    print("\nmanipulation   test fails   test passes      (thesis: fails, passes)")
    for i, name in enumerate(("failed", "succeeded")):
        print(f"{name:14s} {t[i, 0]:10d} {t[i, 1]:13d}      {p[i][0]:13d} {p[i][1]:7d}")
    print(
        f"rank-sum p {found.rank_sum:.2e} (thesis 1.66e-15), Fisher p {found.fisher:.2e} "
        "(thesis 3.22e-20)"
    )
    count = max(c.count for c in found.correlations.values())
    print(f"\ncorrelation with E of {count} successful pushes")
    print("index            r       p          95 % interval      cross-validated    thesis")
    for name, c in found.correlations.items():
        thesis = THESIS_CORRELATIONS.get(name)
        told = "" if thesis is None else f"{thesis:+.3f}"
        v = found.validated[name]
        print(
            f"{name:13s} {c.r:+7.3f}   {c.p:8.1e}   {c.low:+.3f} .. {c.high:+.3f}   "
            f"{v.r:+.3f} ({v.low:+.3f} .. {v.high:+.3f})   {told}"
        )
    _plots(rows, options)


def _plots(rows: Sequence[Row], options: StudyOptions) -> None:
    columns = {**PRINTED, **OURS}
    done = [r for r in rows if r["success"] and "energy_n" in r]
    figure, axes = plt.subplots(2, 4, figsize=(14, 6))
    for axis, (name, column) in zip(axes.ravel(), columns.items(), strict=True):
        for shape in options.scenarios:
            mine = [r for r in done if r["scenario"] == shape and np.isfinite(r[column])]
            axis.plot([r[column] for r in mine], [r["energy_n"] for r in mine], ".", label=shape)
        axis.set_xlabel(name)
        if name == "I_D":  # a product of reciprocals
            axis.set_xscale("log")
    axes[0, 0].set_ylabel("E [N]")
    axes[1, 0].set_ylabel("E [N]")
    axes[0, 0].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(options.out / "indices.png", dpi=110)
    plt.close(figure)
    groups = [[max(1e-4, r["displacement"]) for r in rows if r["test"] == t] for t in (False, True)]
    if all(groups):
        figure, axis = plt.subplots(figsize=(4.5, 4))
        axis.violinplot([np.log10(g) for g in groups], showmedians=True)
        axis.set_xticks([1, 2], ["test fails", "test passes"])
        axis.set_ylabel("log10 of displacement (3.2)")
        figure.tight_layout()
        figure.savefig(options.out / "displacement.png", dpi=110)
        plt.close(figure)
