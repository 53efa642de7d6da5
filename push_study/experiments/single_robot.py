"""Section 2.6, Table 2.1: one robot brings an object to a pose; noise and uncertain friction."""

import json
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.settings import SettingsError
from push_ros.claims import own_domain
from push_scenario.scenario import Scenario, load_scenario
from push_study.job import check_goal, digest, run_job
from push_study.job_time import STATES
from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.summary import known
from push_study.thesis import TABLE_2_1
from push_study.uncertainty import uncertainty
from push_view.bodies import bodies_of
from push_view.drawing import draw_map
from push_view.report import write_report

SCENARIOS = tuple(f"env{e}-target{t}" for e in (1, 2, 3) for t in (1, 2, 3))
"""Where none are named."""
OPTIONS = {"uncertainty": "mild", "world": "pybullet"}
"""A scenario that names its world keeps it, unless another one is asked for."""


@dataclass(frozen=True)
class SingleRobotTask:
    """One trial. uncertainty: its name. world: its kind. digest: of
    the scenario's text, so that a changed one is another task."""

    scenario: str
    seed: int
    out: str
    uncertainty: str = "mild"
    world: str = "pybullet"
    record: bool = False
    digest: str = ""

    @property
    def trace_file(self) -> Path:
        """Where the trial leaves its trace; a scenario may be named by a path."""
        return Path(self.out) / f"trace-{Path(self.scenario).stem}-{self.seed}.npz"


def tasks(options: StudyOptions) -> list[SingleRobotTask]:
    """One a scenario and seed; the first is recorded."""
    digests, worlds = {}, {}
    level = uncertainty(options.uncertainty)
    for name in options.scenarios:
        scenario = load_scenario(name)
        check_goal(scenario)
        try:
            level.draw(scenario, options.seed)
        except SettingsError as error:
            raise SettingsError(f"scenario '{name}': {error}") from None
        digests[name] = digest(scenario)
        worlds[name] = _world(scenario, options)
    return [
        SingleRobotTask(
            name,
            options.seed + i,
            str(options.out),
            options.uncertainty,
            worlds[name],
            record=(i == 0 and j == 0),
            digest=digests[name],
        )
        for j, name in enumerate(options.scenarios)
        for i in range(options.trials)
    ]


def _world(scenario: Scenario, options: StudyOptions) -> str:
    default = OPTIONS["world"]
    if "world" in options.asked or (options.world or default) != default:
        return options.world
    return str(scenario.parameters.get("bridge", {}).get("world", default))


def trial(task: SingleRobotTask) -> Row:
    """Push the object to the scenario's goal once."""
    with own_domain():
        return _push(task)


def _push(task: SingleRobotTask) -> Row:
    level = uncertainty(task.uncertainty)
    believed, world, drawn = level.draw(load_scenario(task.scenario), task.seed)
    believed, world = (s.settings("bridge", world=task.world) for s in (believed, world))
    folder = Path(task.out)
    folder.mkdir(parents=True, exist_ok=True)  # on a machine of a cluster, perhaps
    if task.record and (folder / "bag").exists():
        shutil.rmtree(folder / "bag")  # of this trial, interrupted before its end

    bag = folder / "bag" if task.record else None
    about = {
        "experiment": "single-robot",
        "uncertainty": task.uncertainty,
        "drawn": json.dumps(known(drawn)),
    }
    measures, trace = run_job(believed, world, record=bag, about=about)
    if task.record:
        write_report(folder / "bag", folder / "report")
    np.savez_compressed(
        task.trace_file,
        time=np.array(trace.time[::10]),
        robot=np.array(trace.robot[::10]),
        object=np.array(trace.object[::10]),
    )
    return {"scenario": task.scenario, "seed": task.seed, **measures, **drawn}


def statistics(rows: list[Row]) -> dict[str, Any]:
    """By scenario: successes, mean and worst errors, mean time of a job and its ratios."""
    found: dict[str, Any] = {}
    for name in dict.fromkeys(r["scenario"] for r in rows):
        mine = [r for r in rows if r["scenario"] == name]
        cell: dict[str, Any] = {
            "trials": len(mine),
            "successes": sum(bool(r["success"]) for r in mine),
        }
        for measure in ("position_error_m", "orientation_error_rad"):
            values = [r[measure] for r in mine if measure in r]
            if values:
                cell[f"{measure}_mean"] = float(np.mean(values))
                cell[f"{measure}_worst"] = float(np.max(values))
        for measure in ("job_time_s", "time_ratio", "charged_ratio"):
            values = [r[measure] for r in mine if measure in r]
            if values:
                cell[f"{measure}_mean"] = float(np.mean(values))
        found[name] = cell
    return found


