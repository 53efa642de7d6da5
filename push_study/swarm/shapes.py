"""Section 4.3.1 by one law: four shapes, swarms of 8 to 20 e-pucks, six targets; Figures 4.8, 4.10.

The thesis's box plot has no numbers beside it.
"""

from collections.abc import Sequence

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from push_scenario.bodies import load_object
from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.swarm.figures import draw_figures
from push_study.swarm.targets import SIMULATION, SwarmTask, draw_ways, length

SHAPES = ("swarm_ellipse", "swarm_octagon", "swarm_rectangle", "swarm_flower")
"""Objects, where none are named."""
ROBOTS = (8, 12, 16, 20)
_LIMIT = 2400.0  # [s]


def tasks_by(law: str, options: StudyOptions) -> list[SwarmTask]:
    """Every object with every swarm."""
    for name in options.scenarios:
        load_object(name)
    return [
        SwarmTask(
            name,
            options.seed + k,
            str(options.out),
            count,
            law,
            options.world or "pybullet",
            options.uncertainty,
            SIMULATION,
            _LIMIT,
        )
        for name in options.scenarios
        for count in ROBOTS
        for k in range(options.trials)
    ]


def conclude(options: StudyOptions, tasks: Sequence[SwarmTask], rows: list[Row]) -> None:
    """Times by shape and size; a box plot; ways of the first trials; Figures 4.3 to 4.6."""
    print(f"\nsix targets, {length(SIMULATION):.2f} m straight from one to the next")
    print("object            robots   all six   charged time [s]      Lambda")
    for name in options.scenarios:
        for count in ROBOTS:
            mine = _those(rows, name, count)
            good = [r for r in mine if r["success"]]
            if mine:
                print(
                    f"{name:17s}{count:5d}   {len(good):2d} of {len(mine):<2d}"
                    f"  {_spread([r['charged_s'] for r in good], 0)}"
                    f"  {_spread([r['lambda'] for r in good], 2)}"
                )
    _boxes(options, rows)
    draw_figures(options.out)
    for name in options.scenarios:
        firsts = [
            t for t in tasks if t.scenario == name and t.seed == options.seed and t.trace.is_file()
        ]
        if firsts:
            _ways(options, name, firsts)


def _those(rows: list[Row], name: str, count: int) -> list[Row]:
    return [r for r in rows if (r["scenario"], r.get("robots")) == (name, count)]


def _spread(values: list[float], digits: int) -> str:
    if not values:
        return " " * 22
    mean, least, most = (f(values) for f in (np.mean, np.min, np.max))
    return f"{mean:7.{digits}f} ({least:.{digits}f} to {most:.{digits}f})"


def _boxes(options: StudyOptions, rows: list[Row]) -> None:
    """As Figure 4.8."""
    figure, ax = plt.subplots(figsize=(9, 3))
    for k, name in enumerate(options.scenarios):
        found = [
            [r["charged_s"] for r in _those(rows, name, count) if r["success"]] for count in ROBOTS
        ]
        places = [5 * k + i for i in range(len(ROBOTS))]
        ax.boxplot([f or [np.nan] for f in found], positions=places, widths=0.7)
    ax.set_ylabel("time with planning [s]")
    ax.set_ylim(bottom=0.0)
    ticks = [5 * k + i for k in range(len(options.scenarios)) for i in range(len(ROBOTS))]
    ax.set_xticks(ticks, [str(c) for c in ROBOTS] * len(options.scenarios), fontsize=7)
    ax.set_xlabel("robots: " + ", ".join(options.scenarios))
    figure.tight_layout()
    figure.savefig(options.out / "times.png", dpi=110)
    plt.close(figure)


def _ways(options: StudyOptions, name: str, tasks: Sequence[SwarmTask]) -> None:
    """As Figure 4.10: a column a swarm."""
    figure, axes = plt.subplots(1, len(ROBOTS), figsize=(3 * len(ROBOTS), 3))
    for task in tasks:
        ax = axes[ROBOTS.index(task.robots)]
        draw_ways(ax, task)
        ax.set_title(f"{task.robots} robots", fontsize=8)
        ax.tick_params(labelsize=6)
    figure.tight_layout()
    figure.savefig(options.out / f"{name}.png", dpi=90)
    plt.close(figure)
