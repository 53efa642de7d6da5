"""Late poses: what the latency of motion capture costs a group that follows a trajectory.

The pushes of ``group-tracking`` from evenly spaced places, with latencies that the nodes know, and
with one that they do not. The frictions, which are drawn by the seed, are equal for all of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from push_study.experiments import group_tracking
from push_study.experiments.group_tracking import ROBOTS, TrackingTask
from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.summary import by_cell
from push_study.uncertainty import Uncertainty

SCENARIOS = group_tracking.SCENARIOS
"""Trajectories, where none are named."""
OPTIONS = {"uncertainty": "mild", "world": "planar"}
CELLS = ((0.0, True), (0.02, True), (0.05, True), (0.1, True), (0.1, False))
"""Latencies [s], and whether the nodes know them; otherwise they take the poses for new."""
_MEASURES = ("position_error_m", "orientation_error_rad")


@dataclass(frozen=True)
class LatencyTask(TrackingTask):
    """A push. latency_s: [s]; known: whether the nodes know it, otherwise they believe in none."""

    latency_s: float = 0.0
    known: bool = True

    @property
    def doubt(self) -> Uncertainty:
        """What the nodes do not know."""
        believed = self.latency_s if self.known else 0.0
        late = (self.latency_s, self.latency_s)
        return replace(super().doubt, latency=late, believed_latency=believed)

    @property
    def trace(self) -> Path:
        """Where its push is kept."""
        path = super().trace
        return path.with_name(f"{path.stem}-{1e3 * self.latency_s:.0f}ms-{int(self.known)}.npz")


def tasks(options: StudyOptions) -> list[LatencyTask]:
    """Every trajectory, number of robots and latency, with as many seeds as there are trials."""
    options = replace(options, world=options.world or OPTIONS["world"])
    return [
        LatencyTask(**vars(task), latency_s=latency, known=known)
        for task in group_tracking.tasks(options)
        for latency, known in CELLS
        if task.placement == "even"
    ]


def trial(task: LatencyTask) -> Row:
    """Go to the places and push."""
    row = group_tracking.trial(task)
    return row | {"latency_s": task.latency_s, "known": task.known}


def _mine(rows: list[Row], name: str, count: int, latency: float, known: bool) -> list[Row]:
    key = name, count, latency, known
    return [
        r
        for r in rows
        if (r["scenario"], r.get("robots"), r.get("latency_s"), r.get("known")) == key
    ]


def _error(rows: list[Row], key: str) -> float:
    values = [r[key] for r in rows if r["success"] and key in r]
    return float(np.mean(values)) if values else float("nan")


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Mean errors by trajectory, number of robots, latency and whether it is known; the greatest
    ratio of the position error to that without latency, over trajectories and numbers of robots."""
    result: dict[str, Any] = dict(
        by_cell(rows, ("scenario", "robots", "latency_s", "known"), _MEASURES)
    )
    for latency, known in CELLS[1:]:
        ratios = [
            _error(_mine(rows, name, count, latency, known), _MEASURES[0])
            / _error(_mine(rows, name, count, *CELLS[0]), _MEASURES[0])
            for name in dict.fromkeys(r["scenario"] for r in rows)
            for count in ROBOTS
            if _mine(rows, name, count, latency, known)
        ]
        told = "known" if known else "unknown"
        if ratios:
            result[f"greatest_ratio_{1e3 * latency:.0f}_ms_{told}"] = float(np.max(ratios))
    return result


def conclude(options: StudyOptions, tasks: Sequence[LatencyTask], rows: list[Row]) -> None:
    """A line for each trajectory and number of robots: mean errors by latency."""
    titles = [f"{1e3 * late:.0f} ms" + ("" if known else " unknown") for late, known in CELLS]
    print("\nposition error [mm] (orientation error [rad]), means over the push, by latency")
    print("trajectory   robots  " + "".join(f"{title:>18s}" for title in titles))
    for name in options.scenarios:
        for count in ROBOTS:
            cells = [_mine(rows, name, count, *cell) for cell in CELLS]
            told = "".join(
                f"{1e3 * _error(r, _MEASURES[0]):9.2f} ({_error(r, _MEASURES[1]):.4f})"
                for r in cells
            )
            print(f"{name:13s}{count:5d}   {told}")
