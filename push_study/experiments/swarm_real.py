"""Section 4.3.2: five e-pucks, the square, the smaller targets; times beside those published.

delta is the time for a length of the object, as in 4.3.2. It depends on how fast the robots are:
Lambda is the time in units of robot speed over the way that the object has to go.
"""

from collections.abc import Sequence
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from push_model.settings import SettingsError
from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.summary import by_cell
from push_study.swarm.targets import EXPERIMENT, SwarmTask, draw_ways, length, run
from push_study.thesis import SWARM_REAL, SWARM_RIVALS

SCENARIOS = ("swarm_square",)
"""Objects, where none are named."""
OPTIONS = {"uncertainty": "mild", "world": "pybullet"}
ROBOTS, LAWS = 5, ("crescent", "thesis")
SIZE = 0.4  # [m] s_O: what 50.4 s, 902 s and 7.15 m of the thesis make it
_LIMIT = 2400.0  # [s]


def tasks(options: StudyOptions) -> list[SwarmTask]:
    """As many runs as trials, by both laws."""
    if options.scenarios != SCENARIOS:
        raise SettingsError(f"swarm-real supports only the scenario '{SCENARIOS[0]}'")
    return [
        SwarmTask(
            SCENARIOS[0],
            options.seed + k,
            str(options.out),
            ROBOTS,
            law,
            options.world or "pybullet",
            options.uncertainty,
            EXPERIMENT,
            _LIMIT,
        )
        for law in LAWS
        for k in range(options.trials)
    ]


def trial(task: SwarmTask) -> Row:
    """Through all six targets."""
    row = run(task)
    if row["success"]:
        row["delta_s"] = row["charged_s"] * SIZE / length(EXPERIMENT)
    return row


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Mean Lambda, time and delta by law."""
    return dict(by_cell(rows, ("law",), ("lambda", "charged_s", "delta_s")))


def conclude(options: StudyOptions, tasks: Sequence[SwarmTask], rows: list[Row]) -> None:
    """Beside the thesis's robots and its rivals."""
    print(
        f"\n{'':22s}all six      time [s]    delta [s]   Lambda"
        f"\n{'thesis, real robots':22s}            {SWARM_REAL['time']:5.0f} +- "
        f"{SWARM_REAL['std']:3.0f} {SWARM_REAL['delta']:8.1f}   {SWARM_REAL['lambda']:8.1f}"
    )
    for name, (delta, units) in SWARM_RIVALS.items():
        told = f"{delta:8.1f}" if delta else f"{'':8s}"
        print(f"{name:22s}{'':25s}{told}   {units:8.1f}")
    for law in LAWS:
        mine = [r for r in rows if r.get("law") == law]
        good = [r for r in mine if r["success"]]
        if good:
            table = np.array([[r[k] for k in ("charged_s", "delta_s", "lambda")] for r in good])
            mean, least, most = table.mean(axis=0), table.min(axis=0), table.max(axis=0)
            print(
                f"{law:22s}{len(good):2d} of {len(mine):<2d}    {mean[0]:5.0f} +- "
                f"{table[:, 0].std():3.0f} {mean[1]:8.1f}   {mean[2]:8.2f} "
                f"({least[2]:.2f} to {most[2]:.2f})"
            )
        elif mine:
            print(f"{law:22s} 0 of {len(mine)}")
    figure, axes = plt.subplots(1, len(LAWS), figsize=(9, 4.4))
    for ax, law in zip(axes, LAWS, strict=True):
        first = [t for t in tasks if (t.law, t.seed) == (law, options.seed) and t.trace.is_file()]
        for task in first:
            draw_ways(ax, task)
        ax.set_title(law, fontsize=9)
    figure.tight_layout()
    figure.savefig(options.out / "ways.png", dpi=110)
    plt.close(figure)
