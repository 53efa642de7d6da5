"""Our laws beside other people's swarms, on common tasks: five objects, twenty e-pucks, one room.

The rivals are reconstructed from their papers, each in a file of ``push_study/rivals``, which says
what is reconstructed. Ours runs on every trial, the others on every tenth, at least one.
"""

from collections.abc import Sequence
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from push_scenario.bodies import load_object
from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.summary import by_cell
from push_study.swarm.contest import OURS, RIVALS, RivalTask, run

SCENARIOS = (
    "transport_square",
    "swarm_hexagon",
    "transport_circle",
    "transport_rectangle",
    "transport_triangle",
)
"""Objects, where none are named."""
OPTIONS = {"uncertainty": "mild", "world": "planar"}
METHODS = (*OURS, *RIVALS)
ROBOTS = 20
_THEIRS = 0.35  # [m] about what Queiroz and MacRae take for reached
_LIMIT = 1200.0  # [s] as Queiroz and MacRae give


def tasks(options: StudyOptions) -> list[RivalTask]:
    """Every object by every method."""
    for name in options.scenarios:
        load_object(name)
    return [
        RivalTask(
            name,
            options.seed + k,
            str(options.out),
            method,
            ROBOTS,
            options.world or "planar",
            options.uncertainty,
            _LIMIT,
        )
        for method in METHODS
        for name in options.scenarios
        for k in range(options.trials)
        if method == OURS[0] or k % 10 == 0
    ]


def trial(task: RivalTask) -> Row:
    """To the target."""
    return run(task)


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Mean Lambda and time by method and object."""
    return dict(by_cell(rows, ("method", "scenario"), ("lambda", "charged_s")))


def conclude(options: StudyOptions, tasks: Sequence[RivalTask], rows: list[Row]) -> None:
    """Times and Lambda by method and object; a box plot."""
    print(f"\n{'':14s}" + "".join(f"{n.split('_')[1]:>26s}" for n in options.scenarios))
    for method in METHODS:
        cells = [_cell([r for r in rows if _is(r, method, n)]) for n in options.scenarios]
        mine = [r for r in rows if r.get("method") == method]
        good = sum(bool(r["success"]) for r in mine)
        near = sum(r["nearest_m"] < _THEIRS for r in mine if "nearest_m" in r)
        all_in_all = f"   {good} of {len(mine)}, {near} within {_THEIRS} m"
        print(f"{method:14s}" + "".join(f"{c:>26s}" for c in cells) + all_in_all)
    print("reached (0.1 m) of all, mean time +- deviation [s], mean Lambda")
    figure, ax = plt.subplots(figsize=(9, 3.2))
    for k, name in enumerate(options.scenarios):
        found = [[r["lambda"] for r in rows if _is(r, m, name) and r["success"]] for m in METHODS]
        places = [(len(METHODS) + 1) * k + i for i in range(len(METHODS))]
        boxes = ax.boxplot(
            [f or [np.nan] for f in found], positions=places, widths=0.7, patch_artist=True
        )
        for i, box in enumerate(boxes["boxes"]):
            box.set_facecolor(f"C{i}")
            box.set_label(METHODS[i] if k == 0 else None)
    ax.set_yscale("log")
    ax.set_ylabel("Lambda")
    middles = [(len(METHODS) + 1) * k + 2 for k in range(len(options.scenarios))]
    ax.set_xticks(middles, [n.split("_")[1] for n in options.scenarios])
    ax.legend(fontsize=7, ncol=len(METHODS))
    figure.tight_layout()
    figure.savefig(options.out / "lambda.png", dpi=110)
    plt.close(figure)


def _is(row: Row, method: str, name: str) -> bool:
    return (row.get("method"), row["scenario"]) == (method, name)


def _cell(rows: list[Row]) -> str:
    good = [r for r in rows if r["success"]]
    if not good:
        return f"0 of {len(rows)}" if rows else "-"
    times = [r["charged_s"] for r in good]
    told = (
        f"{np.mean(times):.0f} +- {np.std(times):.0f}, {np.mean([r['lambda'] for r in good]):.1f}"
    )
    return f"{len(good)} of {len(rows)}  {told}"
