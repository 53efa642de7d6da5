"""What the crescent law needs to know of the outline, and what it finds out by itself.

The method is given a wrong outline: a scaled one, or the circle about the centre that holds the
object (``disc``), which is all that the printed law is told. The world has the right one. Each
wrong outline is used twice: as it is (``told``), and as the first outline of the estimator
(``estimated``).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from push_bringup.systems import OUTLINE_ESTIMATOR
from push_model.arrays import Array
from push_model.shape_specs import PolygonShape
from push_model.specs import ObjectSpec
from push_scenario.bodies import load_object
from push_scenario.scenario import Scenario
from push_study.pool import Row
from push_study.statistics import wilson
from push_study.study import StudyOptions
from push_study.summary import by_cell
from push_study.swarm.targets import EXPERIMENT, SwarmTask, length, run
from push_study.team_run import OBJECT

SCENARIOS = ("swarm_square", "swarm_ellipse", "swarm_flower", "transport_plus", "transport_l")
"""Objects, where none are named."""
OPTIONS = {"uncertainty": "mild", "world": "planar"}
BELIEVED: dict[str, float | None] = {
    "-20 %": 0.8,
    "-10 %": 0.9,
    "-5 %": 0.95,
    "exact": 1.0,
    "+5 %": 1.05,
    "+10 %": 1.1,
    "+20 %": 1.2,
    "disc": None,
}
"""Scale of the outline that is given, by name; None for the circumscribed disc."""
ARMS = ("told", "estimated")
ROBOTS = 8
_LIMIT = 300.0  # [s]; the exact outline takes about 80
_CORNERS = 48  # of the disc
_MOMENTS = 5  # of a run that are drawn


@dataclass(frozen=True)
class OutlineTask(SwarmTask):
    """A run through the six targets. believed: key of ``BELIEVED``. arm: one of ``ARMS``."""

    believed: str = "exact"
    arm: str = "told"

    @property
    def trace(self) -> Path:
        """Where its ways are kept."""
        number = list(BELIEVED).index(self.believed)
        path = super().trace
        return path.with_name(f"{path.stem}-{number}-{self.arm}.npz")


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
    return replace(item, shape=PolygonShape(vertices=vertices, frame="given"))


def tasks(options: StudyOptions) -> list[OutlineTask]:
    """Every object with every outline that is given, with and without the estimator, as often as
    there are trials."""
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
            arm,
        )
        for name in options.scenarios
        for believed in BELIEVED
        for arm in ARMS
        for k in range(options.trials)
    ]


def trial(task: OutlineTask) -> Row:
    """Through all six targets with what is given."""

    def mistake(scenario: Scenario) -> Scenario:
        item, start = scenario.objects[OBJECT]
        wrong = mistaken(item, BELIEVED[task.believed])
        scenario = replace(scenario, objects={OBJECT: (wrong, start)})
        return scenario.settings(OUTLINE_ESTIMATOR, enabled=task.arm == "estimated")

    row = run(task, mistake)
    later = [row[k] for k in row if k.startswith("lambda_") and k != "lambda_1"]
    if later:
        row["lambda_later"] = float(np.mean(later))
    return row | {"believed": task.believed, "arm": task.arm}


_MEASURES = ("lambda", "lambda_1", "lambda_later", "charged_s")


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Lambda of all targets, of the first and of the later ones, by what is given and arm, of each
    object and of all; and the share of targets that were reached."""
    found: dict[str, Any] = dict(by_cell(rows, ("scenario", "believed", "arm"), _MEASURES))
    for believed in BELIEVED:
        for arm in ARMS:
            mine = _of(rows, believed, arm)
            if not mine:
                continue
            reached, every = (sum(r.get("targets", 0) for r in mine), len(EXPERIMENT) * len(mine))
            all_of = {key: [r[key] for r in mine if key in r] for key in _MEASURES}
            found[f"{believed}, {arm}"] = {
                "targets": reached,
                "of": every,
                "wilson": wilson(reached, every),
                **{key: float(np.mean(values)) for key, values in all_of.items() if values},
            }
    return found


def _of(rows: Sequence[Row], believed: str, arm: str, name: str = "") -> list[Row]:
    return [
        r
        for r in rows
        if (r.get("believed"), r.get("arm")) == (believed, arm) and name in ("", r["scenario"])
    ]


def conclude(options: StudyOptions, tasks: Sequence[OutlineTask], rows: list[Row]) -> None:
    """Targets that are reached, and Lambda, by object, by what is given, and by arm."""
    print(f"\nsix targets, {length(EXPERIMENT):.2f} m straight from one to the next")
    print("object            given     arm        targets     Lambda   first   later")
    for name in (*options.scenarios, ""):
        for believed in BELIEVED:
            for arm in ARMS:
                mine = _of(rows, believed, arm, name)
                if not mine:
                    continue
                reached = (
                    f"{sum(r.get('targets', 0) for r in mine)} of {len(EXPERIMENT) * len(mine)}"
                )
                values = "".join(_mean(mine, key) for key in _MEASURES[:3])
                print(f"{name or 'all':17s} {believed:9s} {arm:10s} {reached:10s}{values}")
    _draw(options, rows)
    for task in tasks:
        if (task.believed, task.arm, task.seed) == ("disc", "estimated", options.seed):
            _draw_estimates(options.out / f"estimates-{task.scenario}.png", task)


def _mean(rows: Sequence[Row], key: str) -> str:
    values = [r[key] for r in rows if key in r]
    return f"{np.mean(values):8.2f}" if values else "       -"


def _draw(options: StudyOptions, rows: list[Row]) -> None:
    """Share of targets that are reached, and Lambda, over what is given."""
    names = list(BELIEVED)
    figure, (above, below) = plt.subplots(2, 1, figsize=(6.0, 5.2), sharex=True)
    for arm, style in zip(ARMS, ("o--", "s-"), strict=True):
        cells = [_of(rows, believed, arm) for believed in names]
        shares = [
            np.mean([r.get("targets", 0) for r in c]) / len(EXPERIMENT) if c else np.nan
            for c in cells
        ]
        above.plot(names, 100.0 * np.array(shares), style, label=arm)
        means = [np.mean([r["lambda"] for r in c if "lambda" in r] or [np.nan]) for c in cells]
        below.plot(names, means, style, label=arm)
    above.set_ylabel("targets reached [%]")
    below.set_ylabel("Lambda of complete runs")
    below.set_xlabel("outline that the method is given")
    above.legend()
    figure.tight_layout()
    figure.savefig(options.out / "outline.png", dpi=110)
    plt.close(figure)


def _draw_estimates(path: Path, task: OutlineTask) -> None:
    """The outline at some moments of a run, beside the true one."""
    if not task.trace.is_file():
        return
    kept, true = np.load(task.trace), load_object(task.scenario).outline
    times = kept["outline_times"]
    if not len(times):
        return
    chosen = np.linspace(0, len(times) - 1, min(_MOMENTS, len(times))).astype(int)
    figure, axes = plt.subplots(1, len(chosen), figsize=(2.4 * len(chosen), 2.7), squeeze=False)
    for ax, k in zip(axes[0], chosen, strict=True):
        ax.fill(*true.T, color="0.85", label="true")
        outline = kept[f"outline_{k}"]
        ax.plot(*np.vstack([outline, outline[:1]]).T, color="C1", lw=1.4, label="estimated")
        ax.set_title(f"{times[k]:.0f} s", fontsize=9)
        ax.set_aspect("equal")
        ax.set_axis_off()
    axes[0, 0].legend(fontsize=7, loc="lower left", bbox_to_anchor=(0.0, -0.12))
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)