def conclude(options: StudyOptions, tasks: Sequence[SingleRobotTask], rows: list[Row]) -> None:
    """A picture of all trials of each scenario, and Table 2.1."""
    for name in options.scenarios if rows else ():
        files = [t.trace_file for t in tasks if t.scenario == name]
        _plot(name, [r for r in rows if r["scenario"] == name], files, options.out)
    _print_table(rows, list(options.scenarios))
    _print_times(rows, list(options.scenarios))


def _print_table(rows: list[Row], scenarios: list[str]) -> None:
    print("\nscenario        success   position error [mm]        orientation error [rad]")
    print("                          mean   std   max  thesis     mean    std     max   thesis")
    for name in scenarios:
        count = sum(r["scenario"] == name for r in rows)
        wins = sum(r["scenario"] == name and bool(r["success"]) for r in rows)
        mine = [r for r in rows if r["scenario"] == name and "position_error_m" in r]
        if not mine:
            print(f"{name:15s} {wins:3d}/{count:<3d}")
            continue
        p = 1e3 * np.array([r["position_error_m"] for r in mine])
        o = np.array([r["orientation_error_rad"] for r in mine])
        known = TABLE_2_1.get(name)
        tp = f"{1e3 * known[0]:.1f}/{1e3 * known[1]:.1f}" if known else "-"
        to = f"{known[2]:.3f}/{known[3]:.3f}" if known else "-"
        print(
            f"{name:15s} {wins:3d}/{count:<3d}  {p.mean():6.2f}{p.std():6.2f}{p.max():6.2f} "
            f"{tp:>9s}   {o.mean():.4f} {o.std():.4f} {o.max():.4f} {to:>11s}"
        )
    print("(thesis: mean/worst of Table 2.1, real robots)")


def _print_times(rows: list[Row], scenarios: list[str]) -> None:
    """Means over the trials; see ``push_study.job_time`` for the shortest time and the charge."""
    columns = ("job_time_s", *(f"{name.lower()}_s" for name in STATES), "shortest_time_s")
    print(
        "\nmean times [s]      job  plan  positioning  approach  push  detach   shortest  ratio"
        "  CPU of plans  ratio with it"
    )
    for name in scenarios:
        mine = [r for r in rows if r["scenario"] == name and "job_time_s" in r]
        if mine:
            job, *spent, least = (np.mean([r[c] for r in mine]) for c in columns)
            ratio, cpu, charged = (
                np.mean([r[c] for r in mine])
                for c in ("time_ratio", "planning_cpu_s", "charged_ratio")
            )
            print(
                f"{name:15s} {job:7.1f}{spent[0]:6.1f}{spent[1]:13.1f}{spent[2]:10.1f}"
                f"{spent[3]:6.1f}{spent[4]:8.1f}{least:11.1f}{ratio:7.2f}{cpu:14.1f}{charged:15.2f}"
            )
    print("(shortest: the faster wheel at its limit along the path that the robot drove)")


def _plot(name: str, rows: list[Row], traces: list[Path], out: Path) -> None:
    scenario = load_scenario(name)
    figure, axes = plt.subplots(figsize=(9, 6))
    draw_map(axes, scenario)
    outline = bodies_of(scenario).type(next(iter(scenario.objects))).outline
    good_seeds = {r["seed"] for r in rows if r["success"]}
    for path in traces:
        if path.is_file():
            way: Array = np.load(path)["object"]
            good = int(path.stem.rsplit("-", 1)[1]) in good_seeds
            axes.plot(
                way[:, 0], way[:, 1], lw=0.8, alpha=0.7, color="#2a62c9" if good else "#c22f3d"
            )
            axes.fill(*se2.transform(way[-1], outline).T, fill=False, lw=0.7)
    if scenario.goal is not None:
        axes.fill(*se2.transform(scenario.goal, outline).T, fill=False, lw=1.6, color="#c22f3d")
    axes.set_title(f"{scenario.name}: {len(good_seeds)} of {len(rows)} trials succeed")
    figure.savefig(out / f"{scenario.name}.png", dpi=130, bbox_inches="tight")
    plt.close(figure)
