"""How our law depends on the outline that it believes: scaled, and as the circumscribed disc.

The printed law knows a radius, ours an outline. Here the method is given a wrong one, the world has
the right one. ``disc`` is the circle about the centre that holds the object: all that the printed
law is told. Lambda over the error of the outline shows what the knowledge is worth.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from push_model.arrays import Array
from push_model.shape_specs import PolygonShape
from push_model.specs import ObjectSpec
from push_scenario.scenario import Scenario
from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.summary import by_cell
from push_study.swarm.targets import EXPERIMENT, SwarmTask, length, run
from push_study.team_run import OBJECT

SCENARIOS = ("swarm_square", "swarm_ellipse", "transport_l")
"""Objects, where none are named."""
OPTIONS = {"uncertainty": "mild", "world": "planar"}
BELIEVED: dict[str, float | None] = {
    "-10 %": 0.9,
    "-5 %": 0.95,
    "exact": 1.0,
    "+5 %": 1.05,
    "+10 %": 1.1,
    "disc": None,
}
"""Scale of the outline that is believed, by name; None for the circumscribed disc."""
ROBOTS = 8
_LIMIT = 600.0  # [s]; the exact outline takes about 80
_CORNERS = 48  # of the disc


@dataclass(frozen=True)
class OutlineTask(SwarmTask):
    """A run through the six targets. believed: key of ``BELIEVED``."""

    believed: str = "exact"

    @property
    def trace(self) -> Path:
        """Where its ways are kept."""
        number = list(BELIEVED).index(self.believed)
        path = super().trace
        return path.with_name(f"{path.stem}-{number}.npz")


def mistaken(item: ObjectSpec, scale: float | None) -> ObjectSpec:
    """An object with a scaled outline, or with its circumscribed disc (scale None)."""
    outline: Array = item.outline
    if scale is None:
        radius = float(np.hypot(*outline.T).max())
        angles = np.linspace(0.0, 2.0 * np.pi, _CORNERS, endpoint=False)
        outline = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    else:
        outline = scale * outline
    vertices = tuple((float(x), float(y)) for x, y in outline)
    return replace(item, shape=PolygonShape(vertices=vertices))


def tasks(options: StudyOptions) -> list[OutlineTask]:
    """Every object with every belief, as often as there are trials."""
    return [
        OutlineTask(
            name,
            options.seed + k,
            str(options.out),
            ROBOTS,
            "crescent",
            options.world or "planar",
            options.uncertainty,
            EXPERIMENT,
            _LIMIT,
            believed,
        )
        for name in options.scenarios
        for believed in BELIEVED
        for k in range(options.trials)
    ]


def trial(task: OutlineTask) -> Row:
    """Through all six targets with what is believed."""
    scale = BELIEVED[task.believed]

    def mistake(scenario: Scenario) -> Scenario:
        item, start = scenario.objects[OBJECT]
        return replace(scenario, objects={OBJECT: (mistaken(item, scale), start)})

    row = run(task, None if scale == 1.0 else mistake)
    return row | {"believed": task.believed}


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Mean Lambda and charged time by object and belief."""
    return dict(by_cell(rows, ("scenario", "believed"), ("lambda", "charged_s")))


def conclude(options: StudyOptions, tasks: Sequence[OutlineTask], rows: list[Row]) -> None:
    """Runs that reach all targets, and Lambda, by object and belief."""
    print(f"\nsix targets, {length(EXPERIMENT):.2f} m straight from one to the next")
    print("object            believed   all six  targets   Lambda, mean (min to max)")
    figure, ax = plt.subplots(figsize=(5.5, 3.6))
    for name in options.scenarios:
        points = []
        for believed, scale in BELIEVED.items():
            mine = [r for r in rows if (r.get("scenario"), r.get("believed")) == (name, believed)]
            if not mine:
                continue
            units = [r["lambda"] for r in mine if r["success"]]
            reached = float(np.mean([r["targets"] for r in mine]))
            told = f"{np.mean(units):.2f} ({min(units):.2f} to {max(units):.2f})" if units else "-"
            count = f"{len(units):d} of {len(mine)}"
            print(f"{name:17s} {believed:9s}  {count:9s} {reached:5.1f}   {told}")
            if scale is not None and units:
                points.append((100.0 * (scale - 1.0), float(np.mean(units))))
        if points:
            ax.plot(*np.array(points).T, "o-", label=name)
    ax.set_xlabel("error of the believed outline [%]")
    ax.set_ylabel("Lambda of the runs that reach all targets")
    if ax.lines:
        ax.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(options.out / "outline.png", dpi=110)
    plt.close(figure)
